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

void ProjectionBounds(const double* HWY_RESTRICT vertices, size_t n, double* HWY_RESTRICT min8,
                      double* HWY_RESTRICT max8) {
  double lo[8], hi[8], p[8];
  std::copy(min8, min8 + 8, lo);
  std::copy(max8, max8 + 8, hi);
  for (size_t i = 0; i < 2 * n; ++i) {
    project(vertices + 4 * i, p);
    for (int d = 0; d < 8; ++d) {
      lo[d] = p[d] < lo[d] ? p[d] : lo[d];
      hi[d] = p[d] > hi[d] ? p[d] : hi[d];
    }
  }
  std::copy(lo, lo + 8, min8);
  std::copy(hi, hi + 8, max8);
}

void Quantize(const double* HWY_RESTRICT vertices, size_t n, const double* HWY_RESTRICT low8,
              const double* HWY_RESTRICT scale8, int16_t* HWY_RESTRICT records) {
  const hn::CappedTag<double, 8> dd;
  const hn::Rebind<int32_t, decltype(dd)> di;
  HWY_ALIGN double p[8];
  HWY_ALIGN int32_t q[8];
  for (size_t i = 0; i < 2 * n; ++i) {
    project(vertices + 4 * i, p);
    for (size_t d = 0; d < 8; d += hn::Lanes(dd)) {
      const auto value = hn::Mul(hn::Sub(hn::Load(dd, p + d), hn::LoadU(dd, low8 + d)), hn::LoadU(dd, scale8 + d));
      // A sum that overflowed meets a scale of 0 only; the direction then says nothing about any vertex. What lies
      // outside the range (a body without any active vertex) takes its end, which keeps the order, too.
      const auto number = hn::IfThenElseZero(hn::Eq(value, value), value);
      hn::Store(hn::DemoteTo(di, hn::Clamp(number, hn::Zero(dd), hn::Set(dd, RECORD_RANGE))), di, q + d);
    }
    for (int d = 0; d < 8; ++d) records[8 * i + d] = static_cast<int16_t>(q[d] - 32764);
  }
}

// rows: 16 rows of 16 values. A lane's two neighbouring directions stay side by side (soaIndex()).
HWY_INLINE void transposePairs(const int16_t* HWY_RESTRICT rows, int16_t* HWY_RESTRICT out) {
#if HWY_TARGET == HWY_SCALAR
  for (size_t i = 0; i < GROUP; ++i)
    for (size_t k = 0; k < RECORD; ++k) out[soaIndex(k, i)] = rows[i * RECORD + k];
#else
  const hn::FixedTag<int16_t, 8> d;
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

using D16 = hn::CappedTag<int16_t, 16>;

// lo and hi: 16 rows of 16 values each.
HWY_INLINE void finishGroup(const int16_t* HWY_RESTRICT lo, const int16_t* HWY_RESTRICT hi, int16_t* HWY_RESTRICT soa,
                            int16_t* HWY_RESTRICT aos) {
  const D16 d;
  for (size_t k = 0; k < RECORD; k += hn::Lanes(d)) {
    auto small = hn::Load(d, lo + k);
    auto large = hn::Load(d, hi + k);
    for (size_t i = 1; i < GROUP; ++i) {
      small = hn::Min(small, hn::Load(d, lo + i * RECORD + k));
      large = hn::Max(large, hn::Load(d, hi + i * RECORD + k));
    }
    hn::StoreU(small, d, aos + k);
    hn::StoreU(large, d, aos + RECORD + k);
  }
  transposePairs(lo, soa);
  transposePairs(hi, soa + RECORD * GROUP);
}

// Smallest and largest values k of a feature, widened by the margins; of an empty lane the empty values.
template <class D, class V>
HWY_INLINE void boundFeature(D d, const int16_t* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT f, size_t arity,
                             const int16_t* HWY_RESTRICT margin16, size_t k, V& small, V& large) {
  small = hn::Set(d, EMPTY_LO);
  large = hn::Set(d, EMPTY_HI);
  if (f[0] == UINT32_MAX) return;
  small = large = hn::LoadU(d, records + RECORD * size_t{f[0]} + k);
  for (size_t j = 1; j < arity; ++j) {
    const auto r = hn::LoadU(d, records + RECORD * size_t{f[j]} + k);
    small = hn::Min(small, r);
    large = hn::Max(large, r);
  }
  if (!margin16) return;
  // Saturation at the empty values would hide a feature; the record range leaves room on both sides. What ends there
  // reaches every record, which all lie within; but a margin of half the range reaches no end from the other one, so
  // that what is cut off at UNBOUNDED goes there outright.
  const auto m = hn::LoadU(d, margin16 + k);
  const auto lowest = hn::Set(d, int16_t{-32766}), highest = hn::Set(d, int16_t{32766});
  const auto unbounded = hn::Eq(m, hn::Set(d, UNBOUNDED));
  small = hn::IfThenElse(unbounded, lowest, hn::Max(hn::SaturatedSub(small, m), lowest));
  large = hn::IfThenElse(unbounded, highest, hn::Min(hn::SaturatedAdd(large, m), highest));
}

void BuildLeaves(const int16_t* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT indices, size_t arity, size_t count,
                 const int16_t* HWY_RESTRICT margin16, int16_t* HWY_RESTRICT soa, int16_t* HWY_RESTRICT aos) {
  const D16 d;
  HWY_ALIGN int16_t lo[GROUP * RECORD];
  HWY_ALIGN int16_t hi[GROUP * RECORD];
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

void BuildUpper(const int16_t* HWY_RESTRICT child_aos, size_t child_count, int16_t* HWY_RESTRICT soa,
                int16_t* HWY_RESTRICT aos) {
  HWY_ALIGN int16_t lo[GROUP * RECORD];
  HWY_ALIGN int16_t hi[GROUP * RECORD];
  for (size_t g = 0; g * GROUP < child_count; ++g) {
    for (size_t i = 0; i < GROUP; ++i) {
      const size_t c = g * GROUP + i;
      if (c < child_count) {
        std::memcpy(lo + i * RECORD, child_aos + c * AOS_SIZE, RECORD * sizeof(int16_t));
        std::memcpy(hi + i * RECORD, child_aos + c * AOS_SIZE + RECORD, RECORD * sizeof(int16_t));
      } else {
        std::fill_n(lo + i * RECORD, RECORD, EMPTY_LO);
        std::fill_n(hi + i * RECORD, RECORD, EMPTY_HI);
      }
    }
    finishGroup(lo, hi, soa + g * SOA_SIZE, aos + g * AOS_SIZE);
  }
}

// n values (a multiple of 8) at t0 and t1: the latter become those at `end`, rounded outwards and one further, or where
// they are swept, the outermost of both. What is empty stays outside of what any record can be.
template <bool LARGEST>
HWY_INLINE void shorten(const int16_t* HWY_RESTRICT at0, int16_t* HWY_RESTRICT at1, size_t n, int32_t end, bool swept) {
  const hn::CappedTag<int32_t, 8> d32;
  const hn::Rebind<int16_t, decltype(d32)> d16;
  const auto share = hn::Set(d32, end), one = hn::Set(d32, 1);
  for (size_t i = 0; i < n; i += hn::Lanes(d32)) {
    const auto from = hn::PromoteTo(d32, hn::LoadU(d16, at0 + i)), to = hn::PromoteTo(d32, hn::LoadU(d16, at1 + i));
    // Differences are below 2^16 less a few, so that no product overflows.
    const auto moved = LARGEST ? hn::Add(hn::Sub(from, hn::ShiftRight<15>(hn::Mul(hn::Sub(from, to), share))), one)
                               : hn::Sub(hn::Add(from, hn::ShiftRight<15>(hn::Mul(hn::Sub(to, from), share))), one);
    const auto outermost = LARGEST ? hn::Max(from, moved) : hn::Min(from, moved);
    hn::StoreU(hn::DemoteTo(d16, swept ? outermost : moved), d16, at1 + i);
  }
}

void ShortenBounds(int16_t* HWY_RESTRICT soa, int16_t* HWY_RESTRICT aos, size_t groups, int32_t end, bool swept) {
  constexpr size_t HALF = RECORD * GROUP;
  for (size_t g = 0; g < groups; ++g, soa += SOA_SIZE, aos += AOS_SIZE) {
    shorten<false>(soa, soa + SOA_T1, SOA_T1, end, swept);
    shorten<true>(soa + HALF, soa + HALF + SOA_T1, SOA_T1, end, swept);
    shorten<false>(aos, aos + DIRECTIONS, DIRECTIONS, end, swept);
    shorten<true>(aos + RECORD, aos + RECORD + DIRECTIONS, DIRECTIONS, end, swept);
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
HWY_EXPORT(BuildUpper);
HWY_EXPORT(ShortenBounds);

void projectionBounds(const double* vertices, std::size_t n, double* min8, double* max8) {
  HWY_DYNAMIC_DISPATCH(ProjectionBounds)(vertices, n, min8, max8);
}
void quantize(const double* vertices, std::size_t n, const double* low8, const double* scale8, std::int16_t* records) {
  HWY_DYNAMIC_DISPATCH(Quantize)(vertices, n, low8, scale8, records);
}
void buildLeaves(const std::int16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 const std::int16_t* margin16, std::int16_t* soa, std::int16_t* aos) {
  HWY_DYNAMIC_DISPATCH(BuildLeaves)(records, indices, arity, count, margin16, soa, aos);
}
void buildUpper(const std::int16_t* child_aos, std::size_t child_count, std::int16_t* soa, std::int16_t* aos) {
  HWY_DYNAMIC_DISPATCH(BuildUpper)(child_aos, child_count, soa, aos);
}
void shortenBounds(std::int16_t* soa, std::int16_t* aos, std::size_t groups, std::int32_t end, bool swept) {
  HWY_DYNAMIC_DISPATCH(ShortenBounds)(soa, aos, groups, end, swept);
}

}  // namespace simd
}  // namespace dccd
#endif
