# Tools that need the core alone. Every other file in src/apps is built by ros.cmake.
find_package(CLI11 REQUIRED PATHS ${BUILT_DEPENDENCIES})
find_package(nlohmann_json REQUIRED)

# The exact oracle: judges the rungs in the tests and in the tools that report errors. The libraries never link it.
set(ORACLE_SOURCES test/support/algebraic.cpp test/support/exact_distance.cpp test/support/oracle.cpp
  test/support/promises.cpp)
list(TRANSFORM ORACLE_SOURCES PREPEND ${CMAKE_CURRENT_SOURCE_DIR}/)
add_library(deformable_ccd_oracle STATIC ${ORACLE_SOURCES})
target_include_directories(deformable_ccd_oracle PUBLIC src test)
target_link_libraries(deformable_ccd_oracle PUBLIC deformable_ccd ${GMP_LIBRARY})

set(CORE_TOOLS run_queries replay_step)
foreach(tool ${CORE_TOOLS})
  if(EXISTS ${CMAKE_CURRENT_SOURCE_DIR}/src/apps/${tool}.cpp)
    add_executable(${tool} src/apps/${tool}.cpp)
    target_include_directories(${tool} PRIVATE src)
    target_link_libraries(${tool} deformable_ccd_oracle deformable_ccd CLI11::CLI11 nlohmann_json::nlohmann_json)
    list(APPEND TOOL_TARGETS ${tool})
  endif()
endforeach()
