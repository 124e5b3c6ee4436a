# The install tree works without the source: libraries, tools, headers, launch files, configurations.
# scripts/ serve the checkout and are no part of the installed package.
#catkin_lint: ignore uninstalled_script
include(GNUInstallDirs)
list(SORT TOOL_TARGETS)
set(LIBRARY_TARGETS deformable_ccd)
foreach(library deformable_ccd_octomap deformable_ccd_ros)
  if(TARGET ${library})
    list(APPEND LIBRARY_TARGETS ${library})
  endif()
endforeach()

# The core counts the versions of its own interface (core.cmake). Headers of the others are not installed: each minor version may change them.
set(NODE_LIBRARIES ${LIBRARY_TARGETS})
list(REMOVE_ITEM NODE_LIBRARIES deformable_ccd)
if(NODE_LIBRARIES)
  set_target_properties(${NODE_LIBRARIES} PROPERTIES
    VERSION ${PROJECT_VERSION} SOVERSION ${PROJECT_VERSION_MAJOR}.${PROJECT_VERSION_MINOR})
endif()

if(DEFORMABLE_CCD_CORE_ONLY)
  include(CMakePackageConfigHelpers)
  install(TARGETS ${TOOL_TARGETS})
  install(TARGETS deformable_ccd EXPORT ${PROJECT_NAME} INCLUDES DESTINATION ${CMAKE_INSTALL_INCLUDEDIR})
  install(DIRECTORY include/dccd DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
  set(CONFIG_DIR ${CMAKE_INSTALL_LIBDIR}/cmake/${PROJECT_NAME})
  install(EXPORT ${PROJECT_NAME} NAMESPACE ${PROJECT_NAME}:: FILE ${PROJECT_NAME}-targets.cmake DESTINATION ${CONFIG_DIR})
  write_basic_package_version_file(${PROJECT_NAME}-config-version.cmake COMPATIBILITY SameMajorVersion)
  # Generated here, and no catkin package's.
  #catkin_lint: ignore_once missing_file wrong_install_destination
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/${PROJECT_NAME}-config-version.cmake cmake/${PROJECT_NAME}-config.cmake
    DESTINATION ${CONFIG_DIR})
  return()
endif()

install(TARGETS ${LIBRARY_TARGETS}
  ARCHIVE DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  LIBRARY DESTINATION ${CATKIN_PACKAGE_LIB_DESTINATION}
  RUNTIME DESTINATION ${CATKIN_GLOBAL_BIN_DESTINATION})
if(TOOL_TARGETS)
  install(TARGETS ${TOOL_TARGETS} RUNTIME DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
endif()
# From the checkout itself: in the workspace of scripts/build these are links, which would be installed as links.
#catkin_lint: ignore_once missing_directory external_directory
install(DIRECTORY ${TRUE_SOURCE_DIR}/include/ DESTINATION ${CATKIN_GLOBAL_INCLUDE_DESTINATION}
  FILES_MATCHING PATTERN "*.h")
#catkin_lint: ignore_once missing_directory external_directory
install(DIRECTORY ${TRUE_SOURCE_DIR}/config ${TRUE_SOURCE_DIR}/examples ${TRUE_SOURCE_DIR}/launch
  DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
#catkin_lint: ignore_once missing_file external_file
install(FILES ${TRUE_SOURCE_DIR}/nodelet_plugins.xml DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION})
# A fleet's jobs: what Snakemake reads and calls.
#catkin_lint: ignore_once missing_directory external_directory
install(DIRECTORY ${TRUE_SOURCE_DIR}/fleet DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}
  PATTERN analyze_fleet EXCLUDE PATTERN __pycache__ EXCLUDE)
catkin_install_python(PROGRAMS examples/guard_twist.py examples/slow_the_arm.py examples/stop_the_arm.py examples/publish_cloth.py fleet/analyze_fleet src/apps/watch
  audit/audit_bag DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
# The parts of audit_bag lie beside it.
install(FILES audit/came.py audit/intended.py audit/owned.py audit/placed.py audit/touches.py DESTINATION ${CATKIN_PACKAGE_BIN_DESTINATION})
# The demo's recording belongs to a package: who installs one has no checkout, in which scripts/demo would make it.
if(DEFORMABLE_CCD_RECORD_DEMO)
  set(DEMO_SCENE ${TRUE_SOURCE_DIR}/config/scenes/table_edge.yaml)
  set(DEMO_FILES ${CMAKE_CURRENT_BINARY_DIR}/demo/table_edge.bag ${CMAKE_CURRENT_BINARY_DIR}/demo/table_edge.yaml)
  add_custom_command(OUTPUT ${DEMO_FILES}
    COMMAND ${CMAKE_COMMAND} -E make_directory ${CMAKE_CURRENT_BINARY_DIR}/demo
    COMMAND make_scene_bag ${DEMO_SCENE} demo/table_edge.bag --monitor-config demo/table_edge.yaml --quiet
    DEPENDS make_scene_bag ${DEMO_SCENE} VERBATIM)
  add_custom_target(demo_recording ALL DEPENDS ${DEMO_FILES})
  install(FILES ${DEMO_FILES} DESTINATION ${CATKIN_PACKAGE_SHARE_DESTINATION}/demo)
endif()
