// Vectors of three coordinates, one a lane, per SIMD target.
#if defined(DCCD_SIMD_VECTOR_LANES_INL_H) == defined(HWY_TARGET_TOGGLE)
#ifdef DCCD_SIMD_VECTOR_LANES_INL_H
#undef DCCD_SIMD_VECTOR_LANES_INL_H
#else
#define DCCD_SIMD_VECTOR_LANES_INL_H
#endif

#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

template <class D>
struct VectorOf {
  hn::Vec<D> x, y, z;
};
template <class D>
HWY_INLINE VectorOf<D> cross(const VectorOf<D>& a, const VectorOf<D>& b) {
  return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)), hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
          hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
template <class D>
HWY_INLINE hn::Vec<D> dot(const VectorOf<D>& a, const VectorOf<D>& b) {
  return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
template <class D>
HWY_INLINE hn::Vec<D> largest(const VectorOf<D>& a) {
  return hn::Max(hn::Max(hn::Abs(a.x), hn::Abs(a.y)), hn::Abs(a.z));
}
/// Of four values for each lane the first three.
template <class D>
HWY_INLINE VectorOf<D> loadPoint(D d, const hn::TFromD<D>* HWY_RESTRICT block) {
  VectorOf<D> point;
  hn::Vec<D> unused;
  hn::LoadInterleaved4(d, block, point.x, point.y, point.z, unused);
  return point;
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();
#endif
