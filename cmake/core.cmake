# The core: Eigen, oneTBB, Highway and GMP, and nothing else. Compiled once, linked twice: the shared library shows its
# users the public headers' functions and hides the rest; tests and benchmarks, which look at the rest, take
# the same objects as an archive that nobody installs.
file(GLOB HOT_SOURCES CONFIGURE_DEPENDS
  src/culling/*.cpp src/simd/*.cpp src/elementary/*.cpp src/obstacle/*.cpp src/step/pairs/*.cpp src/step/start/*.cpp
  src/step/patches/*.cpp)
file(GLOB COLD_SOURCES CONFIGURE_DEPENDS src/proof/*.cpp src/step/*.cpp src/step/clearance/*.cpp src/stream/*.cpp src/record/*.cpp)
file(STRINGS include/dccd/export.h API_VERSION_LINE REGEX "define DCCD_API_VERSION [0-9]+")
string(REGEX MATCH "[0-9]+" API_VERSION "${API_VERSION_LINE}")

# The headers alone, for parts that leave to their users which of the two they link.
add_library(deformable_ccd_headers INTERFACE)
target_include_directories(deformable_ccd_headers INTERFACE $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>)
target_link_libraries(deformable_ccd_headers INTERFACE Eigen3::Eigen)

add_library(deformable_ccd_objects OBJECT ${HOT_SOURCES} ${COLD_SOURCES})
# Each on its own: how much the compiler inlines depends on what else is in its unit.
set_source_files_properties(${HOT_SOURCES} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
target_include_directories(deformable_ccd_objects PRIVATE src)
target_link_libraries(deformable_ccd_objects PRIVATE deformable_ccd_headers TBB::tbb Threads::Threads deformable_ccd_hwy)
# Most files read these; compiled once for each library, they save a quarter of its time.
set(COMMON_HEADERS <Eigen/Geometry> <algorithm> <map> <memory> <string> <vector>)
target_precompile_headers(deformable_ccd_objects PRIVATE ${COMMON_HEADERS})
set_target_properties(deformable_ccd_objects PROPERTIES CXX_VISIBILITY_PRESET hidden VISIBILITY_INLINES_HIDDEN ON
  UNITY_BUILD ${DEFORMABLE_CCD_UNITY})
set(CORE_LIBRARIES TBB::tbb Threads::Threads deformable_ccd_hwy ${GMP_LIBRARY})

add_library(deformable_ccd SHARED $<TARGET_OBJECTS:deformable_ccd_objects>)
target_include_directories(deformable_ccd PUBLIC $<BUILD_INTERFACE:${CMAKE_CURRENT_SOURCE_DIR}/include>)
target_link_libraries(deformable_ccd PUBLIC Eigen3::Eigen PRIVATE ${CORE_LIBRARIES})
set_target_properties(deformable_ccd PROPERTIES VERSION ${PROJECT_VERSION} SOVERSION ${API_VERSION})

add_library(deformable_ccd_archive STATIC EXCLUDE_FROM_ALL $<TARGET_OBJECTS:deformable_ccd_objects>)
target_include_directories(deformable_ccd_archive PUBLIC src)
target_link_libraries(deformable_ccd_archive PUBLIC deformable_ccd_headers ${CORE_LIBRARIES})
