# test/fuzz/NAME_fuzz.cpp (the core) and test/fuzz/decoders/NAME_fuzz.cpp (messages and files): in the ordinary build they
# are two gtest binaries, fuzz_tests and decoder_fuzz_tests, that replay test/fuzz/corpus/NAME; with DEFORMABLE_CCD_FUZZ
# (Clang, a core-only tree) each is a libFuzzer executable NAME_fuzz:
#   NAME_fuzz -max_total_time=600 WORK_FOLDER test/fuzz/corpus/NAME
file(GLOB FUZZ_SOURCES CONFIGURE_DEPENDS test/fuzz/*_fuzz.cpp)
file(GLOB DECODER_FUZZ_SOURCES CONFIGURE_DEPENDS test/fuzz/decoders/*_fuzz.cpp)

if(NOT DEFORMABLE_CCD_FUZZ)
  add_gtest_suite(fuzz_tests SOURCES ${FUZZ_SOURCES} LIBRARIES deformable_ccd_archive)
  if(NOT DEFORMABLE_CCD_CORE_ONLY)
    add_gtest_suite(decoder_fuzz_tests SOURCES ${DECODER_FUZZ_SOURCES}
      LIBRARIES deformable_ccd_physics deformable_ccd_ros ${ROS_LINK_LIBRARIES})
  endif()
  return()
endif()

# What the decoders call of the node. Objects, not an archive: a message type registers itself, and nothing else asks for
# its file.
file(GLOB MESSAGE_TYPES CONFIGURE_DEPENDS src/input/message_types/*.cpp)
set(DECODER_SOURCES ${MESSAGE_TYPES}
  scenes/physics/scene_file.cpp scenes/physics/shapes.cpp
  src/config/parameter_reader.cpp src/config/parameter_yaml.cpp src/input/dae_file.cpp src/input/depth_surface.cpp
  src/input/known_types.cpp src/input/marker_meshes.cpp src/input/marker_names.cpp src/input/marker_ropes.cpp
  src/input/mesh_decoder.cpp
  src/input/mesh_file.cpp src/input/mesh_views.cpp src/input/message_layout.cpp src/input/message_type.cpp
  src/input/obj_file.cpp src/input/ply_file.cpp src/input/ply_header.cpp src/input/polygons.cpp
  src/input/soup_weld.cpp src/input/stl_file.cpp src/input/text_lines.cpp src/node/map_decode.cpp
  src/node/map_memory.cpp src/octomap/map_odds.cpp src/octomap/octomap_decode.cpp src/octomap/octomap_header.cpp)

# Clang 14 compiles these two kernels for many minutes, the more with every check that stands beside a load. They keep
# AddressSanitizer here; `scripts/test --sanitize address,undefined` has GCC look at them in full.
set_source_files_properties(src/simd/exact_batch.cpp src/simd/fused_filter.cpp PROPERTIES
  COMPILE_OPTIONS -fno-sanitize=undefined)

# Of ROS the decoders need headers, the package's own messages among them (from the workspace that scripts/test has built
# before), and the few libraries that those headers call. The files themselves are built here, with the fuzzer's eyes.
find_path(OWN_MESSAGES deformable_ccd/ContactArray.h REQUIRED)
find_path(ROS_MESSAGES std_msgs/Header.h REQUIRED)
#catkin_lint: ignore_once duplicate_find
find_package(PCL REQUIRED COMPONENTS common)
find_library(TINYXML2_LIBRARY tinyxml2 REQUIRED)
find_library(LZ4_LIBRARY lz4 REQUIRED)  # flann's headers call it, where nothing is optimised away
foreach(library rosconsole roscpp_serialization rostime)
  find_library(${library}_LIBRARY ${library} REQUIRED)
  list(APPEND HEADER_LIBRARIES ${${library}_LIBRARY})
endforeach()
#catkin_lint: ignore_once duplicate_find
find_package(yaml-cpp REQUIRED)
add_library(deformable_ccd_decoders OBJECT ${DECODER_SOURCES})
target_include_directories(deformable_ccd_decoders PUBLIC src ${CMAKE_CURRENT_SOURCE_DIR})
target_include_directories(deformable_ccd_decoders SYSTEM PRIVATE ${OWN_MESSAGES} ${ROS_MESSAGES} ${PCL_INCLUDE_DIRS})
target_link_libraries(deformable_ccd_decoders PUBLIC
  deformable_ccd_archive yaml-cpp ${TINYXML2_LIBRARY} ${HEADER_LIBRARIES} ${PCL_COMMON_LIBRARIES} ${LZ4_LIBRARY})

file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/fuzz_targets.txt "")
add_custom_target(fuzzers)
foreach(source ${FUZZ_SOURCES} ${DECODER_FUZZ_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  target_compile_definitions(${name} PRIVATE DEFORMABLE_CCD_FUZZER)
  target_link_libraries(${name} PRIVATE deformable_ccd_test_support deformable_ccd_archive)
  if(source IN_LIST DECODER_FUZZ_SOURCES)
    target_link_libraries(${name} PRIVATE deformable_ccd_decoders)
    target_include_directories(${name} SYSTEM PRIVATE ${OWN_MESSAGES} ${ROS_MESSAGES})
  endif()
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
  add_dependencies(fuzzers ${name})
  file(APPEND ${CMAKE_CURRENT_BINARY_DIR}/fuzz_targets.txt "${name}\n")
endforeach()
