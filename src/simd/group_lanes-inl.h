// Which of the 16 nodes of a group meet, or share a vertex with, one of another group, per SIMD target.
#if defined(DCCD_SIMD_GROUP_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef DCCD_SIMD_GROUP_LANES_INL_H
#undef DCCD_SIMD_GROUP_LANES_INL_H
#else
#define DCCD_SIMD_GROUP_LANES_INL_H
#endif

#include <hwy/highway.h>

#include <cstring>

#include "simd/group_pairs.h"
#include "simd/targets.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Bit i of the result: lane i of the mask. D has fewer than 32 lanes.
template <class D, class M>
HWY_INLINE uint32_t bitsOf(D d, M mask) {
  static_assert(hn::MaxLanes(D()) < 32, "the bits of a word");
  uint8_t packed[8] = {0};
  hn::StoreMaskBits(d, mask, packed);
  uint32_t word;
  std::memcpy(&word, packed, sizeof word);
  return word & ((1u << hn::Lanes(d)) - 1);
}

// Bit per lane: 1 where the node may meet the lane's node. It does not where both nodes' values are strictly in order
// in a direction, the same way round at t0 and t1. lo and hi point at the 16 values of one node (hi at the turned
// ones), of which each two neighbours are `stride` dwords after those before.
#if HWY_TARGET == HWY_SCALAR
template <bool T0_ONLY>
HWY_INLINE uint32_t meeting(const uint16_t* HWY_RESTRICT lo, const uint16_t* HWY_RESTRICT hi, size_t stride,
                            const uint16_t* HWY_RESTRICT lanes) {
  constexpr size_t HALF = RECORD * GROUP;
  uint32_t bits = 0;
  for (size_t lane = 0; lane < GROUP; ++lane) {
    bool apart = false;
    for (size_t k = 0; k < DIRECTIONS && !apart; ++k) {
      const size_t node0 = 2 * (k / 2) * stride + k % 2, node1 = node0 + DIRECTIONS * stride;
      const size_t lane0 = soaIndex(k, lane), lane1 = soaIndex(DIRECTIONS + k, lane);
      const auto isAbove = [](uint16_t one, uint16_t other) { return one > turned(other); };
      const bool above =
          isAbove(lo[node0], lanes[HALF + lane0]) && (T0_ONLY || isAbove(lo[node1], lanes[HALF + lane1]));
      const bool below = isAbove(lanes[lane0], hi[node0]) && (T0_ONLY || isAbove(lanes[lane1], hi[node1]));
      apart = above || below;
    }
    bits |= static_cast<uint32_t>(!apart) << lane;
  }
  return bits;
}
#else
// Both values of a direction pair in all lanes.
template <class D>
HWY_INLINE hn::Vec<D> both(D d, const uint16_t* HWY_RESTRICT two) {
  int32_t pair;
  std::memcpy(&pair, two, sizeof pair);
  return hn::BitCast(d, hn::Set(hn::RepartitionToWide<D>(), pair));
}

// The values of a group's nodes, a vector of each two directions, side by side.
template <class D>
struct InMemory {
  const uint16_t* HWY_RESTRICT lanes;
  HWY_INLINE hn::Vec<D> operator()(size_t at) const { return hn::Load(D(), lanes + at); }
};

// The highest bit is set in the lanes that are apart in direction k, or were before. No other bit means anything.
template <bool T0_ONLY, class D, class Lanes>
HWY_INLINE hn::Vec<D> apartIn(D d, size_t k, const uint16_t* HWY_RESTRICT lo, const uint16_t* HWY_RESTRICT hi,
                              size_t stride, const Lanes& lanes, hn::Vec<D> apart) {
  const size_t smallest = soaIndex(k, 0), largest = smallest + RECORD * GROUP;
  const auto above0 = hn::AverageRound(lanes(largest), both(d, lo + k * stride));
  const auto below0 = hn::AverageRound(both(d, hi + k * stride), lanes(smallest));
  if (T0_ONLY) return hn::Or3(apart, above0, below0);
  const size_t t1 = (DIRECTIONS + k) * stride;
  const auto above1 = hn::AverageRound(lanes(largest + SOA_T1), both(d, lo + t1));
  const auto below1 = hn::AverageRound(both(d, hi + t1), lanes(smallest + SOA_T1));
  return hn::OrAnd(hn::OrAnd(apart, above0, above1), below0, below1);
}

template <bool T0_ONLY, class D, class Lanes>
HWY_INLINE uint32_t meetingIn(D d, const uint16_t* HWY_RESTRICT lo, const uint16_t* HWY_RESTRICT hi, size_t stride,
                              const Lanes& lanes) {
  auto apart = apartIn<T0_ONLY>(d, 0, lo, hi, stride, lanes, hn::Zero(d));
  apart = apartIn<T0_ONLY>(d, 2, lo, hi, stride, lanes, apart);
  apart = apartIn<T0_ONLY>(d, 4, lo, hi, stride, lanes, apart);
  apart = hn::And(apartIn<T0_ONLY>(d, 6, lo, hi, stride, lanes, apart), hn::Set(d, uint16_t{0x8000}));
  const hn::RepartitionToWide<D> d32;  // two directions of a lane
  return bitsOf(d32, hn::Eq(hn::BitCast(d32, apart), hn::Zero(d32)));
}

template <bool T0_ONLY>
HWY_INLINE uint32_t meeting(const uint16_t* HWY_RESTRICT lo, const uint16_t* HWY_RESTRICT hi, size_t stride,
                            const uint16_t* HWY_RESTRICT lanes) {
  const hn::CappedTag<uint16_t, 2 * GROUP> d;
  uint32_t bits = 0;
  for (size_t part = 0; part < 2 * GROUP; part += hn::Lanes(d)) {
    bits |= meetingIn<T0_ONLY>(d, lo, hi, stride, InMemory<decltype(d)>{lanes + part}) << (part / 2);
  }
  return bits;
}
#endif

#if DCCD_AVX512
using Lanes32 = hn::CappedTag<uint32_t, GROUP>;

// From a table: Iota() is written to the stack lane by lane, and read back at once.
HWY_ALIGN static constexpr uint32_t LANES[GROUP] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};

HWY_INLINE hn::Mask<Lanes32> maskOf(uint32_t bits) {
  const uint8_t packed[8] = {static_cast<uint8_t>(bits), static_cast<uint8_t>(bits >> 8)};
  return hn::LoadMaskBits(Lanes32(), packed);
}

// The nodes of one group, kept at hand while each node of another group is compared with all of them.
template <bool T0_ONLY>
class GroupLanes {  // in up to 16 of the 32 registers
  using D = hn::Repartition<uint16_t, Lanes32>;

 public:
  HWY_INLINE explicit GroupLanes(const uint16_t* HWY_RESTRICT group) {
    for (size_t i = 0; i < RECORD; ++i) {
      // With one time alone nothing is read of the other: the callers' arrays may end before it.
      const size_t at = i * 2 * GROUP;
      if (!T0_ONLY || at % (RECORD * GROUP) < SOA_T1) vectors_[i] = hn::Load(D(), group + at);
    }
  }
  HWY_INLINE hn::Vec<D> operator()(size_t at) const { return vectors_[at / (2 * GROUP)]; }
  HWY_INLINE uint32_t meets(const uint16_t* HWY_RESTRICT lo, const uint16_t* HWY_RESTRICT hi) const {
    return meetingIn<T0_ONLY>(D(), lo, hi, GROUP, *this);
  }

 private:
  hn::Vec<D> vectors_[RECORD];
};
#else
template <bool T0_ONLY>
class GroupLanes {
 public:
  HWY_INLINE explicit GroupLanes(const uint16_t* HWY_RESTRICT group) : group_(group) {}
  HWY_INLINE uint32_t meets(const uint16_t* HWY_RESTRICT lo, const uint16_t* HWY_RESTRICT hi) const {
    return meeting<T0_ONLY>(lo, hi, GROUP, group_);
  }

 private:
  const uint16_t* HWY_RESTRICT group_;
};
#endif

// Bit per lane: 1 where feature i of one group and the lane's of the other share a vertex. Two empty lanes do: both
// hold UINT32_MAX.
template <size_t ONE, size_t OTHER>
HWY_INLINE uint32_t sharing(const uint32_t* HWY_RESTRICT one, uint32_t i, const uint32_t* HWY_RESTRICT other) {
  const hn::CappedTag<uint32_t, GROUP> d;
  uint32_t bits = 0;
  for (size_t part = 0; part < GROUP; part += hn::Lanes(d)) {
    auto same = hn::Eq(hn::Set(d, one[i]), hn::Load(d, other + part));
    for (size_t x = 0; x < ONE; ++x) {
      for (size_t y = x == 0 ? 1 : 0; y < OTHER; ++y) {
        same = hn::Or(same, hn::Eq(hn::Set(d, one[x * GROUP + i]), hn::Load(d, other + y * GROUP + part)));
      }
    }
    bits |= bitsOf(d, same) << part;
  }
  return bits;
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
#endif
