#include "paper/simd/paper_filters.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "paper/simd/paper_filters.cpp"
#include <hwy/cache_control.h>
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// 8 lanes where the target has them, else 4 (twice), else 1 (eight times): the same operations per lane everywhere.
using D = hn::CappedTag<float, 8>;
using V = hn::Vec<D>;

constexpr size_t DIRECTIONS = 8;
constexpr size_t RECORD = 16;
// Pairs lie in memory in the order of the hierarchy, their records do not: fetch ahead of use. Twelve pairs are about
// one hundred cycles of the linear filter, a miss in the second level costs about as much.
constexpr size_t PREFETCH_AHEAD = 12;

HWY_INLINE void prefetchRecords(const float* HWY_RESTRICT records, const uint32_t* pairs, size_t i, size_t count) {
  if (i + PREFETCH_AHEAD >= count) return;
  const uint32_t* ahead = pairs + 4 * (i + PREFETCH_AHEAD);
  for (int k = 0; k < 4; ++k) hwy::Prefetch(records + RECORD * ahead[k]);
}

// Keeps the pairs for which `separated` is false. Written without a branch on the outcome, which is unpredictable.
template <class Separated>
HWY_INLINE size_t keepPairs(const float* HWY_RESTRICT records, const uint32_t* pairs, size_t count, uint32_t* survivors,
                            const Separated& separated) {
  size_t kept = 0;
  for (size_t i = 0; i < count; ++i) {
    prefetchRecords(records, pairs, i, count);
    const uint32_t v0 = pairs[4 * i], v1 = pairs[4 * i + 1], v2 = pairs[4 * i + 2], v3 = pairs[4 * i + 3];
    const bool reject =
        separated(records + RECORD * v0, records + RECORD * v1, records + RECORD * v2, records + RECORD * v3);
    uint32_t* out = survivors + 4 * kept;  // kept <= i, so writing in place never overtakes the reading
    out[0] = v0;
    out[1] = v1;
    out[2] = v2;
    out[3] = v3;
    kept += reject ? 0 : 1;
  }
  return kept;
}

// --- linear filter (paper, Section 4) and primitive bounding volumes
// --------------------------------------------------

template <bool VF>
HWY_INLINE void sideBounds(const D d, const float* p0, const float* p1, const float* p2, const float* p3, V& first_lo,
                           V& first_hi, V& second_lo, V& second_hi) {
  const V x0 = hn::Load(d, p0), x1 = hn::Load(d, p1), x2 = hn::Load(d, p2), x3 = hn::Load(d, p3);
  second_lo = hn::Min(x2, x3);
  second_hi = hn::Max(x2, x3);
  if (VF) {
    first_lo = first_hi = x0;
    second_lo = hn::Min(second_lo, x1);
    second_hi = hn::Max(second_hi, x1);
  } else {
    first_lo = hn::Min(x0, x1);
    first_hi = hn::Max(x0, x1);
  }
}

// Strictly on one side of each other at t=0, and on the same side at t=1, in some direction.
template <bool VF>
HWY_INLINE bool linearSeparated(const float* p0, const float* p1, const float* p2, const float* p3) {
  const D d;
  bool separated = false;
  for (size_t k = 0; k < DIRECTIONS; k += hn::Lanes(d)) {
    V a_lo, a_hi, b_lo, b_hi;
    sideBounds<VF>(d, p0 + k, p1 + k, p2 + k, p3 + k, a_lo, a_hi, b_lo, b_hi);
    const auto below_t0 = hn::Lt(a_hi, b_lo);
    const auto above_t0 = hn::Gt(a_lo, b_hi);
    sideBounds<VF>(d, p0 + k + 8, p1 + k + 8, p2 + k + 8, p3 + k + 8, a_lo, a_hi, b_lo, b_hi);
    const auto below = hn::And(below_t0, hn::Lt(a_hi, b_lo));
    const auto above = hn::And(above_t0, hn::Gt(a_lo, b_hi));
    separated |= !hn::AllFalse(d, hn::Or(below, above));
  }
  return separated;
}

// The swept 16-DOPs of the two features are disjoint: the whole of both trajectories counts.
template <bool VF>
HWY_INLINE bool boundsSeparated(const float* p0, const float* p1, const float* p2, const float* p3) {
  const D d;
  bool separated = false;
  for (size_t k = 0; k < DIRECTIONS; k += hn::Lanes(d)) {
    V a_lo0, a_hi0, b_lo0, b_hi0, a_lo1, a_hi1, b_lo1, b_hi1;
    sideBounds<VF>(d, p0 + k, p1 + k, p2 + k, p3 + k, a_lo0, a_hi0, b_lo0, b_hi0);
    sideBounds<VF>(d, p0 + k + 8, p1 + k + 8, p2 + k + 8, p3 + k + 8, a_lo1, a_hi1, b_lo1, b_hi1);
    const auto below = hn::Lt(hn::Max(a_hi0, a_hi1), hn::Min(b_lo0, b_lo1));
    const auto above = hn::Gt(hn::Min(a_lo0, a_lo1), hn::Max(b_hi0, b_hi1));
    separated |= !hn::AllFalse(d, hn::Or(below, above));
  }
  return separated;
}

size_t LinearVf(const float* records, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return linearSeparated<true>(a, b, c, e); });
}
size_t LinearEe(const float* records, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return linearSeparated<false>(a, b, c, e); });
}
size_t PrimitiveBvVf(const float* records, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return boundsSeparated<true>(a, b, c, e); });
}
size_t PrimitiveBvEe(const float* records, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return boundsSeparated<false>(a, b, c, e); });
}

// --- planar filter (paper, Section 5)
// ---------------------------------------------------------------------------------

// The lanes rotated by one within each half of four: the second coordinates of the planes. `p` is the record at `lane`.
HWY_INLINE V rotatedDifference(const D d, const V difference, const float* p, const float* origin, size_t lane) {
#if HWY_TARGET == HWY_SCALAR
  (void)difference;
  const size_t next = (lane & 4) | ((lane + 1) & 3);
  return hn::Sub(hn::Load(d, p - lane + next), hn::Load(d, origin - lane + next));
#else
  (void)d;
  (void)p;
  (void)origin;
  (void)lane;
  return hn::Shuffle0321(difference);
#endif
}

// Bernstein coefficients of a quadratic (the middle one doubled, which leaves its sign).
struct Quadratic {
  V c0, c1, c2;
};

// A point relative to the pair's last-named origin, in the plane, at both ends of the step.
struct PlanePoint {
  V x0, y0, x1, y1;
};

HWY_INLINE PlanePoint relative(const D d, const float* p, const float* origin, size_t lane) {
  PlanePoint r;
  r.x0 = hn::Sub(hn::Load(d, p), hn::Load(d, origin));
  r.x1 = hn::Sub(hn::Load(d, p + 8), hn::Load(d, origin + 8));
  r.y0 = rotatedDifference(d, r.x0, p, origin, lane);
  r.y1 = rotatedDifference(d, r.x1, p + 8, origin + 8, lane);
  return r;
}

HWY_INLINE V largest(const PlanePoint& p) {
  return hn::Max(hn::Max(hn::Abs(p.x0), hn::Abs(p.y0)), hn::Max(hn::Abs(p.x1), hn::Abs(p.y1)));
}

// No MulAdd: its rounding differs between targets, and the survivors must not.
HWY_INLINE Quadratic cross(const PlanePoint& p, const PlanePoint& q) {
  Quadratic r;
  r.c0 = hn::Sub(hn::Mul(p.x0, q.y0), hn::Mul(p.y0, q.x0));
  r.c1 = hn::Add(hn::Sub(hn::Mul(p.x0, q.y1), hn::Mul(p.y0, q.x1)), hn::Sub(hn::Mul(p.x1, q.y0), hn::Mul(p.y1, q.x0)));
  r.c2 = hn::Sub(hn::Mul(p.x1, q.y1), hn::Mul(p.y1, q.x1));
  return r;
}

HWY_INLINE Quadratic sum(const Quadratic& a, const Quadratic& b, const Quadratic& c) {
  return {hn::Add(hn::Add(a.c0, b.c0), c.c0), hn::Add(hn::Add(a.c1, b.c1), c.c1), hn::Add(hn::Add(a.c2, b.c2), c.c2)};
}

HWY_INLINE V smallestCoefficient(const Quadratic& q) { return hn::Min(q.c0, hn::Min(q.c1, q.c2)); }
HWY_INLINE V largestCoefficient(const Quadratic& q) { return hn::Max(q.c0, hn::Max(q.c1, q.c2)); }

struct Quadratics {
  Quadratic bc, ca, ab, total;
  V margin;
};

// a, b, c relative to the origin o, one plane a lane.
HWY_INLINE Quadratics quadratics(const D d, const float* a, const float* b, const float* c, const float* o, size_t k,
                                 float error) {
  const PlanePoint pa = relative(d, a + k, o + k, k);
  const PlanePoint pb = relative(d, b + k, o + k, k);
  const PlanePoint pc = relative(d, c + k, o + k, k);
  const V m = hn::Max(largest(pa), hn::Max(largest(pb), largest(pc)));
  const V e = hn::Add(hn::Set(d, 2 * error), hn::Mul(m, hn::Set(d, 0x1p-22f)));
  Quadratics q;
  q.margin = hn::Mul(hn::Mul(hn::Set(d, 32.0f), e), hn::Add(m, e));
  q.bc = cross(pb, pc);
  q.ca = cross(pc, pa);
  q.ab = cross(pa, pb);
  q.total = sum(q.bc, q.ca, q.ab);
  return q;
}

template <bool VF>
HWY_INLINE bool branchFreeSeparated(const float* p0, const float* p1, const float* p2, const float* p3, float error) {
  const D d;
  bool separated = false;
  for (size_t k = 0; k < DIRECTIONS; k += hn::Lanes(d)) {
    // VF: the vertex is the origin of its face; EE: the second edge's second end.
    const Quadratics q = VF ? quadratics(d, p1, p2, p3, p0, k, error) : quadratics(d, p0, p1, p2, p3, k, error);
    const V minus_margin = hn::Neg(q.margin);
    const V ab_lo = smallestCoefficient(q.ab), ab_hi = largestCoefficient(q.ab);
    const V lo = hn::Max(hn::Max(smallestCoefficient(q.bc), smallestCoefficient(q.ca)),
                         hn::Max(smallestCoefficient(q.total), VF ? ab_lo : hn::Neg(ab_hi)));
    const V hi = hn::Min(hn::Min(largestCoefficient(q.bc), largestCoefficient(q.ca)),
                         hn::Min(largestCoefficient(q.total), VF ? ab_hi : hn::Neg(ab_lo)));
    separated |= !hn::AllFalse(d, hn::And(hn::Gt(lo, q.margin), hn::Lt(hi, minus_margin)));
  }
  return separated;
}

using M = hn::Mask<D>;

HWY_INLINE M strictlyPositive(const Quadratic& q, V margin) { return hn::Gt(smallestCoefficient(q), margin); }
HWY_INLINE M strictlyNegative(const Quadratic& q, V margin) { return hn::Lt(largestCoefficient(q), hn::Neg(margin)); }

// Algorithm 1. The cutting edge is the first of ab, bc, ca that has the vertex on its outer side at t=0.
HWY_INLINE M algorithm1(const D d, const Quadratics& q) {
  const V zero = hn::Zero(d);
  const auto select = [&](M at_ab, M at_bc, M at_ca, M ab, M bc, M ca) HWY_ATTR {
    const M after_ab = hn::And(hn::Not(at_ab), hn::Or(hn::And(at_bc, bc), hn::AndNot(at_bc, hn::And(at_ca, ca))));
    return hn::Or(hn::And(at_ab, ab), after_ab);
  };
  const M if_positive =
      select(hn::Lt(q.ab.c0, zero), hn::Lt(q.bc.c0, zero), hn::Lt(q.ca.c0, zero), strictlyNegative(q.ab, q.margin),
             strictlyNegative(q.bc, q.margin), strictlyNegative(q.ca, q.margin));
  const M if_negative =
      select(hn::Gt(q.ab.c0, zero), hn::Gt(q.bc.c0, zero), hn::Gt(q.ca.c0, zero), strictlyPositive(q.ab, q.margin),
             strictlyPositive(q.bc, q.margin), strictlyPositive(q.ca, q.margin));
  return hn::Or(hn::And(strictlyPositive(q.total, q.margin), if_positive),
                hn::And(strictlyNegative(q.total, q.margin), if_negative));
}

// Algorithm 2. c and d lie on the sides given by `total` and ab of the line ab, a and b on those given by -ca and bc of
// the line cd. The first edge whose line has the other's ends on one side at t=0 decides.
HWY_INLINE M algorithm2(const D d, const Quadratics& q) {
  const V zero = hn::Zero(d);
  const M first = hn::Or(hn::And(hn::Gt(q.ab.c0, zero), hn::Gt(q.total.c0, zero)),
                         hn::And(hn::Lt(q.ab.c0, zero), hn::Lt(q.total.c0, zero)));
  const M separated_first = hn::Or(hn::And(strictlyPositive(q.ab, q.margin), strictlyPositive(q.total, q.margin)),
                                   hn::And(strictlyNegative(q.ab, q.margin), strictlyNegative(q.total, q.margin)));
  const M separated_second = hn::Or(hn::And(strictlyPositive(q.bc, q.margin), strictlyNegative(q.ca, q.margin)),
                                    hn::And(strictlyNegative(q.bc, q.margin), strictlyPositive(q.ca, q.margin)));
  return hn::Or(hn::And(first, separated_first), hn::AndNot(first, separated_second));
}

template <bool VF>
HWY_INLINE bool paperFormSeparated(const float* p0, const float* p1, const float* p2, const float* p3, float error) {
  const D d;
  bool separated = false;
  for (size_t k = 0; k < DIRECTIONS; k += hn::Lanes(d)) {
    const Quadratics q = VF ? quadratics(d, p1, p2, p3, p0, k, error) : quadratics(d, p0, p1, p2, p3, k, error);
    separated |= !hn::AllFalse(d, VF ? algorithm1(d, q) : algorithm2(d, q));
  }
  return separated;
}

size_t PaperPlanarVf(const float* records, float error, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [error](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return paperFormSeparated<true>(a, b, c, e, error); });
}
size_t PaperPlanarEe(const float* records, float error, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [error](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return paperFormSeparated<false>(a, b, c, e, error); });
}
size_t BranchFreePlanarVf(const float* records, float error, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [error](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return branchFreeSeparated<true>(a, b, c, e, error); });
}
size_t BranchFreePlanarEe(const float* records, float error, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return keepPairs(records, pairs, count, survivors,
                   [error](const float* a, const float* b, const float* c, const float* e)
                       HWY_ATTR { return branchFreeSeparated<false>(a, b, c, e, error); });
}

// --- non-penetration filter, batched
// ----------------------------------------------------------------------------------

constexpr size_t BATCH = 8;
// Lanes of x, y, z at t=0, then at t=1.
constexpr size_t AXIS_LANE[6] = {0, 1, 4, 8, 9, 12};

struct Vector3 {
  V x, y, z;
};

HWY_INLINE Vector3 difference(const D d, const float* p, const float* q, size_t lane) {
  return {hn::Sub(hn::Load(d, p + lane), hn::Load(d, q + lane)),
          hn::Sub(hn::Load(d, p + BATCH + lane), hn::Load(d, q + BATCH + lane)),
          hn::Sub(hn::Load(d, p + 2 * BATCH + lane), hn::Load(d, q + 2 * BATCH + lane))};
}
HWY_INLINE Vector3 cross3(const Vector3& a, const Vector3& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE Vector3 add3(const Vector3& a, const Vector3& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE V dot3(const Vector3& a, const Vector3& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE V largest3(const Vector3& a) { return hn::Max(hn::Abs(a.x), hn::Max(hn::Abs(a.y), hn::Abs(a.z))); }

// soa: point p, value j of AXIS_LANE, pair l at ((p * 6) + j) * BATCH + l. Sets keep[l] for every pair.
template <bool VF>
HWY_INLINE void nonPenetrationBatch(const float* soa, float error, float* keep) {
  const D d;
  constexpr size_t POINT = 6 * BATCH, TIME = 3 * BATCH;
  const float *p0 = soa, *p1 = soa + POINT, *p2 = soa + 2 * POINT, *p3 = soa + 3 * POINT;
  for (size_t l = 0; l < BATCH; l += hn::Lanes(d)) {
    // VF: (f1-f0) x (f2-f0) . (v-f0). EE: (ea1-ea0) x (eb1-eb0) . (eb0-ea0).
    const Vector3 u0 = VF ? difference(d, p2, p1, l) : difference(d, p1, p0, l);
    const Vector3 u1 = VF ? difference(d, p2 + TIME, p1 + TIME, l) : difference(d, p1 + TIME, p0 + TIME, l);
    const Vector3 v0 = VF ? difference(d, p3, p1, l) : difference(d, p3, p2, l);
    const Vector3 v1 = VF ? difference(d, p3 + TIME, p1 + TIME, l) : difference(d, p3 + TIME, p2 + TIME, l);
    const Vector3 w0 = VF ? difference(d, p0, p1, l) : difference(d, p2, p0, l);
    const Vector3 w1 = VF ? difference(d, p0 + TIME, p1 + TIME, l) : difference(d, p2 + TIME, p0 + TIME, l);
    const Vector3 n00 = cross3(u0, v0), n11 = cross3(u1, v1);
    const Vector3 n01 = add3(cross3(u0, v1), cross3(u1, v0));
    const V b0 = dot3(n00, w0), b3 = dot3(n11, w1);
    const V b1 = hn::Add(dot3(n00, w1), dot3(n01, w0));
    const V b2 = hn::Add(dot3(n01, w1), dot3(n11, w0));
    const V m = hn::Max(hn::Max(hn::Max(largest3(u0), largest3(u1)), hn::Max(largest3(v0), largest3(v1))),
                        hn::Max(largest3(w0), largest3(w1)));
    const V e = hn::Add(hn::Set(d, 2 * error), hn::Mul(m, hn::Set(d, 0x1p-23f)));
    const V me = hn::Add(m, e);
    const V margin = hn::Mul(hn::Mul(hn::Mul(hn::Set(d, 128.0f), e), me), me);
    const auto positive = hn::Gt(hn::Min(hn::Min(b0, b1), hn::Min(b2, b3)), margin);
    const auto negative = hn::Lt(hn::Max(hn::Max(b0, b1), hn::Max(b2, b3)), hn::Neg(margin));
    hn::Store(hn::IfThenZeroElse(hn::Or(positive, negative), hn::Set(d, 1.0f)), d, keep + l);
  }
}

template <bool VF>
HWY_INLINE size_t nonPenetration(const float* HWY_RESTRICT records, float error, const uint32_t* pairs, size_t count,
                                 uint32_t* survivors) {
  HWY_ALIGN float soa[24 * BATCH] = {};
  HWY_ALIGN float keep[BATCH];
  size_t kept = 0;
  for (size_t begin = 0; begin < count; begin += BATCH) {
    const size_t n = count - begin < BATCH ? count - begin : BATCH;
    for (size_t l = 0; l < n; ++l) {
      prefetchRecords(records, pairs, begin + l, count);
      const uint32_t* pair = pairs + 4 * (begin + l);
      for (size_t p = 0; p < 4; ++p) {
        const float* record = records + RECORD * pair[p];
        for (size_t j = 0; j < 6; ++j) soa[(p * 6 + j) * BATCH + l] = record[AXIS_LANE[j]];
      }
    }
    nonPenetrationBatch<VF>(soa, error, keep);
    for (size_t l = 0; l < n; ++l) {
      const uint32_t* pair = pairs + 4 * (begin + l);
      const uint32_t v0 = pair[0], v1 = pair[1], v2 = pair[2], v3 = pair[3];
      uint32_t* out = survivors + 4 * kept;
      out[0] = v0;
      out[1] = v1;
      out[2] = v2;
      out[3] = v3;
      kept += keep[l] != 0.0f ? 1 : 0;
    }
  }
  return kept;
}

size_t NonPenetrationVf(const float* records, float error, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return nonPenetration<true>(records, error, pairs, count, survivors);
}
size_t NonPenetrationEe(const float* records, float error, const uint32_t* pairs, size_t count, uint32_t* survivors) {
  return nonPenetration<false>(records, error, pairs, count, survivors);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {

HWY_EXPORT(LinearVf);
HWY_EXPORT(LinearEe);
HWY_EXPORT(PrimitiveBvVf);
HWY_EXPORT(PrimitiveBvEe);
HWY_EXPORT(PaperPlanarVf);
HWY_EXPORT(PaperPlanarEe);
HWY_EXPORT(BranchFreePlanarVf);
HWY_EXPORT(BranchFreePlanarEe);
HWY_EXPORT(NonPenetrationVf);
HWY_EXPORT(NonPenetrationEe);

std::size_t paperLinearVf(const float* records, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(LinearVf)(records, pairs, count, survivors);
}
std::size_t paperLinearEe(const float* records, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(LinearEe)(records, pairs, count, survivors);
}
std::size_t paperPrimitiveBvVf(const float* records, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(PrimitiveBvVf)(records, pairs, count, survivors);
}
std::size_t paperPrimitiveBvEe(const float* records, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(PrimitiveBvEe)(records, pairs, count, survivors);
}
std::size_t paperPlanarVf(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(PaperPlanarVf)(records, error, pairs, count, survivors);
}
std::size_t paperPlanarEe(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                          std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(PaperPlanarEe)(records, error, pairs, count, survivors);
}
std::size_t branchFreePlanarVf(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(BranchFreePlanarVf)(records, error, pairs, count, survivors);
}
std::size_t branchFreePlanarEe(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                               std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(BranchFreePlanarEe)(records, error, pairs, count, survivors);
}
std::size_t nonPenetrationVf(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                             std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(NonPenetrationVf)(records, error, pairs, count, survivors);
}
std::size_t nonPenetrationEe(const float* records, float error, const std::uint32_t* pairs, std::size_t count,
                             std::uint32_t* survivors) {
  return HWY_DYNAMIC_DISPATCH(NonPenetrationEe)(records, error, pairs, count, survivors);
}

}  // namespace simd
}  // namespace dccd
#endif
