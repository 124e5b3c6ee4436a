// Masks as bits, per SIMD target.
#if defined(DCCD_SIMD_LANE_BITS_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef DCCD_SIMD_LANE_BITS_INL_H
#undef DCCD_SIMD_LANE_BITS_INL_H
#else
#define DCCD_SIMD_LANE_BITS_INL_H
#endif

#include <hwy/highway.h>

#include <cstring>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

/// Bit i of the result: lane i of the mask. D has fewer than 32 lanes.
template <class D, class M>
HWY_INLINE uint32_t bitsOf(D d, M mask) {
  static_assert(hn::MaxLanes(D()) < 32, "the bits of a word");
  uint8_t packed[8] = {0};
  hn::StoreMaskBits(d, mask, packed);
  uint32_t word;
  std::memcpy(&word, packed, sizeof word);
  return word & ((1u << hn::Lanes(d)) - 1);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#endif
