#include "simd/cluster_bounds.h"

#include <algorithm>
#include <cstring>

#include "simd/directions.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/cluster_bounds.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Ends = hn::CappedTag<double, 8>;
using EndValues = hn::Vec<Ends>;

/// Projections of as many points as there are lanes.
HWY_INLINE void projectLanes(const double* HWY_RESTRICT points, EndValues* HWY_RESTRICT p) {
  EndValues unused;
  hn::LoadInterleaved4(Ends(), points, p[0], p[1], p[2], unused);
  p[3] = hn::Add(p[0], p[1]);
  p[4] = hn::Add(p[0], p[2]);
  p[5] = hn::Add(p[1], p[2]);
  p[6] = hn::Sub(p[0], p[1]);
  p[7] = hn::Sub(p[1], p[2]);
}

/// Calls f(points, i) for points from the i-th on, in blocks of as many as there are lanes: the last block may begin
/// before the one before it ends. Of fewer points than that the last one is there several times.
template <class F>
HWY_INLINE void forEachBlock(const double* HWY_RESTRICT vertices, size_t points, const F& f) {
  if (points == 0) return;
  const size_t lanes = hn::Lanes(Ends());
  HWY_ALIGN double few[4 * 8];
  for (size_t i = 0; points < lanes && i < lanes; ++i) {
    std::copy_n(vertices + 4 * std::min(i, points - 1), 4, few + 4 * i);
  }
  for (size_t i = 0; i < points; i += lanes) {
    const size_t first = points < lanes ? 0 : std::min(i, points - lanes);
    f(points < lanes ? few : vertices + 4 * first, first);
  }
}

void ProjectionBounds(const double* HWY_RESTRICT vertices, size_t n, double* HWY_RESTRICT min8,
                      double* HWY_RESTRICT max8) {
  const Ends d;
  EndValues lo[DIRECTIONS], hi[DIRECTIONS];
  for (size_t k = 0; k < DIRECTIONS; ++k) lo[k] = hn::Set(d, min8[k]), hi[k] = hn::Set(d, max8[k]);
  forEachBlock(vertices, 2 * n, [&](const double* HWY_RESTRICT points, size_t) HWY_ATTR {
    EndValues p[DIRECTIONS];
    projectLanes(points, p);
    for (size_t k = 0; k < DIRECTIONS; ++k) lo[k] = hn::Min(p[k], lo[k]), hi[k] = hn::Max(p[k], hi[k]);
  });
  for (size_t k = 0; k < DIRECTIONS; ++k) {
    min8[k] = hn::GetLane(hn::MinOfLanes(d, lo[k]));
    max8[k] = hn::GetLane(hn::MaxOfLanes(d, hi[k]));
  }
}

void Quantize(const double* HWY_RESTRICT vertices, size_t n, const double* HWY_RESTRICT low8,
              const double* HWY_RESTRICT scale8, uint16_t* HWY_RESTRICT records) {
  const Ends d;
  const hn::Rebind<int32_t, Ends> di;
  // Two directions in 32 bits, so that those of a point come to lie side by side.
  forEachBlock(vertices, 2 * n, [&](const double* HWY_RESTRICT points, size_t first) HWY_ATTR {
    EndValues p[DIRECTIONS];
    projectLanes(points, p);
    const auto record = [&](size_t k) HWY_ATTR {
      const auto value = hn::Mul(hn::Sub(p[k], hn::Set(d, low8[k])), hn::Set(d, scale8[k]));
      // A sum that overflowed meets a scale of 0 only; the direction then says nothing about any vertex. What lies
      // outside the range (a body without any active vertex) takes its end, which keeps the order, too.
      const auto whole = hn::DemoteTo(di, hn::IfThenElseZero(hn::Gt(hn::Set(d, scale8[k]), hn::Zero(d)), value));
      return hn::Add(hn::Clamp(whole, hn::Zero(di), hn::Set(di, static_cast<int32_t>(RECORD_RANGE))),
                     hn::Set(di, RECORD_LOWEST));
    };
    const auto two = [&](size_t k) HWY_ATTR { return hn::Or(record(k), hn::ShiftLeft<16>(record(k + 1))); };
    const size_t lanes = hn::Lanes(d), count = std::min(lanes, 2 * n);
    HWY_ALIGN int32_t last[4 * 8];
    int32_t* const to = count < lanes ? last : reinterpret_cast<int32_t*>(records + DIRECTIONS * first);
    hn::StoreInterleaved4(two(0), two(2), two(4), two(6), di, to);
    if (count < lanes) std::memcpy(records, last, count * DIRECTIONS * sizeof(uint16_t));
  });
}

// rows: 16 rows of 16 values. A lane's two neighbouring directions stay side by side (soaIndex()).
HWY_INLINE void transposePairs(const uint16_t* HWY_RESTRICT rows, uint16_t* HWY_RESTRICT out) {
#if HWY_TARGET == HWY_SCALAR
  for (size_t i = 0; i < GROUP; ++i)
    for (size_t k = 0; k < RECORD; ++k) out[soaIndex(k, i)] = rows[i * RECORD + k];
#else
  const hn::FixedTag<uint16_t, 8> d;
  const hn::RepartitionToWide<decltype(d)> d32;
  const hn::RepartitionToWide<decltype(d32)> d64;
  const auto wide = [&](hn::Vec<decltype(d32)> v) { return hn::BitCast(d64, v); };
  for (size_t r = 0; r < GROUP; r += 4) {
    for (size_t k = 0; k < RECORD; k += 8) {
      const auto row = [&](size_t i) { return hn::BitCast(d32, hn::Load(d, rows + (r + i) * RECORD + k)); };
      const auto lower01 = wide(hn::InterleaveLower(d32, row(0), row(1)));
      const auto upper01 = wide(hn::InterleaveUpper(d32, row(0), row(1)));
      const auto lower23 = wide(hn::InterleaveLower(d32, row(2), row(3)));
      const auto upper23 = wide(hn::InterleaveUpper(d32, row(2), row(3)));
      hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, lower01, lower23)), d, out + soaIndex(k, r));
      hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, lower01, lower23)), d, out + soaIndex(k + 2, r));
      hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, upper01, upper23)), d, out + soaIndex(k + 4, r));
      hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, upper01, upper23)), d, out + soaIndex(k + 6, r));
    }
  }
#endif
}

using D16 = hn::CappedTag<uint16_t, 16>;

HWY_INLINE hn::Vec<D16> turned(hn::Vec<D16> values) { return hn::Sub(hn::Set(D16(), EMPTY), values); }

// lo and hi: 16 rows of 16 values each.
HWY_INLINE void finishGroup(const uint16_t* HWY_RESTRICT lo, const uint16_t* HWY_RESTRICT hi,
                            uint16_t* HWY_RESTRICT soa, uint16_t* HWY_RESTRICT aos) {
  const D16 d;
  for (size_t k = 0; k < RECORD; k += hn::Lanes(d)) {
    auto small = hn::Load(d, lo + k);
    auto large = hn::Load(d, hi + k);
    for (size_t i = 1; i < GROUP; ++i) {
      small = hn::Min(small, hn::Load(d, lo + i * RECORD + k));
      large = hn::Min(large, hn::Load(d, hi + i * RECORD + k));
    }
    hn::StoreU(small, d, aos + k);
    hn::StoreU(large, d, aos + RECORD + k);
  }
  transposePairs(lo, soa);
  transposePairs(hi, soa + RECORD * GROUP);
}

// Smallest and (turned) largest values k of a feature, widened by the margins; of an empty lane the empty value.
template <class D, class V>
HWY_INLINE void boundFeature(D d, const uint16_t* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT f, size_t arity,
                             const uint16_t* HWY_RESTRICT margin16, size_t k, V& small, V& large) {
  small = large = hn::Set(d, EMPTY);
  if (f[0] == UINT32_MAX) return;
  small = large = hn::LoadU(d, records + RECORD * size_t{f[0]} + k);
  for (size_t j = 1; j < arity; ++j) {
    const auto r = hn::LoadU(d, records + RECORD * size_t{f[j]} + k);
    small = hn::Min(small, r);
    large = hn::Max(large, r);
  }
  large = turned(large);
  if (!margin16) return;
  // What is cut off at the lowest value reaches every record, which all lie above; but a margin of half the range
  // reaches no end from the other one, so that what is cut off at UNBOUNDED goes there outright.
  const auto m = hn::LoadU(d, margin16 + k), lowest = hn::Set(d, uint16_t{1});
  const auto unbounded = hn::Eq(m, hn::Set(d, UNBOUNDED));
  small = hn::IfThenElse(unbounded, lowest, hn::Max(hn::SaturatedSub(small, m), lowest));
  large = hn::IfThenElse(unbounded, lowest, hn::Max(hn::SaturatedSub(large, m), lowest));
}

void BuildLeaves(const uint16_t* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT indices, size_t arity, size_t count,
                 const uint16_t* HWY_RESTRICT margin16, uint16_t* HWY_RESTRICT soa, uint16_t* HWY_RESTRICT aos) {
  const D16 d;
  HWY_ALIGN uint16_t lo[GROUP * RECORD];
  HWY_ALIGN uint16_t hi[GROUP * RECORD];
  for (size_t g = 0; g < count / GROUP; ++g) {
    for (size_t i = 0; i < GROUP; ++i) {
      for (size_t k = 0; k < RECORD; k += hn::Lanes(d)) {
        hn::Vec<D16> small, large;
        boundFeature(d, records, indices + (g * GROUP + i) * arity, arity, margin16, k, small, large);
        hn::Store(small, d, lo + i * RECORD + k);
        hn::Store(large, d, hi + i * RECORD + k);
      }
    }
    finishGroup(lo, hi, soa + g * SOA_SIZE, aos + g * AOS_SIZE);
  }
}

template <size_t ARITY>
HWY_INLINE void boundGroups(const uint16_t* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT indices, size_t count,
                            uint16_t* HWY_RESTRICT aos) {
  const D16 d;
  for (const uint32_t* end = indices + count * ARITY; indices != end; indices += GROUP * ARITY, aos += AOS_SIZE) {
    for (size_t k = 0; k < RECORD; k += hn::Lanes(d)) {
      // Of every other feature, so that half of the comparisons do not wait for the other half.
      auto small = hn::Set(d, EMPTY), large = turned(small), other_small = small, other_large = large;
      const auto add = [&](const uint32_t* f, hn::Vec<D16>& lo, hn::Vec<D16>& hi) HWY_ATTR {
        for (size_t j = 0; f[0] != UINT32_MAX && j < ARITY; ++j) {
          const auto r = hn::LoadU(d, records + RECORD * size_t{f[j]} + k);
          lo = hn::Min(lo, r);
          hi = hn::Max(hi, r);
        }
      };
      for (size_t i = 0; i < GROUP; i += 2) {
        add(indices + i * ARITY, small, large);
        add(indices + (i + 1) * ARITY, other_small, other_large);
      }
      hn::StoreU(hn::Min(small, other_small), d, aos + k);
      hn::StoreU(turned(hn::Max(large, other_large)), d, aos + RECORD + k);
    }
  }
}

void BoundGroups(const uint16_t* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT indices, size_t arity, size_t count,
                 uint16_t* HWY_RESTRICT aos) {
  if (arity == 1) return boundGroups<1>(records, indices, count, aos);
  if (arity == 2) return boundGroups<2>(records, indices, count, aos);
  boundGroups<3>(records, indices, count, aos);
}

void BuildUpper(const uint16_t* HWY_RESTRICT child_aos, size_t child_count, uint16_t* HWY_RESTRICT soa,
                uint16_t* HWY_RESTRICT aos) {
  HWY_ALIGN uint16_t lo[GROUP * RECORD];
  HWY_ALIGN uint16_t hi[GROUP * RECORD];
  for (size_t g = 0; g * GROUP < child_count; ++g) {
    for (size_t i = 0; i < GROUP; ++i) {
      const size_t c = g * GROUP + i;
      if (c < child_count) {
        std::memcpy(lo + i * RECORD, child_aos + c * AOS_SIZE, RECORD * sizeof(uint16_t));
        std::memcpy(hi + i * RECORD, child_aos + c * AOS_SIZE + RECORD, RECORD * sizeof(uint16_t));
      } else {
        std::fill_n(lo + i * RECORD, RECORD, EMPTY);
        std::fill_n(hi + i * RECORD, RECORD, EMPTY);
      }
    }
    finishGroup(lo, hi, soa + g * SOA_SIZE, aos + g * AOS_SIZE);
  }
}

// n values (a multiple of 8) at t0 and t1: the latter become those at `end`, rounded down and one further, or where
// they are swept, the smaller of both. What is empty becomes 65533, and the largest of a record 65532 at most.
HWY_INLINE void shorten(const uint16_t* HWY_RESTRICT at0, uint16_t* HWY_RESTRICT at1, size_t n, int32_t end,
                        bool swept) {
  const hn::CappedTag<int32_t, 8> d32;
  const hn::Rebind<uint16_t, decltype(d32)> d16;
  const auto share = hn::Set(d32, end), one = hn::Set(d32, 1);
  for (size_t i = 0; i < n; i += hn::Lanes(d32)) {
    const auto from = hn::PromoteTo(d32, hn::LoadU(d16, at0 + i)), to = hn::PromoteTo(d32, hn::LoadU(d16, at1 + i));
    // Differences are below 2^16 less a few, so that no product overflows.
    const auto moved = hn::Sub(hn::Add(from, hn::ShiftRight<15>(hn::Mul(hn::Sub(to, from), share))), one);
    hn::StoreU(hn::DemoteTo(d16, swept ? hn::Min(from, moved) : moved), d16, at1 + i);
  }
}

void ShortenBounds(uint16_t* HWY_RESTRICT soa, uint16_t* HWY_RESTRICT aos, size_t groups, int32_t end, bool swept) {
  constexpr size_t HALF = RECORD * GROUP;
  for (size_t g = 0; g < groups; ++g, soa += SOA_SIZE, aos += AOS_SIZE) {
    for (size_t half = 0; half < 2; ++half) {
      uint16_t *HWY_RESTRICT of_lanes = soa + half * HALF, *HWY_RESTRICT of_group = aos + half * RECORD;
      shorten(of_lanes, of_lanes + SOA_T1, SOA_T1, end, swept);
      shorten(of_group, of_group + DIRECTIONS, DIRECTIONS, end, swept);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {
HWY_EXPORT(ProjectionBounds);
HWY_EXPORT(Quantize);
HWY_EXPORT(BuildLeaves);
HWY_EXPORT(BoundGroups);
HWY_EXPORT(BuildUpper);
HWY_EXPORT(ShortenBounds);

void projectionBounds(const double* vertices, std::size_t n, double* min8, double* max8) {
  HWY_DYNAMIC_DISPATCH(ProjectionBounds)(vertices, n, min8, max8);
}
void quantize(const double* vertices, std::size_t n, const double* low8, const double* scale8, std::uint16_t* records) {
  HWY_DYNAMIC_DISPATCH(Quantize)(vertices, n, low8, scale8, records);
}
void buildLeaves(const std::uint16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 const std::uint16_t* margin16, std::uint16_t* soa, std::uint16_t* aos) {
  HWY_DYNAMIC_DISPATCH(BuildLeaves)(records, indices, arity, count, margin16, soa, aos);
}
void boundGroups(const std::uint16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 std::uint16_t* aos) {
  HWY_DYNAMIC_DISPATCH(BoundGroups)(records, indices, arity, count, aos);
}
void buildUpper(const std::uint16_t* child_aos, std::size_t child_count, std::uint16_t* soa, std::uint16_t* aos) {
  HWY_DYNAMIC_DISPATCH(BuildUpper)(child_aos, child_count, soa, aos);
}
void shortenBounds(std::uint16_t* soa, std::uint16_t* aos, std::size_t groups, std::int32_t end, bool swept) {
  HWY_DYNAMIC_DISPATCH(ShortenBounds)(soa, aos, groups, end, swept);
}

}  // namespace simd
}  // namespace dccd
#endif
