#include "simd/cluster_kernels.h"

#include <algorithm>
#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/cluster_kernels.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// The five sums are rounded once each: monotone in the exact projection.
HWY_INLINE void project(const double* HWY_RESTRICT x, double* HWY_RESTRICT p) {
  p[0] = x[0];
  p[1] = x[1];
  p[2] = x[2];
  p[3] = x[0] + x[1];
  p[4] = x[0] + x[2];
  p[5] = x[1] + x[2];
  p[6] = x[0] - x[1];
  p[7] = x[1] - x[2];
}

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

#if HWY_TARGET != HWY_SCALAR
using D8 = hn::FixedTag<int16_t, 8>;
using V8 = hn::Vec<D8>;

// 8x8 transpose of int16: in[i] is row i, out row k to out + k * GROUP.
HWY_INLINE void transpose8(const V8* HWY_RESTRICT in, int16_t* HWY_RESTRICT out) {
  const D8 d;
  const hn::RepartitionToWide<D8> d32;
  const hn::RepartitionToWide<decltype(d32)> d64;
  const auto w = [&](V8 v) { return hn::BitCast(d32, v); };
  V8 a[8];
  for (int i = 0; i < 4; ++i) {
    a[2 * i] = hn::InterleaveLower(d, in[2 * i], in[2 * i + 1]);
    a[2 * i + 1] = hn::InterleaveUpper(d, in[2 * i], in[2 * i + 1]);
  }
  // a[2i]: rows 2i, 2i+1, columns 0..3; a[2i+1]: columns 4..7.
  for (int half = 0; half < 2; ++half) {
    const auto r01_lo = hn::InterleaveLower(d32, w(a[half]), w(a[2 + half]));
    const auto r01_hi = hn::InterleaveUpper(d32, w(a[half]), w(a[2 + half]));
    const auto r23_lo = hn::InterleaveLower(d32, w(a[4 + half]), w(a[6 + half]));
    const auto r23_hi = hn::InterleaveUpper(d32, w(a[4 + half]), w(a[6 + half]));
    const auto x = [&](hn::Vec<decltype(d32)> v) { return hn::BitCast(d64, v); };
    int16_t* o = out + 4 * half * GROUP;
    hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, x(r01_lo), x(r23_lo))), d, o);
    hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, x(r01_lo), x(r23_lo))), d, o + GROUP);
    hn::StoreU(hn::BitCast(d, hn::InterleaveLower(d64, x(r01_hi), x(r23_hi))), d, o + 2 * GROUP);
    hn::StoreU(hn::BitCast(d, hn::InterleaveUpper(d64, x(r01_hi), x(r23_hi))), d, o + 3 * GROUP);
  }
}

// rows: 16 rows of 16 values.
HWY_INLINE void transpose16(const int16_t* HWY_RESTRICT rows, int16_t* HWY_RESTRICT out) {
  const D8 d;
  for (int r = 0; r < 2; ++r) {
    for (int c = 0; c < 2; ++c) {
      V8 in[8];
      for (int i = 0; i < 8; ++i) in[i] = hn::Load(d, rows + (8 * r + i) * RECORD + 8 * c);
      transpose8(in, out + 8 * c * GROUP + 8 * r);
    }
  }
}
#else
HWY_INLINE void transpose16(const int16_t* HWY_RESTRICT rows, int16_t* HWY_RESTRICT out) {
  for (size_t i = 0; i < GROUP; ++i)
    for (size_t k = 0; k < RECORD; ++k) out[k * GROUP + i] = rows[i * RECORD + k];
}
#endif

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
  transpose16(lo, soa);
  transpose16(hi, soa + RECORD * GROUP);
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

void BoundLeaves(const int16_t* HWY_RESTRICT records, const uint32_t* HWY_RESTRICT indices, size_t arity, size_t count,
                 const int16_t* HWY_RESTRICT margin16, int16_t* HWY_RESTRICT aos) {
  const D16 d;
  for (size_t g = 0; g < count / GROUP; ++g) {
    for (size_t k = 0; k < RECORD; k += hn::Lanes(d)) {
      auto lowest = hn::Set(d, EMPTY_LO);
      auto highest = hn::Set(d, EMPTY_HI);
      for (size_t i = 0; i < GROUP; ++i) {
        hn::Vec<D16> small, large;
        boundFeature(d, records, indices + (g * GROUP + i) * arity, arity, margin16, k, small, large);
        lowest = hn::Min(lowest, small);
        highest = hn::Max(highest, large);
      }
      hn::StoreU(lowest, d, aos + g * AOS_SIZE + k);
      hn::StoreU(highest, d, aos + g * AOS_SIZE + RECORD + k);
    }
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

// Positive lanes are separated in one of the directions [first, last): the smaller of the gaps at t0 and t1 is positive
// on one side. Saturating differences keep the sign. lo and hi point at the 16 values of one node, `stride` apart.
template <bool T0_ONLY>
HWY_INLINE hn::Vec<D16> gaps(const int16_t* HWY_RESTRICT lo, const int16_t* HWY_RESTRICT hi, size_t stride,
                             const int16_t* HWY_RESTRICT lanes, size_t first, size_t last) {
  const D16 d;
  auto acc = hn::Set(d, int16_t{-1});
  for (size_t k = first; k < last; ++k) {
    const auto above0 = hn::SaturatedSub(hn::Set(d, lo[k * stride]), hn::Load(d, lanes + (16 + k) * GROUP));
    const auto below0 = hn::SaturatedSub(hn::Load(d, lanes + k * GROUP), hn::Set(d, hi[k * stride]));
    if (T0_ONLY) {
      acc = hn::Max(acc, hn::Max(above0, below0));
    } else {
      const auto above1 = hn::SaturatedSub(hn::Set(d, lo[(8 + k) * stride]), hn::Load(d, lanes + (24 + k) * GROUP));
      const auto below1 = hn::SaturatedSub(hn::Load(d, lanes + (8 + k) * GROUP), hn::Set(d, hi[(8 + k) * stride]));
      acc = hn::Max(acc, hn::Max(hn::Min(above0, above1), hn::Min(below0, below1)));
    }
  }
  return acc;
}

// Bit per lane: 1 where the node may meet the lane's node.
template <bool T0_ONLY>
HWY_INLINE uint32_t meeting(const int16_t* HWY_RESTRICT lo, const int16_t* HWY_RESTRICT hi, size_t stride,
                            const int16_t* HWY_RESTRICT lanes) {
  const D16 d;
  uint32_t bits = 0;
  for (size_t part = 0; part < GROUP; part += hn::Lanes(d)) {
    const auto zero = hn::Zero(d);
    auto acc = gaps<T0_ONLY>(lo, hi, stride, lanes + part, 0, 4);
    if (hn::AllTrue(d, hn::Gt(acc, zero))) continue;
    acc = hn::Max(acc, gaps<T0_ONLY>(lo, hi, stride, lanes + part, 4, 8));
    const auto separated = hn::Gt(acc, zero);
    uint8_t packed[8] = {0};
    hn::StoreMaskBits(d, separated, packed);
    uint32_t word;
    std::memcpy(&word, packed, 4);
    const uint32_t all = (1u << hn::Lanes(d)) - 1;
    bits |= (~word & all) << part;
  }
  return bits;
}

// The surviving lanes of one pair of groups, less those in `shared` where it is given: to o, which is returned moved
// on.
template <bool T0_ONLY>
HWY_INLINE uint32_t* testPair(const GroupsView& a, const GroupsView& b, uint32_t g, uint32_t h, bool same,
                              Diagonal diagonal, const uint16_t* HWY_RESTRICT shared, uint32_t* HWY_RESTRICT o) {
  const int16_t* HWY_RESTRICT sa = a.soa + size_t{g} * SOA_SIZE;
  const int16_t* HWY_RESTRICT sb = b.soa + size_t{h} * SOA_SIZE;
  const int16_t* HWY_RESTRICT bound_a = a.aos + size_t{g} * AOS_SIZE;
  const int16_t* HWY_RESTRICT bound_b = b.aos + size_t{h} * AOS_SIZE;
  uint32_t rows = same ? 0xffffu : meeting<T0_ONLY>(bound_b, bound_b + RECORD, 1, sa);
  if (rows == 0) return o;
  uint32_t cols = same ? 0xffffu : meeting<T0_ONLY>(bound_a, bound_a + RECORD, 1, sb);
  if (cols == 0) return o;
  // Broadcast the nodes of the side with fewer left.
  const bool by_rows = hwy::PopCount(rows) <= hwy::PopCount(cols);
  const int16_t* HWY_RESTRICT outer = by_rows ? sa : sb;
  const int16_t* HWY_RESTRICT inner = by_rows ? sb : sa;
  uint32_t outer_left = by_rows ? rows : cols;
  const uint32_t inner_mask = by_rows ? cols : rows;
  const uint32_t base_outer = (by_rows ? g : h) * GROUP, base_inner = (by_rows ? h : g) * GROUP;
  while (outer_left) {
    const uint32_t i = static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(outer_left));
    outer_left &= outer_left - 1;
    uint32_t mask = inner_mask;
    if (same && diagonal == Diagonal::UPPER_WITH_DIAGONAL) mask &= ~0u << i;
    if (same && diagonal == Diagonal::STRICT_UPPER) mask &= ~0u << (i + 1);
    if (shared && by_rows) mask &= ~uint32_t{shared[i]};
    if (mask == 0) continue;
    mask &= meeting<T0_ONLY>(outer + i, outer + RECORD * GROUP + i, GROUP, inner);
    while (mask) {
      const uint32_t j = static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(mask));
      mask &= mask - 1;
      if (shared && !by_rows && (shared[j] >> i & 1)) continue;
      o[by_rows ? 0 : 1] = base_outer + i;
      o[by_rows ? 1 : 0] = base_inner + j;
      o += 2;
    }
  }
  return o;
}

template <bool T0_ONLY>
size_t TestGroupPairs(const GroupsView& a, const GroupsView& b, const uint32_t* HWY_RESTRICT group_pairs, size_t count,
                      bool self, Diagonal diagonal, uint32_t* HWY_RESTRICT out, size_t capacity, size_t* consumed) {
  uint32_t* o = out;
  size_t p = 0;
  for (; p < count && static_cast<size_t>(o - out) + 2 * GROUP * GROUP <= 2 * capacity; ++p) {
    const uint32_t g = group_pairs[2 * p], h = group_pairs[2 * p + 1];
    if (p + 1 < count) {
      const int16_t* next_a = a.soa + size_t{group_pairs[2 * p + 2]} * SOA_SIZE;
      const int16_t* next_b = b.soa + size_t{group_pairs[2 * p + 3]} * SOA_SIZE;
      for (size_t line = 0; line < SOA_SIZE; line += 128) {
        hwy::Prefetch(next_a + line);
        hwy::Prefetch(next_b + line);
      }
    }
    o = testPair<T0_ONLY>(a, b, g, h, self && g == h, diagonal, nullptr, o);
  }
  *consumed = p;
  return static_cast<size_t>(o - out) / 2;
}

size_t TestGroupPairsBoth(const GroupsView& a, const GroupsView& b, const uint32_t* group_pairs, size_t count,
                          bool self, Diagonal diagonal, uint32_t* out, size_t capacity, size_t* consumed) {
  return TestGroupPairs<false>(a, b, group_pairs, count, self, diagonal, out, capacity, consumed);
}
size_t TestGroupPairsT0(const GroupsView& a, const GroupsView& b, const uint32_t* group_pairs, size_t count, bool self,
                        Diagonal diagonal, uint32_t* out, size_t capacity, size_t* consumed) {
  return TestGroupPairs<true>(a, b, group_pairs, count, self, diagonal, out, capacity, consumed);
}

bool SharedVertices(const uint32_t* HWY_RESTRICT fa, size_t a_arity, const uint32_t* HWY_RESTRICT fb, size_t b_arity,
                    uint16_t* HWY_RESTRICT shared) {
  const hn::CappedTag<uint32_t, GROUP> d;
  HWY_ALIGN uint32_t lanes[3 * GROUP];
  for (size_t j = 0; j < GROUP; ++j) {
    for (size_t y = 0; y < b_arity; ++y) lanes[y * GROUP + j] = fb[j * b_arity + y];
  }
  uint32_t any = 0;
  for (size_t i = 0; i < GROUP; ++i) {
    uint32_t row = 0;
    if (fa[i * a_arity] != UINT32_MAX) {
      for (size_t part = 0; part < GROUP; part += hn::Lanes(d)) {
        auto same = hn::Zero(d);
        for (size_t x = 0; x < a_arity; ++x) {
          const auto v = hn::Set(d, fa[i * a_arity + x]);
          for (size_t y = 0; y < b_arity; ++y) {
            same = hn::Or(same, hn::VecFromMask(d, hn::Eq(v, hn::Load(d, lanes + y * GROUP + part))));
          }
        }
        uint8_t packed[8] = {0};
        hn::StoreMaskBits(d, hn::Ne(same, hn::Zero(d)), packed);
        uint32_t word;
        std::memcpy(&word, packed, 4);
        row |= (word & ((1u << hn::Lanes(d)) - 1)) << part;
      }
    }
    shared[i] = static_cast<uint16_t>(row);
    any |= row;
  }
  return any != 0;
}

size_t TestLeafPair(const GroupsView& a, const GroupsView& b, uint32_t g, uint32_t h, bool self, const uint16_t* shared,
                    uint32_t* out) {
  const uint32_t* end = testPair<false>(a, b, g, h, self && g == h, Diagonal::STRICT_UPPER, shared, out);
  return static_cast<size_t>(end - out) / 2;
}

int16_t GapAtEnd(const GroupsView& a, const GroupsView& b, uint32_t g, uint32_t h, bool self, const uint16_t* shared,
                 const uint16_t* HWY_RESTRICT weights, int16_t target, uint8_t* HWY_RESTRICT near, size_t room,
                 size_t* found) {
  const D16 d;
  const hn::RebindToUnsigned<D16> du;
  // The half at t1 of the smallest values, then of the largest.
  const int16_t* HWY_RESTRICT sa = a.soa + size_t{g} * SOA_SIZE + 8 * GROUP;
  const int16_t* HWY_RESTRICT sb = b.soa + size_t{h} * SOA_SIZE + 8 * GROUP;
  const bool same = self && g == h;
  const auto zero = hn::Zero(d);
  size_t n = 0;
  auto smallest = hn::Set(d, EMPTY_LO);
  for (size_t i = 0; i < GROUP; ++i) {
    if (sa[i] == EMPTY_LO) continue;
    uint32_t wanted = shared ? ~uint32_t{shared[i]} & 0xffffu : 0xffffu;
    if (same) wanted &= ~0u << (i + 1);
    if ((wanted & 0xffffu) == 0) continue;
    for (size_t part = 0; part < GROUP; part += hn::Lanes(d)) {
      auto best = hn::Set(d, int16_t{-32767});
      for (size_t k = 0; k < DIRECTIONS; ++k) {
        const int16_t lo = sa[k * GROUP + i], hi = sa[RECORD * GROUP + k * GROUP + i];
        const auto above = hn::SaturatedSub(hn::Set(d, lo), hn::Load(d, sb + (RECORD + k) * GROUP + part));
        const auto below = hn::SaturatedSub(hn::Load(d, sb + k * GROUP + part), hn::Set(d, hi));
        // More than a unit less than the gap; negative ones say nothing and need not be right.
        const auto gap = hn::Max(hn::Sub(hn::Max(hn::Max(above, below), zero), hn::Set(d, int16_t{1})), zero);
        const auto scaled = hn::MulHigh(hn::BitCast(du, gap), hn::Set(du, weights[k]));
        best = hn::Max(best, hn::BitCast(d, scaled));
      }
      // Lanes that are not wanted, or empty, are as far as can be.
      HWY_ALIGN uint8_t bits[8] = {0};
      const uint32_t word = wanted >> part;
      std::memcpy(bits, &word, 4);
      const auto counts = hn::And(hn::LoadMaskBits(d, bits), hn::Ne(hn::Load(d, sb + part), hn::Set(d, EMPTY_LO)));
      best = hn::IfThenElse(counts, best, hn::Set(d, EMPTY_LO));
      const auto is_near = hn::Lt(best, hn::Set(d, target));
      if (!hn::AllFalse(d, is_near)) {
        uint8_t packed[8] = {0};
        hn::StoreMaskBits(d, is_near, packed);
        uint32_t mask;
        std::memcpy(&mask, packed, 4);
        mask &= (1u << hn::Lanes(d)) - 1;
        while (mask) {
          const uint32_t j = static_cast<uint32_t>(hwy::Num0BitsBelowLS1Bit_Nonzero32(mask));
          mask &= mask - 1;
          if (n < room) near[n] = static_cast<uint8_t>(i * GROUP + part + j);
          ++n;
        }
        best = hn::IfThenElse(is_near, hn::Set(d, EMPTY_LO), best);
      }
      smallest = hn::Min(smallest, best);
    }
  }
  *found = n;
  HWY_ALIGN int16_t lanes[GROUP];
  hn::Store(smallest, d, lanes);
  return *std::min_element(lanes, lanes + hn::Lanes(d));
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
HWY_EXPORT(BoundLeaves);
HWY_EXPORT(BuildUpper);
HWY_EXPORT(TestGroupPairsBoth);
HWY_EXPORT(TestGroupPairsT0);
HWY_EXPORT(SharedVertices);
HWY_EXPORT(TestLeafPair);
HWY_EXPORT(GapAtEnd);

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
void boundLeaves(const std::int16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 const std::int16_t* margin16, std::int16_t* aos) {
  HWY_DYNAMIC_DISPATCH(BoundLeaves)(records, indices, arity, count, margin16, aos);
}
void buildUpper(const std::int16_t* child_aos, std::size_t child_count, std::int16_t* soa, std::int16_t* aos) {
  HWY_DYNAMIC_DISPATCH(BuildUpper)(child_aos, child_count, soa, aos);
}
std::size_t testGroupPairs(const GroupsView& a, const GroupsView& b, const std::uint32_t* group_pairs,
                           std::size_t count, bool self, Diagonal diagonal, bool t0_only, std::uint32_t* out,
                           std::size_t capacity, std::size_t* consumed) {
  return t0_only
             ? HWY_DYNAMIC_DISPATCH(TestGroupPairsT0)(a, b, group_pairs, count, self, diagonal, out, capacity, consumed)
             : HWY_DYNAMIC_DISPATCH(TestGroupPairsBoth)(a, b, group_pairs, count, self, diagonal, out, capacity,
                                                        consumed);
}

bool sharedVertices(const std::uint32_t* indices_a, std::size_t a_arity, const std::uint32_t* indices_b,
                    std::size_t b_arity, std::uint16_t* shared) {
  return HWY_DYNAMIC_DISPATCH(SharedVertices)(indices_a, a_arity, indices_b, b_arity, shared);
}
std::size_t testLeafPair(const GroupsView& a, const GroupsView& b, std::uint32_t g, std::uint32_t h, bool self,
                         const std::uint16_t* shared, std::uint32_t* out) {
  return HWY_DYNAMIC_DISPATCH(TestLeafPair)(a, b, g, h, self, shared, out);
}
std::int16_t gapAtEnd(const GroupsView& a, const GroupsView& b, std::uint32_t g, std::uint32_t h, bool self,
                      const std::uint16_t* shared, const std::uint16_t* weights, std::int16_t target,
                      std::uint8_t* near, std::size_t room, std::size_t* found) {
  return HWY_DYNAMIC_DISPATCH(GapAtEnd)(a, b, g, h, self, shared, weights, target, near, room, found);
}

}  // namespace simd
}  // namespace dccd
#endif
