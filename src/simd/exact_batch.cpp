#include "simd/exact_batch.h"

#include <cstring>
#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/exact_batch.cpp"
#include <hwy/foreach_target.h>
// The kernel needs Highway's definitions for the target first.
#include <hwy/cache_control.h>
#include <hwy/highway.h>

#include "simd/exact_batch-inl.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

void exactBatchOn(const BatchInput& in, const BatchOutput& out) { runBatch<true>(in, out); }

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {

HWY_EXPORT(exactBatchOn);

void exactBatch(const BatchInput& input, const BatchOutput& output) {
  HWY_DYNAMIC_DISPATCH(exactBatchOn)(input, output);
}

}  // namespace simd
}  // namespace dccd
#endif
