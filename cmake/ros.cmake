# The libraries and tools that need OctoMap, ROS and PCL.

# --- the node: what comes in, its options, what goes out, and the class that holds them ---------------------------------
file(GLOB MESSAGE_TYPES CONFIGURE_DEPENDS src/input/message_types/*.cpp)
file(GLOB ROS_SOURCES CONFIGURE_DEPENDS
  src/input/*.cpp src/config/*.cpp src/robot/*.cpp src/output/*.cpp src/node/*.cpp)
list(APPEND ROS_SOURCES ${MESSAGE_TYPES})
list(APPEND ROS_LINK_LIBRARIES deformable_ccd deformable_ccd_octomap ${catkin_LIBRARIES} yaml-cpp)
if(ROS_SOURCES)
  add_library(deformable_ccd_ros SHARED ${ROS_SOURCES})
  add_dependencies(deformable_ccd_ros ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_include_directories(deformable_ccd_ros PUBLIC include PRIVATE src)
  target_include_directories(deformable_ccd_ros SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS}
    ${URDF_PARSER_INCLUDE_DIR} ${URDF_MODEL_INCLUDE_DIR})
  target_precompile_headers(deformable_ccd_ros PRIVATE <ros/ros.h> ${COMMON_HEADERS})
  set_target_properties(deformable_ccd_ros PROPERTIES UNITY_BUILD ${DEFORMABLE_CCD_UNITY})
  set_source_files_properties(${MESSAGE_TYPES} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)  # their names are the same
  target_link_libraries(deformable_ccd_ros PUBLIC ${ROS_LINK_LIBRARIES} TBB::tbb PRIVATE deformable_ccd_report)
  # PCL's headers are the slowest to read: only for the files that use them. The compiler's own folders must not come
  # with them, since their order matters to it.
  list(REMOVE_ITEM PCL_INCLUDE_DIRS ${CMAKE_CXX_IMPLICIT_INCLUDE_DIRECTORIES})
  foreach(source ${ROS_SOURCES})
    file(STRINGS ${source} pcl_includes REGEX "^#include <pcl(_conversions)?/")
    if(pcl_includes)
      set_source_files_properties(${source} PROPERTIES INCLUDE_DIRECTORIES "${PCL_INCLUDE_DIRS}")
      set(ROS_USES_PCL ON)
    endif()
  endforeach()
  if(ROS_USES_PCL)
    target_link_libraries(deformable_ccd_ros PRIVATE ${PCL_COMMON_LIBRARIES})
  endif()
  target_link_libraries(deformable_ccd_ros PRIVATE ${URDF_LIBRARY} ${CONSOLE_BRIDGE_LIBRARY} ${TINYXML2_LIBRARY})
  list(INSERT ROS_LINK_LIBRARIES 0 deformable_ccd_ros)
endif()

# --- one executable per file of src/apps -------------------------------------------------------------------------------
file(GLOB APP_SOURCES CONFIGURE_DEPENDS src/apps/*.cpp)
foreach(source ${APP_SOURCES})
  get_filename_component(app ${source} NAME_WE)
  if(app IN_LIST CORE_TOOLS)
    continue()
  endif()
  # An app's own parts lie in a folder of its name.
  file(GLOB app_parts CONFIGURE_DEPENDS src/apps/${app}/*.cpp)
  add_executable(${app} ${source} ${app_parts})
  add_dependencies(${app} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_include_directories(${app} PRIVATE src)
  target_compile_options(${app} PRIVATE ${COLD_CODE})
  set_target_properties(${app} PROPERTIES UNITY_BUILD ${DEFORMABLE_CCD_UNITY})
  target_include_directories(${app} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS})
  target_link_libraries(${app} deformable_ccd_report ${ROS_LINK_LIBRARIES} CLI11::CLI11 nlohmann_json::nlohmann_json)
  if(app STREQUAL "analyze_bag")
    set_source_files_properties(${source} PROPERTIES COMPILE_DEFINITIONS DEFORMABLE_CCD_VERSION="${PROJECT_VERSION}")
  endif()
  list(APPEND TOOL_TARGETS ${app})
endforeach()

# --- the recorder of scenes --------------------------------------------------------------------------------------------
if(TARGET deformable_ccd_physics)
  file(GLOB RECORDER_SOURCES CONFIGURE_DEPENDS scenes/*.cpp)
  add_executable(make_scene_bag ${RECORDER_SOURCES})
  add_dependencies(make_scene_bag ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_compile_options(make_scene_bag PRIVATE ${COLD_CODE})
  set_target_properties(make_scene_bag PROPERTIES UNITY_BUILD ${DEFORMABLE_CCD_UNITY})
  target_include_directories(make_scene_bag SYSTEM PRIVATE ${catkin_INCLUDE_DIRS} ${OCTOMAP_INCLUDE_DIRS}
    ${URDF_PARSER_INCLUDE_DIR} ${URDF_MODEL_INCLUDE_DIR})
  target_link_libraries(make_scene_bag deformable_ccd_physics ${ROS_LINK_LIBRARIES} ${URDF_LIBRARY} CLI11::CLI11)
  list(APPEND TOOL_TARGETS make_scene_bag)
endif()

# --- examples: clients of the node, one file each ----------------------------------------------------------------------
file(GLOB EXAMPLE_SOURCES CONFIGURE_DEPENDS examples/*.cpp)
foreach(source ${EXAMPLE_SOURCES})
  get_filename_component(example ${source} NAME_WE)
  add_executable(${example} ${source})
  add_dependencies(${example} ${${PROJECT_NAME}_EXPORTED_TARGETS} ${catkin_EXPORTED_TARGETS})
  target_include_directories(${example} SYSTEM PRIVATE ${catkin_INCLUDE_DIRS})
  target_link_libraries(${example} ${catkin_LIBRARIES} Eigen3::Eigen)
  list(APPEND TOOL_TARGETS ${example})
endforeach()
