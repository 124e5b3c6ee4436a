# test/fuzz/NAME_fuzz.cpp: in the ordinary build all of them are one gtest binary, fuzz_tests, that replays
# test/fuzz/corpus/NAME; with DEFORMABLE_CCD_FUZZ (Clang) each is a libFuzzer executable NAME_fuzz:
#   NAME_fuzz -max_total_time=600 WORK_FOLDER test/fuzz/corpus/NAME
file(GLOB FUZZ_SOURCES CONFIGURE_DEPENDS test/fuzz/*_fuzz.cpp)
if(NOT DEFORMABLE_CCD_FUZZ)
  add_gtest_suite(fuzz_tests SOURCES ${FUZZ_SOURCES})
  return()
endif()
foreach(source ${FUZZ_SOURCES})
  get_filename_component(name ${source} NAME_WE)
  add_executable(${name} ${source})
  target_compile_definitions(${name} PRIVATE DEFORMABLE_CCD_FUZZER)
  target_link_libraries(${name} PRIVATE deformable_ccd_test_support)
  target_link_options(${name} PRIVATE -fsanitize=fuzzer)
endforeach()
