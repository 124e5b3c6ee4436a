# The module dccd for Python 3 (python/), on the core's public library.
option(DEFORMABLE_CCD_PYTHON "Build the Python module where pybind11 is installed" ON)
if(NOT DEFORMABLE_CCD_PYTHON OR DEFORMABLE_CCD_SANITIZE OR DEFORMABLE_CCD_FUZZ OR CMAKE_CROSSCOMPILING)
  return()
endif()
if(PYTHON_EXECUTABLE AND NOT Python3_EXECUTABLE)
  set(Python3_EXECUTABLE ${PYTHON_EXECUTABLE})  # the one that catkin found
endif()
find_package(Python3 QUIET COMPONENTS Interpreter Development)
find_package(pybind11 2.6 CONFIG QUIET)
if(NOT Python3_Development_FOUND OR NOT pybind11_FOUND)
  message(STATUS "pybind11 2.6 or Python's headers (pybind11-dev, python3-dev) are not installed: no Python module dccd")
  return()
endif()

file(GLOB PYTHON_SOURCES CONFIGURE_DEPENDS python/*.cpp)
add_library(deformable_ccd_python MODULE ${PYTHON_SOURCES})
pybind11_extension(deformable_ccd_python)
# Recordings and explanations are no part of the public headers.
target_include_directories(deformable_ccd_python PRIVATE src)
# Not every pybind11 adds them: that of Debian 13 does not.
target_include_directories(deformable_ccd_python SYSTEM PRIVATE ${Python3_INCLUDE_DIRS})
target_compile_options(deformable_ccd_python PRIVATE ${COLD_CODE})
target_compile_definitions(deformable_ccd_python PRIVATE DCCD_VERSION="${PROJECT_VERSION}")
target_link_libraries(deformable_ccd_python PRIVATE deformable_ccd pybind11::module)
if(DEFORMABLE_CCD_CORE_ONLY)
  set(PYTHON_FOLDER ${CMAKE_CURRENT_BINARY_DIR}/python/dccd)
  # Where Debian's Python looks below /usr/local. The library is three folders above.
  set(PYTHON_DESTINATION lib/python${Python3_VERSION_MAJOR}.${Python3_VERSION_MINOR}/dist-packages/dccd)
  set_target_properties(deformable_ccd_python PROPERTIES INSTALL_RPATH "$ORIGIN/../../..")
else()
  set(PYTHON_FOLDER ${CATKIN_DEVEL_PREFIX}/${CATKIN_GLOBAL_PYTHON_DESTINATION}/dccd)
  set(PYTHON_DESTINATION ${CATKIN_GLOBAL_PYTHON_DESTINATION}/dccd)
endif()
set_target_properties(deformable_ccd_python PROPERTIES
  CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON OUTPUT_NAME _dccd
  LIBRARY_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/python_module)
# What scripts/wheel says of the wheel. pybind11 knows the types of numpy 2 from 2.12 on.
set(NUMPY_BOUND ">=1.17")
if(pybind11_VERSION VERSION_LESS 2.12)
  string(APPEND NUMPY_BOUND ",<2")
endif()
configure_file(python/METADATA.in ${CMAKE_CURRENT_BINARY_DIR}/python_module/METADATA @ONLY)
# CMake makes output folders before anything is built, and an empty one is a module to Python, without anything in it.
add_custom_command(TARGET deformable_ccd_python POST_BUILD
  COMMAND ${CMAKE_COMMAND} -E make_directory ${PYTHON_FOLDER}
  COMMAND ${CMAKE_COMMAND} -E create_symlink $<TARGET_FILE:deformable_ccd_python>
    ${PYTHON_FOLDER}/$<TARGET_FILE_NAME:deformable_ccd_python> VERBATIM)
foreach(file __init__.py _dccd.pyi py.typed)
  add_custom_command(TARGET deformable_ccd_python POST_BUILD
    COMMAND ${CMAKE_COMMAND} -E create_symlink ${TRUE_SOURCE_DIR}/python/dccd/${file} ${PYTHON_FOLDER}/${file} VERBATIM)
endforeach()

install(TARGETS deformable_ccd_python LIBRARY DESTINATION ${PYTHON_DESTINATION})
#catkin_lint: ignore_once missing_directory external_directory
install(DIRECTORY ${TRUE_SOURCE_DIR}/python/dccd/ DESTINATION ${PYTHON_DESTINATION} PATTERN __pycache__ EXCLUDE)
