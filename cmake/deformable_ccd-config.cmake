# The core installed alone: the target deformable_ccd::deformable_ccd. A catkin installation has a configuration of its own.
include(CMakeFindDependencyMacro)
find_dependency(Eigen3)
include(${CMAKE_CURRENT_LIST_DIR}/deformable_ccd-targets.cmake)
