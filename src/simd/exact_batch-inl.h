// The batched elementary test, compiled once per SIMD target (no include guards: foreach_target includes these anew).
//   reject (exact_batch_reject-inl.h)        differences, Bernstein coefficients of f, quick "no"; what is left is
//                                            sorted into "certainly one root" and "perhaps several", side by side;
//   roots (exact_batch_roots-inl.h)          pieces with one root each; of each root (exact_batch_refine-inl.h) a few
//                                            Halley steps, a bracket certified by signs, the inside test over it;
//   sharpen (exact_batch_sharpen-inl.h)      of what this leaves undecided f anew, in pairs of doubles;
//   subdivide (exact_batch_subdivide-inl.h)  these pairs by intervals from left to right;
//   sight (exact_batch_sight-inl.h)          the inside test at their roots along directions of its own.
// With CERTIFIED false all bounds are zero and nothing is certified; the rest is the same.
// No MulAdd, no reciprocal estimate: every target computes the same bits.
#include "simd/exact_batch.h"
#include "simd/exact_batch_bounds.h"
#include "simd/exact_batch_scratch.h"
#include "simd/targets.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<double, 8>;
using V = hn::Vec<Tag>;
using M = hn::Mask<Tag>;

HWY_INLINE std::size_t lanes() { return hn::Lanes(Tag()); }
HWY_INLINE V load(const double* plane, std::size_t i) { return hn::Load(Tag(), plane + i); }
HWY_INLINE void store(V v, double* plane, std::size_t i) { hn::Store(v, Tag(), plane + i); }
HWY_INLINE V constant(double x) { return hn::Set(Tag(), x); }
HWY_INLINE V choose(M mask, V yes, V no) { return hn::IfThenElse(mask, yes, no); }

/// x y - z w, each product and the difference rounded.
HWY_INLINE V minor(V x, V y, V z, V w) { return hn::Sub(hn::Mul(x, y), hn::Mul(z, w)); }
HWY_INLINE V dot(V ax, V ay, V az, V bx, V by, V bz) {
  return hn::Add(hn::Add(hn::Mul(ax, bx), hn::Mul(ay, by)), hn::Mul(az, bz));
}
/// p s + q t.
HWY_INLINE V lerp(V p, V q, V s, V t) { return hn::Add(hn::Mul(p, s), hn::Mul(q, t)); }
/// The nearest multiple of 2^-52, for t in [0,1].
HWY_INLINE V onGrid(V t) { return hn::Sub(hn::Add(t, constant(1)), constant(1)); }
/// The largest integer not above y, for 0 <= y <= 2^52.
HWY_INLINE V floorOf(V y) {
  const V big = constant(0x1p52);
  const V nearest = hn::Sub(hn::Add(y, big), big);
  return choose(hn::Gt(nearest, y), hn::Sub(nearest, constant(1)), nearest);
}

/// f at multiples of 2^-52 in [0,1], within the bound of exact_batch_bounds.h.
HWY_INLINE V evaluate(V f0, V f1, V f2, V f3, V t) {
  const V s = hn::Sub(constant(1), t);
  const V tt = hn::Mul(t, t);
  const V low = hn::Add(hn::Mul(lerp(f0, f1, s, t), s), hn::Mul(f2, tt));
  return hn::Add(hn::Mul(low, s), hn::Mul(f3, hn::Mul(tt, t)));
}

/// Certain signs; without CERTIFIED every number has one, zero's is plus.
template <bool CERTIFIED>
HWY_INLINE M isPositive(V f, V error) {
  return CERTIFIED ? hn::Gt(f, error) : hn::Ge(f, hn::Zero(Tag()));
}
template <bool CERTIFIED>
HWY_INLINE M isNegative(V f, V error) {
  return hn::Lt(f, CERTIFIED ? hn::Neg(error) : hn::Zero(Tag()));
}

/// Exactly one sign change in c0 c1 c2 c3 whatever the uncertain middle ones are: the ends certainly differ, and c1
/// certainly has c0's sign or c2 certainly has c3's. By Descartes' rule f then has exactly one root in the piece.
template <bool CERTIFIED>
HWY_INLINE M hasOneRoot(V c0, V c1, V c2, V c3, V end_error, V middle_error) {
  const M falls = hn::And(hn::And(isPositive<CERTIFIED>(c0, end_error), isNegative<CERTIFIED>(c3, end_error)),
                          hn::Or(isPositive<CERTIFIED>(c1, middle_error), isNegative<CERTIFIED>(c2, middle_error)));
  const M rises = hn::And(hn::And(isNegative<CERTIFIED>(c0, end_error), isPositive<CERTIFIED>(c3, end_error)),
                          hn::Or(isNegative<CERTIFIED>(c1, middle_error), isPositive<CERTIFIED>(c2, middle_error)));
  return hn::Or(falls, rises);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#include "simd/exact_batch_refine-inl.h"
#include "simd/exact_batch_reject-inl.h"
#include "simd/exact_batch_roots-inl.h"
#include "simd/exact_batch_sharpen-inl.h"
#include "simd/exact_batch_sight-inl.h"
#include "simd/exact_batch_subdivide-inl.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {

/// One kind of pair through all the stages. Every lane is settled by its own numbers only, so the answers depend
/// neither on the target nor on how pairs are cut into batches.
template <bool CERTIFIED, BatchKind KIND>
HWY_INLINE void runKind(const BatchInput& in, const BatchOutput& out) {
  BatchScratch scratch;
  scratch.hard.input = &in;
  const double cells = static_cast<double>(std::uint64_t{1} << in.toc_bits);
  for (std::size_t first = 0; first < in.count; first += BATCH_BLOCK) {
    const std::size_t count = in.count - first < BATCH_BLOCK ? in.count - first : BATCH_BLOCK;
    gather<KIND>(
        in, [first](std::size_t j) { return first + j; }, count, RoundedDifference(), scratch.motion);
    for (std::size_t i = 0; i < count; i += lanes()) {
      rejectVector<CERTIFIED>(scratch, i, first + i, count - i, out);
      if (scratch.single.count + lanes() > BATCH_BLOCK) {
        solveSingle<CERTIFIED, KIND>(scratch.single, cells, scratch.hard, out);
      }
      if (scratch.several.count + lanes() > BATCH_BLOCK) {
        solveSeveral<CERTIFIED, KIND>(scratch.several, cells, scratch.hard, out);
      }
    }
  }
  solveSingle<CERTIFIED, KIND>(scratch.single, cells, scratch.hard, out);
  solveSeveral<CERTIFIED, KIND>(scratch.several, cells, scratch.hard, out);
  subdivideAll<KIND>(scratch.hard, cells, out);
}

template <bool CERTIFIED>
HWY_INLINE void runBatch(const BatchInput& in, const BatchOutput& out) {
  if (in.kind == BatchKind::VERTEX_FACE) {
    runKind<CERTIFIED, BatchKind::VERTEX_FACE>(in, out);
  } else {
    runKind<CERTIFIED, BatchKind::EDGE_EDGE>(in, out);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
