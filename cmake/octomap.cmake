# Octomap bytes to voxel surfaces: the only user of liboctomap, free of ROS. The benchmarks need it, too.
#catkin_lint: ignore_once duplicate_find
find_package(octomap REQUIRED)
file(GLOB OCTOMAP_SOURCES CONFIGURE_DEPENDS src/octomap/*.cpp)
add_library(deformable_ccd_octomap SHARED ${OCTOMAP_SOURCES})
target_include_directories(deformable_ccd_octomap PUBLIC include PRIVATE src)
target_include_directories(deformable_ccd_octomap SYSTEM PRIVATE ${OCTOMAP_INCLUDE_DIRS})
target_link_libraries(deformable_ccd_octomap PUBLIC deformable_ccd ${OCTOMAP_LIBRARIES})
add_library(deformable_ccd::octomap ALIAS deformable_ccd_octomap)
