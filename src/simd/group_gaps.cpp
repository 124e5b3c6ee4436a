#include "simd/group_gaps.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/group_gaps.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/lane_bits-inl.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// How far lane i of one group is from each lane of the other at t1, in weighted units, rounded down: the larger of the
// gaps above and below, in the direction that says most. sa, sb: the halves at t1 of the smallest values.
HWY_INLINE void rowGaps(const int16_t* HWY_RESTRICT sa, size_t i, const int16_t* HWY_RESTRICT sb,
                        const uint16_t* HWY_RESTRICT weights, int32_t* HWY_RESTRICT out) {
  constexpr size_t HALF = RECORD * GROUP;
#if HWY_TARGET == HWY_SCALAR
  for (size_t j = 0; j < GROUP; ++j) {
    out[j] = 0;
    for (size_t k = 0; k < DIRECTIONS; ++k) {
      const size_t x = soaIndex(k, i), y = soaIndex(k, j);
      const int32_t gap = std::max(sa[x] - sb[HALF + y], sb[y] - sa[HALF + x]);
      out[j] = std::max(out[j], std::max(std::min(gap, 32767) - 1, 0) * weights[k] >> 16);
    }
  }
#else
  const hn::CappedTag<int16_t, 2 * GROUP> d;
  const hn::RebindToUnsigned<decltype(d)> du;
  const hn::RepartitionToWide<decltype(d)> d32;
  const auto both = [&](const void* two) {
    int32_t pair;
    std::memcpy(&pair, two, sizeof pair);
    return hn::BitCast(d, hn::Set(d32, pair));
  };
  const auto zero = hn::Zero(d), one = hn::Set(d, int16_t{1});
  for (size_t part = 0; part < 2 * GROUP; part += hn::Lanes(d)) {
    auto best = zero;
    for (size_t k = 0; k < DIRECTIONS; k += 2) {
      const int16_t* HWY_RESTRICT smallest = sb + soaIndex(k, 0) + part;
      const int16_t* HWY_RESTRICT mine = sa + soaIndex(k, i);
      const auto above = hn::SaturatedSub(both(mine), hn::Load(d, smallest + HALF));
      const auto below = hn::SaturatedSub(hn::Load(d, smallest), both(mine + HALF));
      // More than a unit less than the gap; negative ones say nothing and need not be right.
      const auto gap = hn::Max(hn::Sub(hn::Max(hn::Max(above, below), zero), one), zero);
      best = hn::Max(best, hn::BitCast(d, hn::MulHigh(hn::BitCast(du, gap), hn::BitCast(du, both(weights + k)))));
    }
    const auto even = hn::ShiftRight<16>(hn::ShiftLeft<16>(hn::BitCast(d32, best)));
    hn::Store(hn::Max(even, hn::ShiftRight<16>(hn::BitCast(d32, best))), d32, out + part / 2);
  }
#endif
}

int16_t GapAtEnd(const GroupsView& a, const GroupsView& b, uint32_t g, uint32_t h, bool self, const uint16_t* shared,
                 const uint16_t* HWY_RESTRICT weights, int16_t target, uint8_t* HWY_RESTRICT near, size_t room,
                 size_t* found) {
  const hn::CappedTag<int32_t, GROUP> d;
  const int16_t* HWY_RESTRICT sa = a.soa + size_t{g} * SOA_SIZE + soaIndex(DIRECTIONS, 0);
  const int16_t* HWY_RESTRICT sb = b.soa + size_t{h} * SOA_SIZE + soaIndex(DIRECTIONS, 0);
  const auto isEmpty = [](const int16_t* half, size_t lane) { return half[soaIndex(0, lane)] == EMPTY_LO; };
  uint32_t there = 0;
  for (size_t j = 0; j < GROUP; ++j) there |= static_cast<uint32_t>(!isEmpty(sb, j)) << j;
  size_t n = 0;
  auto smallest = hn::Set(d, int32_t{EMPTY_LO});
  HWY_ALIGN int32_t gaps[GROUP];
  for (size_t i = 0; i < GROUP; ++i) {
    uint32_t wanted = isEmpty(sa, i) ? 0 : shared ? there & ~uint32_t{shared[i]} : there;
    if (self && g == h) wanted &= ~0u << (i + 1);
    if (wanted == 0) continue;
    rowGaps(sa, i, sb, weights, gaps);
    uint32_t is_near = 0;
    for (size_t part = 0; part < GROUP; part += hn::Lanes(d)) {
      const auto gap = hn::Load(d, gaps + part);
      const uint32_t rest = wanted >> part;
      uint8_t bits[8] = {0};
      std::memcpy(bits, &rest, sizeof rest);
      const auto counts = hn::LoadMaskBits(d, bits);
      const auto near_ones = hn::And(counts, hn::Lt(gap, hn::Set(d, int32_t{target})));
      smallest = hn::Min(smallest, hn::IfThenElse(hn::AndNot(near_ones, counts), gap, hn::Set(d, int32_t{EMPTY_LO})));
      is_near |= bitsOf(d, near_ones) << part;
    }
    for (; is_near; is_near &= is_near - 1) {
      if (n < room) near[n] = static_cast<uint8_t>(i * GROUP + hwy::Num0BitsBelowLS1Bit_Nonzero32(is_near));
      ++n;
    }
  }
  *found = n;
  hn::Store(smallest, d, gaps);
  return static_cast<int16_t>(*std::min_element(gaps, gaps + hn::Lanes(d)));
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {
HWY_EXPORT(GapAtEnd);

std::int16_t gapAtEnd(const GroupsView& a, const GroupsView& b, std::uint32_t g, std::uint32_t h, bool self,
                      const std::uint16_t* shared, const std::uint16_t* weights, std::int16_t target,
                      std::uint8_t* near, std::size_t room, std::size_t* found) {
  return HWY_DYNAMIC_DISPATCH(GapAtEnd)(a, b, g, h, self, shared, weights, target, near, room, found);
}

}  // namespace simd
}  // namespace dccd
#endif
