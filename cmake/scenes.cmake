# The physics that records scenes (scenes/physics: Bullet soft bodies in double precision, never part of the node).
# The one strict reader of configuration: of scene files here, of the node's parameters in ros.cmake.
file(GLOB PARAMETERS_SOURCES CONFIGURE_DEPENDS src/config/parameter_*.cpp)
file(GLOB PHYSICS_SOURCES CONFIGURE_DEPENDS scenes/physics/*.cpp)
if((NOT DEFORMABLE_CCD_CORE_ONLY OR DEFORMABLE_CCD_BENCHMARKS) AND PHYSICS_SOURCES)
  # Two builds of Bullet can be installed side by side; single precision would make the recorded cloth jitter.
  #catkin_lint: ignore_once duplicate_find
  find_package(PkgConfig REQUIRED)
  if(DEFORMABLE_CCD_CORE_ONLY)
    #catkin_lint: ignore_once duplicate_find
    find_package(yaml-cpp REQUIRED)
  endif()
  add_library(deformable_ccd_parameters STATIC EXCLUDE_FROM_ALL ${PARAMETERS_SOURCES})
  target_include_directories(deformable_ccd_parameters PUBLIC src)
  target_link_libraries(deformable_ccd_parameters PUBLIC deformable_ccd_headers PRIVATE yaml-cpp)
  pkg_check_modules(BULLET_DOUBLE QUIET IMPORTED_TARGET bullet-float64)
  if(NOT BULLET_DOUBLE_FOUND)
    pkg_check_modules(BULLET_DOUBLE QUIET IMPORTED_TARGET bullet)
    if(NOT "${BULLET_DOUBLE_CFLAGS}" MATCHES "BT_USE_DOUBLE_PRECISION")
      set(BULLET_DOUBLE_FOUND FALSE)
    endif()
  endif()
  if(BULLET_DOUBLE_FOUND)
    add_library(deformable_ccd_physics STATIC ${PHYSICS_SOURCES})
    target_include_directories(deformable_ccd_physics PUBLIC src ${CMAKE_CURRENT_SOURCE_DIR})
    target_compile_options(deformable_ccd_physics PRIVATE ${COLD_CODE})
    set_target_properties(deformable_ccd_physics PROPERTIES UNITY_BUILD ${DEFORMABLE_CCD_UNITY})
    # Bullet's headers raise warnings of their own under -Wextra.
    target_include_directories(deformable_ccd_physics SYSTEM PRIVATE ${BULLET_DOUBLE_INCLUDE_DIRS})
    target_link_libraries(deformable_ccd_physics PUBLIC deformable_ccd_headers deformable_ccd_parameters PRIVATE PkgConfig::BULLET_DOUBLE)
  else()
    message(STATUS "No Bullet in double precision: make_scene_bag is left out")
  endif()
endif()
