#include "simd/touch_geometry.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/touch_geometry.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<double, 8>;
using V = hn::Vec<D>;
static_assert(TOUCHES % hn::MaxLanes(D()) == 0, "a block is whole vectors");

HWY_INLINE V number(double x) { return hn::Set(D(), x); }

struct Vectors {
  V x, y, z;
};
HWY_INLINE Vectors operator+(const Vectors& a, const Vectors& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE Vectors operator-(const Vectors& a, const Vectors& b) {
  return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE Vectors operator*(V s, const Vectors& a) { return {hn::Mul(s, a.x), hn::Mul(s, a.y), hn::Mul(s, a.z)}; }
HWY_INLINE Vectors operator-(const Vectors& a) { return {hn::Neg(a.x), hn::Neg(a.y), hn::Neg(a.z)}; }
HWY_INLINE Vectors cross(const Vectors& a, const Vectors& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
// In the order in which Eigen adds.
HWY_INLINE V dot(const Vectors& a, const Vectors& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE hn::Mask<D> isFinite(V x) { return hn::Lt(hn::Abs(x), number(std::numeric_limits<double>::infinity())); }
HWY_INLINE Vectors select(hn::Mask<D> which, const Vectors& yes, const Vectors& no) {
  return {hn::IfThenElse(which, yes.x, no.x), hn::IfThenElse(which, yes.y, no.y), hn::IfThenElse(which, yes.z, no.z)};
}
/// std::clamp(x, 0, high): not by Min and Max, which would lose the sign of a zero.
HWY_INLINE V clamp(V x, V high) {
  return hn::IfThenElse(hn::Lt(x, hn::Zero(D())), hn::Zero(D()), hn::IfThenElse(hn::Lt(high, x), high, x));
}
HWY_INLINE V unit(V x) { return hn::IfThenElseZero(isFinite(x), clamp(x, number(1))); }
HWY_INLINE Vectors unitOr(const Vectors& v, const Vectors& fallback) {
  const V n = hn::Sqrt(dot(v, v));
  const Vectors divided{hn::Div(v.x, n), hn::Div(v.y, n), hn::Div(v.z, n)};
  return select(hn::And(hn::Gt(n, hn::Zero(D())), isFinite(n)), divided, fallback);
}

HWY_INLINE Vectors load(const double (&x)[TOUCHES][3], size_t i) {
  Vectors out;
  hn::LoadInterleaved3(D(), x[i], out.x, out.y, out.z);
  return out;
}
HWY_INLINE void store(const Vectors& v, double (&x)[3][TOUCHES], size_t i) {
  const D d;
  hn::StoreU(v.x, d, x[0] + i);
  hn::StoreU(v.y, d, x[1] + i);
  hn::StoreU(v.z, d, x[2] + i);
}

struct Segments {
  Vectors on_first, on_second;
};
HWY_INLINE Segments closestOnSegments(const Vectors& a0, const Vectors& a1, const Vectors& b0, const Vectors& b1) {
  const Vectors da = a1 - a0, db = b1 - b0, between = a0 - b0;
  const V aa = dot(da, da), bb = dot(db, db), ab = dot(da, db);
  const V denominator = hn::Sub(hn::Mul(aa, bb), hn::Mul(ab, ab));
  const V a_between = dot(da, between), b_between = dot(db, between);
  V u = unit(hn::Div(hn::Sub(hn::Mul(ab, b_between), hn::Mul(bb, a_between)), denominator));
  const V v = unit(hn::Div(hn::Add(hn::Mul(ab, u), b_between), bb));
  u = unit(hn::Div(hn::Sub(hn::Mul(ab, v), a_between), aa));
  return {a0 + u * da, b0 + v * db};
}

/// At toc 0 the position itself.
HWY_INLINE Vectors along(const TouchBlock& block, size_t vertex, size_t i) {
  const Vectors from = load(block.x[0][vertex], i), to = load(block.x[1][vertex], i);
  const V toc = hn::LoadU(D(), block.toc + i);
  return select(hn::Eq(toc, hn::Zero(D())), from, from + toc * (to - from));
}

void Places(bool edge_edge, size_t count, TouchBlock& block) {
  const Vectors none{hn::Zero(D()), hn::Zero(D()), hn::Zero(D())};
  for (size_t i = 0; i < count; i += hn::Lanes(D())) {
    const Vectors v0 = load(block.x[0][0], i), v1 = load(block.x[0][1], i);
    const Vectors v2 = load(block.x[0][2], i), v3 = load(block.x[0][3], i);
    Vectors across, from_second;
    if (edge_edge) {
      const Segments closest =
          closestOnSegments(along(block, 0, i), along(block, 1, i), along(block, 2, i), along(block, 3, i));
      store(number(0.5) * (closest.on_first + closest.on_second), block.point, i);
      across = cross(v1 - v0, v3 - v2);
      from_second = v0 - v2;
    } else {
      store(along(block, 0, i), block.point, i);
      across = cross(v2 - v1, v3 - v1);
      from_second = v0 - v1;
    }
    const Vectors normal = unitOr(across, none);
    store(select(hn::Lt(dot(normal, from_second), hn::Zero(D())), -normal, normal), block.normal, i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {

HWY_EXPORT(Places);

void touchPlaces(bool edge_edge, std::size_t count, TouchBlock& block) {
  HWY_DYNAMIC_DISPATCH(Places)(edge_edge, count, block);
}

}  // namespace simd
}  // namespace dccd
#endif
