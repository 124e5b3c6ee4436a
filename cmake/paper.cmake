# The filters, the hierarchy and the rivals in the paper's form: what the tests and benchmarks hold the step's own against.
# No part of the libraries, never installed.
file(GLOB PAPER_SOURCES CONFIGURE_DEPENDS paper/*.cpp paper/simd/*.cpp)
add_library(deformable_ccd_paper STATIC EXCLUDE_FROM_ALL ${PAPER_SOURCES})
target_include_directories(deformable_ccd_paper PUBLIC ${CMAKE_CURRENT_SOURCE_DIR})
target_include_directories(deformable_ccd_paper PRIVATE ${CMAKE_CURRENT_SOURCE_DIR}/src)  # simd, of which a rival takes a kernel
target_link_libraries(deformable_ccd_paper PUBLIC deformable_ccd_headers deformable_ccd_hwy)
