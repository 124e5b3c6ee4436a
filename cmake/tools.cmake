# Tools that need the core alone, and the report. Every other file in src/apps is built by ros.cmake.
# The libraries need neither of the two; without them a core-only build has no tools and no report.
set(TOOLS_NEED REQUIRED)
if(DEFORMABLE_CCD_CORE_ONLY)
  set(TOOLS_NEED QUIET)
endif()
find_package(CLI11 ${TOOLS_NEED} PATHS ${BUILT_DEPENDENCIES})
find_package(nlohmann_json ${TOOLS_NEED})

# The exact oracle: judges the rungs in the tests and in the tools that report errors. The libraries never link it.
file(GLOB ORACLE_SOURCES CONFIGURE_DEPENDS oracle/*.cpp)
add_library(deformable_ccd_oracle STATIC EXCLUDE_FROM_ALL ${ORACLE_SOURCES})
target_include_directories(deformable_ccd_oracle PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_link_libraries(deformable_ccd_oracle PUBLIC deformable_ccd_headers ${GMP_LIBRARY})

# The report of a run: JSON, CSV, and a page whose markup, style and scripts are files of their own kind. Its player
# carries three.js (Debian: libjs-three) in the page; without it the page says that it has no player.
if(nlohmann_json_FOUND)
  set(PAGE_PARTS page.html page.css page.js lanes.js player.js three_licence.js)
  foreach(part ${PAGE_PARTS})
    set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${CMAKE_CURRENT_SOURCE_DIR}/src/report/${part})
    string(MAKE_C_IDENTIFIER ${part} variable)
    file(READ src/report/${part} ${variable})
  endforeach()
  find_path(THREE_JS_FOLDER build/three.min.js PATHS /usr/share/javascript/three NO_DEFAULT_PATH)
  set(three_js "")
  if(THREE_JS_FOLDER AND EXISTS "${THREE_JS_FOLDER}/examples/js/controls/OrbitControls.js")
    file(READ ${THREE_JS_FOLDER}/build/three.min.js three_js)
    file(READ ${THREE_JS_FOLDER}/examples/js/controls/OrbitControls.js orbit_controls_js)
    string(PREPEND three_js "${three_licence_js}")
    string(APPEND three_js "\n${orbit_controls_js}")
  else()
    message(STATUS "three.js (libjs-three) is not installed: reports will have no 3-D player")
  endif()
  configure_file(src/report/page_parts.h.in ${CMAKE_CURRENT_BINARY_DIR}/report/page_parts.h @ONLY)
  file(GLOB REPORT_SOURCES CONFIGURE_DEPENDS src/report/*.cpp)
  add_library(deformable_ccd_report STATIC EXCLUDE_FROM_ALL ${REPORT_SOURCES})
  #catkin_lint: ignore_once missing_directory
  target_include_directories(deformable_ccd_report PUBLIC src PRIVATE ${CMAKE_CURRENT_BINARY_DIR}/report)
  target_link_libraries(deformable_ccd_report PUBLIC deformable_ccd_headers nlohmann_json::nlohmann_json)
endif()

# run_queries shows filters and bounds that the library hides, and so takes the archive.
set(CORE_TOOLS run_queries replay_step)
set(run_queries_LIBRARIES deformable_ccd_oracle deformable_ccd_archive)
set(replay_step_LIBRARIES deformable_ccd)
if(CLI11_FOUND)
  foreach(tool ${CORE_TOOLS})
    add_executable(${tool} src/apps/${tool}.cpp)
    target_include_directories(${tool} PRIVATE src)
    target_link_libraries(${tool} ${${tool}_LIBRARIES} CLI11::CLI11)
    list(APPEND TOOL_TARGETS ${tool})
  endforeach()
endif()
