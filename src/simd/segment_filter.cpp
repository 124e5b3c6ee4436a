#include "simd/segment_filter.h"

#include "dccd/tolerances.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/segment_filter.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<double, 8>;
using V = hn::Vec<Tag>;
using M = hn::Mask<Tag>;
constexpr size_t MAX_LANES = 8;

struct Vector {
  V x, y, z;
};
HWY_INLINE Vector operator+(const Vector& a, const Vector& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE Vector cross(const Vector& a, const Vector& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
HWY_INLINE V dot(const Vector& a, const Vector& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE V smallest(V a, V b, V c) { return hn::Min(hn::Min(a, b), c); }
HWY_INLINE V largest(V a, V b, V c) { return hn::Max(hn::Max(a, b), c); }
HWY_INLINE V largest(const Vector& a) { return largest(hn::Abs(a.x), hn::Abs(a.y), hn::Abs(a.z)); }
HWY_INLINE M areBeyond(V a, V b, V margin) { return hn::Gt(hn::Min(a, b), margin); }
HWY_INLINE M areOpposite(V a, V b, V margin) {
  return hn::And(hn::Lt(hn::Min(a, b), hn::Neg(margin)), hn::Gt(hn::Max(a, b), margin));
}

/// What is certain.
struct Answer {
  M apart, meets;
};

/// Differences to p, a vector of each lane's.
struct Differences {
  Vector q, a, b, c;
};

HWY_INLINE M apartOnAxis(V q, V a, V b, V c) {
  const V zero = hn::Zero(Tag());
  return hn::Or(hn::Gt(hn::Min(zero, q), largest(a, b, c)), hn::Lt(hn::Max(zero, q), smallest(a, b, c)));
}

/// In the projection onto a coordinate plane. flat: lanes of which the projection holds all.
HWY_INLINE Answer inPlane(V bc, V ca, V ab, V qa, V qb, V qc, V margin, M flat) {
  // On which side of the line of each of the triangle's edges q is; p is on that of bc, ca, ab.
  const V q_bc = hn::Add(bc, hn::Sub(qb, qc)), q_ca = hn::Add(ca, hn::Sub(qc, qa)), q_ab = hn::Add(ab, hn::Sub(qa, qb));
  const V area = hn::Add(hn::Add(bc, ca), ab), zero = hn::Zero(Tag());
  const M has_area = hn::Gt(hn::Abs(area), margin), turns_back = hn::Lt(area, zero);
  const auto outside = [&](V p, V q) HWY_ATTR {
    return areBeyond(hn::IfThenElse(turns_back, p, hn::Neg(p)), hn::IfThenElse(turns_back, q, hn::Neg(q)), margin);
  };
  const V lo = smallest(qa, qb, qc), hi = largest(qa, qb, qc);
  const M beside = hn::Or(hn::Gt(lo, margin), hn::Lt(hi, hn::Neg(margin)));
  const M beyond = hn::Or(hn::Or(outside(bc, q_bc), outside(ca, q_ca)), outside(ab, q_ab));
  const auto inside = [&](V x, V y, V z) HWY_ATTR {
    return hn::Or(hn::Gt(smallest(x, y, z), margin), hn::Lt(largest(x, y, z), hn::Neg(margin)));
  };
  const auto crosses = [&](V p, V q, V one, V other)
                           HWY_ATTR { return hn::And(areOpposite(p, q, margin), areOpposite(one, other, margin)); };
  const M holds_end = hn::Or(inside(bc, ca, ab), inside(q_bc, q_ca, q_ab));
  const M crossed = hn::Or(hn::Or(crosses(bc, q_bc, qb, qc), crosses(ca, q_ca, qc, qa)), crosses(ab, q_ab, qa, qb));
  return {hn::Or(beside, hn::And(has_area, beyond)), hn::And(flat, hn::Or(holds_end, crossed))};
}

HWY_INLINE Answer answerOf(const Differences& d) {
  const Tag tag;
  const V size = hn::Max(hn::Max(largest(d.a), largest(d.b)), hn::Max(largest(d.c), largest(d.q)));
  const M guarded = hn::Le(size, hn::Set(tag, tolerance::SEGMENT_LARGEST_M));
  const V squared = hn::Mul(size, size), cubed = hn::Mul(squared, size);
  const V underflow = hn::Set(tag, tolerance::SEGMENT_UNDERFLOW);
  const V line_margin = hn::Add(hn::Mul(hn::Set(tag, tolerance::SEGMENT_LINE), cubed), underflow);
  const V plane_margin = hn::Add(hn::Mul(hn::Set(tag, tolerance::SEGMENT_PLANE), cubed), underflow);
  const Vector bc = cross(d.b, d.c), ca = cross(d.c, d.a), ab = cross(d.a, d.b);
  const V side_p = hn::Neg(dot(d.a, bc));
  const V u = dot(d.q, bc), v = dot(d.q, ca), w = dot(d.q, ab);
  const V side_q = hn::Add(hn::Add(hn::Add(u, v), w), side_p);
  const V lo = smallest(u, v, w), hi = largest(u, v, w);
  const M same_side =
      hn::Or(areBeyond(side_p, side_q, plane_margin), hn::Lt(hn::Max(side_p, side_q), hn::Neg(plane_margin)));
  const M within = hn::Or(hn::Gt(lo, line_margin), hn::Lt(hi, hn::Neg(line_margin)));
  M apart = hn::And(guarded, hn::Or(same_side, areOpposite(lo, hi, line_margin)));
  M meets = hn::And(guarded, hn::And(areOpposite(side_p, side_q, plane_margin), within));
  if (hn::AllTrue(tag, hn::Or(apart, meets))) return {apart, meets};
  apart = hn::Or(hn::Or(apart, apartOnAxis(d.q.x, d.a.x, d.b.x, d.c.x)),
                 hn::Or(apartOnAxis(d.q.y, d.a.y, d.b.y, d.c.y), apartOnAxis(d.q.z, d.a.z, d.b.z, d.c.z)));
  if (hn::AllTrue(tag, hn::Or(apart, meets))) return {apart, meets};
  const V margin = hn::Add(hn::Mul(hn::Set(tag, tolerance::SEGMENT_PROJECTED), squared), underflow);
  const Vector qa = cross(d.q, d.a), qb = cross(d.q, d.b), qc = cross(d.q, d.c);
  const auto add = [&](V bc_k, V ca_k, V ab_k, V qa_k, V qb_k, V qc_k, V q_k, V a_k, V b_k, V c_k) HWY_ATTR {
    const V extent = hn::Max(hn::Max(hn::Abs(q_k), hn::Abs(a_k)), hn::Max(hn::Abs(b_k), hn::Abs(c_k)));
    const Answer one = inPlane(bc_k, ca_k, ab_k, qa_k, qb_k, qc_k, margin, hn::Eq(extent, hn::Zero(tag)));
    apart = hn::Or(apart, hn::And(guarded, one.apart));
    meets = hn::Or(meets, hn::And(guarded, one.meets));
  };
  add(bc.x, ca.x, ab.x, qa.x, qb.x, qc.x, d.q.x, d.a.x, d.b.x, d.c.x);
  add(bc.y, ca.y, ab.y, qa.y, qb.y, qc.y, d.q.y, d.a.y, d.b.y, d.c.y);
  add(bc.z, ca.z, ab.z, qa.z, qb.z, qc.z, d.q.z, d.a.z, d.b.z, d.c.z);
  return {apart, meets};
}

/// A block of pairs: four values for each lane of q, then of a, b and c; the last of the four is not used.
constexpr size_t POINT_SIZE = 4 * MAX_LANES, BLOCK_SIZE = 4 * POINT_SIZE;

HWY_INLINE void gather(const double* HWY_RESTRICT positions, const uint32_t* HWY_RESTRICT pair, size_t lane,
                       double* HWY_RESTRICT block) {
  const hn::CappedTag<double, 4> tag;
  const double* p = positions + size_t{pair[0]} * 8;
  for (size_t k = 0; k < 4; k += hn::Lanes(tag)) {
    const auto origin = hn::Load(tag, p + k);
    for (size_t i = 0; i < 4; ++i) {
      const double* x = positions + size_t{pair[i + 1]} * 8 + k;
      hn::Store(hn::Sub(hn::Load(tag, x), origin), tag, block + i * POINT_SIZE + lane * 4 + k);
    }
  }
}

HWY_INLINE Vector loadPoint(const double* HWY_RESTRICT block, size_t i) {
  Vector point;
  V unused;
  hn::LoadInterleaved4(Tag(), block + i * POINT_SIZE, point.x, point.y, point.z, unused);
  return point;
}

void SegmentFilter(const double* HWY_RESTRICT positions, const uint32_t* HWY_RESTRICT pairs, size_t count,
                   uint8_t* HWY_RESTRICT verdicts) {
  const size_t lanes = hn::Lanes(Tag());
  HWY_ALIGN_MAX double blocks[2][BLOCK_SIZE] = {};
  const auto fill = [&](size_t first, double* HWY_RESTRICT block) HWY_ATTR {
    const size_t n = first >= count ? 0 : HWY_MIN(lanes, count - first);
    for (size_t lane = 0; lane < n; ++lane) gather(positions, pairs + 5 * (first + lane), lane, block);
    return n;
  };
  // The next block is filled before this one is tested: a block is read in larger pieces than it was written in, and
  // such a load waits until the stores have reached the cache.
  size_t now = 0;
  for (size_t first = 0, n = fill(0, blocks[0]); n > 0; first += lanes, now = 1 - now) {
    const size_t next = fill(first + lanes, blocks[1 - now]);
    const double* block = blocks[now];
    const Answer answer =
        answerOf({loadPoint(block, 0), loadPoint(block, 1), loadPoint(block, 2), loadPoint(block, 3)});
    uint8_t apart[8] = {0}, meets[8] = {0};
    hn::StoreMaskBits(Tag(), answer.apart, apart);
    hn::StoreMaskBits(Tag(), answer.meets, meets);
    for (size_t lane = 0; lane < n; ++lane) {
      verdicts[first + lane] = static_cast<uint8_t>((meets[0] >> lane & 1) | (~(apart[0] | meets[0]) >> lane & 1) << 1);
    }
    n = next;
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {
HWY_EXPORT(SegmentFilter);
void segmentFilter(const double* positions, const std::uint32_t* pairs, std::size_t count, std::uint8_t* verdicts) {
  HWY_DYNAMIC_DISPATCH(SegmentFilter)(positions, pairs, count, verdicts);
}
}  // namespace simd
}  // namespace dccd
#endif
