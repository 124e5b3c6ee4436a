#include "simd/fused_filter.h"

#include "dccd/tolerances.h"
#include "simd/targets.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/fused_filter.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using DF = hn::CappedTag<float, 16>;
using VF = hn::Vec<DF>;
constexpr size_t MAX_LANES = 16;
constexpr float LARGEST_M = tolerance::FUSED_LARGEST_M;

struct Vec3V {
  VF x, y, z;
};

HWY_INLINE Vec3V operator+(const Vec3V& a, const Vec3V& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE Vec3V operator-(const Vec3V& a, const Vec3V& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Vec3V cross(const Vec3V& a, const Vec3V& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE VF dot(const Vec3V& a, const Vec3V& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}

// A quadratic vector in Bernstein form: A and C are its values at t=0 and t=1, B is twice the middle coefficient. Only
// signs are asked of them, so the factor does no harm.
struct Quadratic {
  Vec3V A, B, C;
};
HWY_INLINE Quadratic cross(const Vec3V& a0, const Vec3V& a1, const Vec3V& b0, const Vec3V& b1) {
  return {cross(a0, b0), cross(a0, b1) + cross(a1, b0), cross(a1, b1)};
}

// What is asked of the coefficients of one scalar quadratic: are all above a positive bound, or all below a negative
// one? The smallest and the largest tell. With AVX-512 the bits of the numbers are compared as integers, which units of
// a processor do that do not multiply. What is above zero is in order as signed integers, above all else. What is below
// zero is so as unsigned ones, the lowest last. Nothing is NaN while M is at most 2^30: a plane's normal is then at
// most 6 M, and nothing overflows.
#if DCCD_AVX512
using DS = hn::RebindToSigned<DF>;
using DU = hn::RebindToUnsigned<DF>;
struct Range {
  hn::Vec<DS> lo;
  hn::Vec<DU> hi;
};
HWY_INLINE Range rangeOf(VF a, VF b, VF c) {
  const DS s;
  const DU u;
  return {hn::Min(hn::Min(hn::BitCast(s, a), hn::BitCast(s, b)), hn::BitCast(s, c)),
          hn::Min(hn::Min(hn::BitCast(u, a), hn::BitCast(u, b)), hn::BitCast(u, c))};
}
HWY_INLINE Range negative(const Range& r) {
  const auto sign = hn::Set(DU(), 0x80000000u);
  return {hn::BitCast(DS(), hn::Xor(r.hi, sign)), hn::Xor(hn::BitCast(DU(), r.lo), sign)};
}
HWY_INLINE hn::Mask<DF> isAbove(const Range& r, VF bound) {
  return hn::RebindMask(DF(), hn::Gt(r.lo, hn::BitCast(DS(), bound)));
}
HWY_INLINE hn::Mask<DF> isBelow(const Range& r, VF bound) {
  return hn::RebindMask(DF(), hn::Gt(r.hi, hn::BitCast(DU(), bound)));
}
#else
struct Range {
  VF lo, hi;
};
HWY_INLINE Range rangeOf(VF a, VF b, VF c) { return {hn::Min(hn::Min(a, b), c), hn::Max(hn::Max(a, b), c)}; }
HWY_INLINE Range negative(const Range& r) { return {hn::Neg(r.hi), hn::Neg(r.lo)}; }
HWY_INLINE hn::Mask<DF> isAbove(const Range& r, VF bound) { return hn::Gt(r.lo, bound); }
HWY_INLINE hn::Mask<DF> isBelow(const Range& r, VF bound) { return hn::Lt(r.hi, bound); }
#endif

// Largest lower end and smallest upper end over the four quantities: opposite strict signs when both are beyond the
// margin. (As unsigned integers, the largest number is the lowest one.)
struct Opposite {
  Range ends;
  HWY_INLINE void add(const Range& r) {
    ends.lo = hn::Max(ends.lo, r.lo);
    ends.hi = DCCD_AVX512 ? hn::Max(ends.hi, r.hi) : hn::Min(ends.hi, r.hi);
  }
};

// component: of a vector, what is asked of the three coefficients of a quantity.
template <bool EDGE_EDGE, class Component>
HWY_INLINE hn::Mask<DF> opposite(const Quadratic& bc, const Quadratic& ca, const Quadratic& ab,
                                 const Component& component, VF margin) {
  const auto of = [&](const Quadratic& q) { return Vec3V{component(q.A), component(q.B), component(q.C)}; };
  const auto range = [](const Vec3V& q) { return rangeOf(q.x, q.y, q.z); };
  const Vec3V first = of(bc), second = of(ca), third = of(ab);
  Opposite o{range(first)};
  o.add(range(second));
  const Range r = range(third);
  o.add(EDGE_EDGE ? negative(r) : r);
  o.add(range(first + second + third));
  return hn::And(isAbove(o.ends, margin), isBelow(o.ends, hn::Neg(margin)));
}

// The six vectors of a block of pairs, four values a lane (the fourth is 0).
constexpr size_t BLOCK_SIZE = 6 * 4 * MAX_LANES;

// Differences of one pair to its origin point, rounded once in double and once to float. A block is laid out as
// [time][point][lane][4]; with AVX-512, where one vector holds both times, as [point][lane][time][4], each lane of the
// first half beside the one eight further on.
template <bool EDGE_EDGE>
HWY_INLINE void gather(const double* HWY_RESTRICT vertices, const uint32_t* HWY_RESTRICT quad, size_t lane,
                       float* HWY_RESTRICT block) {
  const hn::CappedTag<double, DCCD_AVX512 ? 8 : 4> dd;
  const hn::Rebind<float, decltype(dd)> df;
  const double* o = vertices + size_t{quad[EDGE_EDGE ? 3 : 0]} * 8;
  for (size_t k = 0; k < 8; k += hn::Lanes(dd)) {
    const auto origin = hn::Load(dd, o + k);
    for (size_t i = 0; i < 3; ++i) {
      const double* v = vertices + size_t{quad[EDGE_EDGE ? i : i + 1]} * 8;
      float* to = DCCD_AVX512 ? block + (i * MAX_LANES + lane % 8 * 2 + lane / 8) * 8
                              : block + ((k / 4 * 3 + i) * MAX_LANES + lane) * 4 + k % 4;
      hn::StoreU(hn::DemoteTo(df, hn::Sub(hn::Load(dd, v + k), origin)), df, to);
    }
  }
}

// Of point i, at t0 and t1.
HWY_INLINE void loadPoint(const float* HWY_RESTRICT block, size_t i, Vec3V& p0, Vec3V& p1) {
  const DF d;
#if DCCD_AVX512
  const hn::RepartitionToWide<DF> two;  // a pair of lanes moves as one number
  VF xy[4], z[4];                       // of two lanes each
  for (size_t k = 0; k < 4; ++k) {
    const VF one = hn::Load(d, block + (i * 8 + 2 * k) * MAX_LANES);
    const VF other = hn::Load(d, block + (i * 8 + 2 * k + 1) * MAX_LANES);
    xy[k] = hn::InterleaveLower(d, one, other);
    z[k] = hn::InterleaveUpper(d, one, other);
  }
  // A coordinate, four lanes a block of 128 bits: at t0, at t1, and both of the lanes eight further on.
  const auto split = [d](VF first, VF second, VF& at_t0, VF& at_t1) HWY_ATTR {
    at_t0 = hn::OddEvenBlocks(hn::SwapAdjacentBlocks(second), first);
    at_t1 = hn::OddEvenBlocks(second, hn::SwapAdjacentBlocks(first));
  };
  const auto lower = [&](const VF* v) HWY_ATTR {
    return hn::BitCast(d, hn::InterleaveLower(two, hn::BitCast(two, v[0]), hn::BitCast(two, v[1])));
  };
  const auto upper = [&](const VF* v) HWY_ATTR {
    return hn::BitCast(d, hn::InterleaveUpper(two, hn::BitCast(two, v[0]), hn::BitCast(two, v[1])));
  };
  split(lower(xy), lower(xy + 2), p0.x, p1.x);
  split(upper(xy), upper(xy + 2), p0.y, p1.y);
  split(lower(z), lower(z + 2), p0.z, p1.z);
#else
  VF unused;
  hn::LoadInterleaved4(d, block + i * 4 * MAX_LANES, p0.x, p0.y, p0.z, unused);
  hn::LoadInterleaved4(d, block + (3 + i) * 4 * MAX_LANES, p1.x, p1.y, p1.z, unused);
#endif
}

// Motion of the first feature's centre relative to the other's, times a constant; a, b, c are relative to the origin.
template <bool EDGE_EDGE>
HWY_INLINE Vec3V relativeMotion(const Vec3V* p0, const Vec3V* p1) {
  const auto centre = [](const Vec3V* p) {
    const Vec3V ab = p[0] + p[1];
    return EDGE_EDGE ? ab - p[2] : ab + p[2];
  };
  return centre(p1) - centre(p0);
}

template <bool EDGE_EDGE>
HWY_INLINE hn::Mask<DF> rejected(const float* HWY_RESTRICT block, FusedPlanes planes) {
  const DF d;
  Vec3V p[2][3];
  VF M = hn::Zero(d);
  for (size_t i = 0; i < 3; ++i) {
    loadPoint(block, i, p[0][i], p[1][i]);
    for (size_t t = 0; t < 2; ++t) {
      M = hn::Max(M, hn::Max(hn::Max(hn::Abs(p[t][i].x), hn::Abs(p[t][i].y)), hn::Abs(p[t][i].z)));
    }
  }
  const VF tiny = hn::Set(d, tolerance::FUSED_UNDERFLOW), M_sq = hn::Mul(M, M);
  const VF margin = hn::Add(hn::Mul(hn::Set(d, tolerance::FUSED_PLANAR), M_sq), tiny);

  const Quadratic bc = cross(p[0][1], p[1][1], p[0][2], p[1][2]);
  const Quadratic ca = cross(p[0][2], p[1][2], p[0][0], p[1][0]);
  const Quadratic ab = cross(p[0][0], p[1][0], p[0][1], p[1][1]);

  // Non-penetration.
  const VF f0 = dot(p[0][0], bc.A);
  const VF f1 = hn::Add(dot(p[1][0], bc.A), dot(p[0][0], bc.B));
  const VF f2 = hn::Add(dot(p[1][0], bc.B), dot(p[0][0], bc.C));
  const VF f3 = dot(p[1][0], bc.C);
  const VF cubic_margin = hn::Add(hn::Mul(hn::Mul(hn::Set(d, tolerance::FUSED_CUBIC), M_sq), M), tiny);
  const VF f_lo = hn::Min(hn::Min(f0, f1), hn::Min(f2, f3)), f_hi = hn::Max(hn::Max(f0, f1), hn::Max(f2, f3));
  auto out = hn::Or(hn::Gt(f_lo, cubic_margin), hn::Lt(f_hi, hn::Neg(cubic_margin)));

  out = hn::Or(out, opposite<EDGE_EDGE>(
                        bc, ca, ab, [](const Vec3V& v) { return v.x; }, margin));
  out = hn::Or(out, opposite<EDGE_EDGE>(
                        bc, ca, ab, [](const Vec3V& v) { return v.y; }, margin));
  out = hn::Or(out, opposite<EDGE_EDGE>(
                        bc, ca, ab, [](const Vec3V& v) { return v.z; }, margin));
  if (planes != FusedPlanes::COORDINATE) {
    const Vec3V n = relativeMotion<EDGE_EDGE>(p[0], p[1]);
    const VF size = hn::Add(hn::Add(hn::Abs(n.x), hn::Abs(n.y)), hn::Abs(n.z));
    const auto along = [&](const Vec3V& v) { return dot(n, v); };
    out = hn::Or(out, opposite<EDGE_EDGE>(bc, ca, ab, along, hn::Add(hn::Mul(margin, size), tiny)));
  }
  if (planes == FusedPlanes::ALL && !hn::AllTrue(d, out)) {
    const VF two = hn::Mul(hn::Set(d, 2.0f), margin), three = hn::Mul(hn::Set(d, 3.0f), margin);
    const auto plus = [](VF a, VF b) { return hn::Add(a, b); };
    const auto minus = [](VF a, VF b) { return hn::Sub(a, b); };
    // Normals of the paper's planes Z|X+Y, X-Y|Z, Y+Z|X+Z, X+Y|Y-Z, Y-Z|X-Y (Fig. 8), up to sign.
    out = hn::Or(out, opposite<EDGE_EDGE>(
                          bc, ca, ab, [&](const Vec3V& v) { return minus(v.x, v.y); }, two));
    out = hn::Or(out, opposite<EDGE_EDGE>(
                          bc, ca, ab, [&](const Vec3V& v) { return plus(v.x, v.y); }, two));
    out = hn::Or(out, opposite<EDGE_EDGE>(
                          bc, ca, ab, [&](const Vec3V& v) { return minus(plus(v.x, v.y), v.z); }, three));
    out = hn::Or(out, opposite<EDGE_EDGE>(
                          bc, ca, ab, [&](const Vec3V& v) { return plus(minus(v.y, v.x), v.z); }, three));
    out = hn::Or(out, opposite<EDGE_EDGE>(
                          bc, ca, ab, [&](const Vec3V& v) { return plus(plus(v.x, v.y), v.z); }, three));
  }
  return hn::And(out, hn::Le(M, hn::Set(d, LARGEST_M)));
}

// Writes the numbers of the lanes that are not rejected, from `first` on. Returns how many there are.
HWY_INLINE size_t writeKept(hn::Mask<DF> rejected, size_t first, size_t count, uint32_t* HWY_RESTRICT kept) {
  const DF d;
#if DCCD_AVX512
  const hn::RebindToUnsigned<DF> du;
  if (count == hn::Lanes(d)) {
    HWY_ALIGN static constexpr uint32_t LANES[MAX_LANES] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
    const auto lanes = hn::Add(hn::Load(du, LANES), hn::Set(du, static_cast<uint32_t>(first)));
    const auto left = hn::RebindMask(du, hn::Not(rejected));
    // A whole vector is stored. It fits: no more pairs were kept than lie before `first`.
    hn::StoreU(hn::Compress(lanes, left), du, kept);  // CompressStore() takes many times as long on some processors
    return hn::CountTrue(du, left);
  }
#endif
  uint8_t bits[8] = {0};
  hn::StoreMaskBits(d, rejected, bits);
  size_t out = 0;
  for (size_t lane = 0; lane < count; ++lane) {
    kept[out] = static_cast<uint32_t>(first + lane);
    out += 1 - ((bits[lane / 8] >> (lane % 8)) & 1);
  }
  return out;
}

template <bool EDGE_EDGE>
HWY_INLINE size_t filterAll(const double* HWY_RESTRICT vertices, const uint32_t* HWY_RESTRICT quads, size_t count,
                            FusedPlanes planes, uint32_t* HWY_RESTRICT kept) {
  const size_t lanes = hn::Lanes(DF());
  HWY_ALIGN_MAX float blocks[2][BLOCK_SIZE] = {};
  const auto fill = [&](size_t first, float* HWY_RESTRICT block) HWY_ATTR {
    const size_t n = first >= count ? 0 : HWY_MIN(lanes, count - first);
    for (size_t lane = 0; lane < n; ++lane) gather<EDGE_EDGE>(vertices, quads + 4 * (first + lane), lane, block);
    return n;
  };
  // The next block is filled before this one is tested: a block is read in larger pieces than it was written in, and
  // such a load waits until the stores have reached the cache.
  size_t out = 0, now = 0;
  for (size_t first = 0, n = fill(0, blocks[0]); n > 0; first += lanes, now = 1 - now) {
    const size_t next = fill(first + lanes, blocks[1 - now]);
    out += writeKept(rejected<EDGE_EDGE>(blocks[now], planes), first, n, kept + out);
    n = next;
  }
  return out;
}

size_t FusedFilterVf(const double* vertices, const uint32_t* quads, size_t count, FusedPlanes planes, uint32_t* kept) {
  return filterAll<false>(vertices, quads, count, planes, kept);
}
size_t FusedFilterEe(const double* vertices, const uint32_t* quads, size_t count, FusedPlanes planes, uint32_t* kept) {
  return filterAll<true>(vertices, quads, count, planes, kept);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {
HWY_EXPORT(FusedFilterVf);
HWY_EXPORT(FusedFilterEe);
std::size_t fusedFilter(const double* vertices, const std::uint32_t* quads, std::size_t count, bool edge_edge,
                        FusedPlanes planes, std::uint32_t* kept) {
  return edge_edge ? HWY_DYNAMIC_DISPATCH(FusedFilterEe)(vertices, quads, count, planes, kept)
                   : HWY_DYNAMIC_DISPATCH(FusedFilterVf)(vertices, quads, count, planes, kept);
}
}  // namespace simd
}  // namespace dccd
#endif
