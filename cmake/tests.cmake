# gtest binaries: unit_tests, property_tests, truth_tests (the core's), and one for each part that needs more than the
# core: octomap_tests, scene_tests, ros_tests, from test/{unit,property,truth}/PART/**.cpp.
# In a catkin workspace tests are built by the target `tests`, not by `all`, as catkin users expect.
# They are on by default, as catkin has it, and what they need is no dependency of the package: whoever builds without it gets
# the package alone. scripts/test installs it, and fails where the suites were not built.
find_package(GTest QUIET)
find_package(rapidcheck QUIET PATHS ${BUILT_DEPENDENCIES})
find_package(ZLIB QUIET)
set(MISSING_FOR_TESTS)
foreach(needed GTest ZLIB)
  if(NOT ${needed}_FOUND)
    list(APPEND MISSING_FOR_TESTS ${needed})
  endif()
endforeach()
if(NOT DEFORMABLE_CCD_CORE_ONLY)
  find_package(rostest QUIET)
  find_package(roslaunch QUIET)
  foreach(needed rostest roslaunch)
    if(NOT ${needed}_FOUND)
      list(APPEND MISSING_FOR_TESTS ${needed})
    endif()
  endforeach()
endif()
if(MISSING_FOR_TESTS)
  list(JOIN MISSING_FOR_TESTS ", " MISSING_FOR_TESTS)
  message(STATUS "deformable_ccd is built without its tests: no ${MISSING_FOR_TESTS} (scripts/setup --tests installs it)")
  return()
endif()
enable_testing()

# One test holds the scenes that the benchmarks generate.
file(GLOB GENERATED_SCENES CONFIGURE_DEPENDS benchmark/support/generated_*.cpp)
set_source_files_properties(${GENERATED_SCENES} test/unit/support/generated_scene_test.cpp PROPERTIES
  INCLUDE_DIRECTORIES ${CMAKE_CURRENT_SOURCE_DIR}/benchmark)
file(GLOB SUPPORT_SOURCES CONFIGURE_DEPENDS test/support/*.cpp)
list(APPEND SUPPORT_SOURCES ${GENERATED_SCENES})
add_library(deformable_ccd_test_support STATIC EXCLUDE_FROM_ALL ${SUPPORT_SOURCES})
target_include_directories(deformable_ccd_test_support PUBLIC src test)
# The truth data lie beside the checkout, not beside a workspace's links.
target_compile_definitions(deformable_ccd_test_support PUBLIC DEFORMABLE_CCD_SOURCE_DIR="${TRUE_SOURCE_DIR}")
target_link_libraries(deformable_ccd_test_support PUBLIC
  deformable_ccd_oracle deformable_ccd_headers GTest::gtest ZLIB::ZLIB TBB::tbb deformable_ccd_hwy ${GMP_LIBRARY})
if(rapidcheck_FOUND)
  target_link_libraries(deformable_ccd_test_support PUBLIC rapidcheck)
endif()

# The tests' own code is compiled as cold code: what takes their time is in the libraries. One set of headers is compiled for
# the core's tests, one for those of the node. All that reads a set has the same options, of which a library's and a program's
# are told to be position-independent in different ways, so that the compiler's default serves both.
function(set_test_options name)
  target_compile_options(${name} PRIVATE ${COLD_CODE})
  set_target_properties(${name} PROPERTIES POSITION_INDEPENDENT_CODE OFF)
endfunction()
set_test_options(deformable_ccd_test_support)
target_precompile_headers(deformable_ccd_test_support PRIVATE
  <gtest/gtest.h> <random> ${COMMON_HEADERS} <oracle/oracle.h> <dccd/stream.h>)

# Adds the gtest binary NAME from the given files, linked with LIBRARIES: the core's archive, or a library on the core.
# HEADERS_OF is the target whose compiled headers it reads, the test support if there is none.
function(add_gtest_suite name)
  cmake_parse_arguments(arg "" "HEADERS_OF" "SOURCES;LIBRARIES" ${ARGN})
  if(NOT arg_SOURCES)
    return()
  endif()
  add_executable(${name} ${arg_SOURCES})
  target_link_libraries(${name} PRIVATE deformable_ccd_test_support ${arg_LIBRARIES} GTest::gtest_main)
  set_target_properties(${name} PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/gtest)
  set_test_options(${name})
  set_target_properties(${name} PROPERTIES UNITY_BUILD ${DEFORMABLE_CCD_UNITY})
  if(NOT arg_HEADERS_OF)
    set(arg_HEADERS_OF deformable_ccd_test_support)
  endif()
  target_precompile_headers(${name} REUSE_FROM ${arg_HEADERS_OF})
  file(APPEND ${CMAKE_CURRENT_BINARY_DIR}/gtest_suites.txt "${name}\n")
  add_test(NAME ${name} COMMAND ${name})
  if(NOT DEFORMABLE_CCD_CORE_ONLY)
    target_include_directories(${name} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS})
    set_target_properties(${name} PROPERTIES EXCLUDE_FROM_ALL ON)
    add_dependencies(tests ${name})
    add_dependencies(${name} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  endif()
endfunction()

# A tool of the tests, run from the build folder and never installed.
function(add_test_tool name)
  add_executable(${name} ${ARGN})
  target_link_libraries(${name} PRIVATE deformable_ccd_test_support deformable_ccd_archive)
endfunction()
if(DEFORMABLE_CCD_VARIABLE_MARGINS)
  add_test_tool(cut_margins test/margins/cut_margins.cpp)
endif()
if(TARGET deformable_ccd_python)
  add_test_tool(write_steps test/python/write_steps.cpp)
  set_target_properties(write_steps PROPERTIES RUNTIME_OUTPUT_DIRECTORY ${CMAKE_CURRENT_BINARY_DIR}/gtest)
endif()

# These name what others of their suite name, too.
set_source_files_properties(test/property/elementary_exact_test.cpp test/property/elementary_structured_test.cpp
  test/property/safe_until_test.cpp test/property/step_detector_test.cpp test/unit/obstacle/obstacle_check_test.cpp
  test/unit/obstacle/voxel_surface_test.cpp test/unit/octomap/cloud_map_test.cpp test/unit/report/look_ahead_score_test.cpp
  test/unit/step/bodies_at_rest_test.cpp test/unit/step/clearance_test.cpp test/unit/step/history_test.cpp
  test/unit/step/start_state_test.cpp test/unit/stream/mesh_store_test.cpp test/unit/stream/new_contacts_test.cpp
  test/unit/stream/own_worlds_test.cpp test/unit/stream/reach_search_test.cpp PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)

# scripts/test reads this list: a suite that is on it but was not built counts as failed.
file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/gtest_suites.txt "")
set(PARTS_BEYOND_CORE octomap physics report ros)
foreach(suite unit property truth)
  file(GLOB_RECURSE sources CONFIGURE_DEPENDS test/${suite}/*.cpp)
  foreach(part ${PARTS_BEYOND_CORE})
    set(part_sources ${sources})
    list(FILTER part_sources INCLUDE REGEX "/test/${suite}/${part}/")
    list(FILTER sources EXCLUDE REGEX "/test/${suite}/${part}/")
    list(APPEND ${part}_SOURCES ${part_sources})
  endforeach()
  add_gtest_suite(${suite}_tests SOURCES ${sources} LIBRARIES deformable_ccd_archive)
endforeach()
file(GLOB PAPER_TESTS CONFIGURE_DEPENDS paper/test/*.cpp)
add_gtest_suite(paper_tests SOURCES ${PAPER_TESTS} LIBRARIES deformable_ccd_paper deformable_ccd_archive)
if(TARGET deformable_ccd_report)
  add_gtest_suite(report_tests SOURCES ${report_SOURCES} LIBRARIES deformable_ccd_report deformable_ccd)
endif()

if(DEFORMABLE_CCD_CORE_ONLY)
  return()
endif()
add_gtest_suite(octomap_tests SOURCES ${octomap_SOURCES} LIBRARIES deformable_ccd_octomap)
# One test holds a robot's links beside KDL.
find_library(KDL_PARSER_LIBRARY kdl_parser REQUIRED)
find_library(KDL_LIBRARY orocos-kdl REQUIRED)
file(GLOB LIVE_SUPPORT_SOURCES CONFIGURE_DEPENDS test/ros/support/*.cpp)
add_library(deformable_ccd_live_support STATIC EXCLUDE_FROM_ALL ${LIVE_SUPPORT_SOURCES})
add_dependencies(deformable_ccd_live_support ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
set_test_options(deformable_ccd_live_support)
target_include_directories(deformable_ccd_live_support SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS})
target_link_libraries(deformable_ccd_live_support PUBLIC ${ROS_LINK_LIBRARIES} deformable_ccd_test_support)
target_precompile_headers(deformable_ccd_live_support PRIVATE <gtest/gtest.h> <ros/ros.h> <sensor_msgs/PointCloud2.h>
  <visualization_msgs/MarkerArray.h> ${COMMON_HEADERS} <node/monitor_pipeline.h>)
# Two tests are about the order in which headers are read.
set_source_files_properties(test/unit/ros/include_order_core_first_test.cpp test/unit/ros/include_order_messages_first_test.cpp
  PROPERTIES SKIP_PRECOMPILE_HEADERS ON)
add_gtest_suite(ros_tests HEADERS_OF deformable_ccd_live_support SOURCES ${ros_SOURCES}
  LIBRARIES deformable_ccd_live_support deformable_ccd_ros ${KDL_PARSER_LIBRARY} ${KDL_LIBRARY})
# These six name what they write and read alike, or are about the order of headers.
set_source_files_properties(test/unit/ros/hostile_input_test.cpp test/unit/ros/include_order_core_first_test.cpp
  test/unit/ros/include_order_messages_first_test.cpp test/unit/ros/mesh_decoder_test.cpp
  test/unit/ros/mesh_file_grammar_test.cpp test/unit/ros/message_grammar_test.cpp
  PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
target_include_directories(ros_tests SYSTEM PRIVATE ${URDF_PARSER_INCLUDE_DIR} ${URDF_MODEL_INCLUDE_DIR})
# scripts/benchmark path and robot: they need the node's rooms, which the benchmarks' own tree has not; robot FCL, too.
#catkin_lint: ignore uninstalled_target
add_executable(path_benchmark EXCLUDE_FROM_ALL benchmark/path_benchmark.cpp benchmark/support/timing.cpp)
target_include_directories(path_benchmark PRIVATE benchmark test)
target_include_directories(path_benchmark SYSTEM PRIVATE
  ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS} ${URDF_PARSER_INCLUDE_DIR} ${URDF_MODEL_INCLUDE_DIR})
target_link_libraries(path_benchmark PRIVATE deformable_ccd_test_support deformable_ccd_ros GTest::gtest
  CLI11::CLI11 nlohmann_json::nlohmann_json ${KDL_PARSER_LIBRARY} ${KDL_LIBRARY})
find_package(fcl QUIET)
if(fcl_FOUND)
  #catkin_lint: ignore uninstalled_target
  add_executable(robot_benchmark EXCLUDE_FROM_ALL benchmark/robot_benchmark.cpp benchmark/support/timing.cpp)
  target_include_directories(robot_benchmark PRIVATE benchmark test)
  target_include_directories(robot_benchmark SYSTEM PRIVATE
    ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS} ${URDF_PARSER_INCLUDE_DIR} ${URDF_MODEL_INCLUDE_DIR})
  target_link_libraries(robot_benchmark PRIVATE deformable_ccd_test_support deformable_ccd_ros fcl GTest::gtest
    CLI11::CLI11 nlohmann_json::nlohmann_json ${KDL_PARSER_LIBRARY} ${KDL_LIBRARY})
endif()
# scripts/benchmark cell_live: the cell around the node, and what stands beside it for octomap_server.
#catkin_lint: ignore uninstalled_target
foreach(tool cell_publisher cell_octomap_server)
  add_executable(${tool} EXCLUDE_FROM_ALL benchmark/${tool}.cpp)
  add_dependencies(${tool} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_include_directories(${tool} PRIVATE src benchmark)
  target_include_directories(${tool} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS})
  target_link_libraries(${tool} PRIVATE deformable_ccd_ros ${ROS_LINK_LIBRARIES} CLI11::CLI11
    nlohmann_json::nlohmann_json ${KDL_PARSER_LIBRARY} ${KDL_LIBRARY})
endforeach()
if(TARGET deformable_ccd_physics)
  add_gtest_suite(physics_tests SOURCES ${physics_SOURCES} LIBRARIES deformable_ccd_physics deformable_ccd)
endif()

if(CATKIN_ENABLE_TESTING)
  # Each test/ros/NAME_test.cpp, with what lies in test/ros/NAME/, is the executable NAME_test, started by one or more of
  # test/ros/*.test.
  file(GLOB ROSTEST_SOURCES CONFIGURE_DEPENDS test/ros/*_test.cpp)
  foreach(source ${ROSTEST_SOURCES})
    get_filename_component(name ${source} NAME_WE)
    string(REGEX REPLACE "_test$" "" part ${name})
    file(GLOB part_sources CONFIGURE_DEPENDS test/ros/${part}/*_test.cpp)
    add_executable(${name} EXCLUDE_FROM_ALL ${source} ${part_sources})
    add_dependencies(${name} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
    target_include_directories(${name} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS})
    target_link_libraries(${name} deformable_ccd_live_support GTest::gtest_main)
    set_test_options(${name})
    target_precompile_headers(${name} REUSE_FROM deformable_ccd_live_support)
    add_dependencies(tests ${name})
    list(APPEND ROSTEST_EXECUTABLES ${name})
  endforeach()
  file(GLOB ROSTESTS CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} test/ros/*.test)
  foreach(rostest ${ROSTESTS})
    add_rostest(${rostest} DEPENDENCIES ${ROSTEST_EXECUTABLES} ${TOOL_TARGETS})
  endforeach()
  file(GLOB_RECURSE LAUNCH_FILES CONFIGURE_DEPENDS RELATIVE ${CMAKE_CURRENT_SOURCE_DIR} launch/*.launch)
  foreach(launch_file ${LAUNCH_FILES})
    roslaunch_add_file_check(${launch_file} DEPENDENCIES ${TOOL_TARGETS})
  endforeach()
endif()
