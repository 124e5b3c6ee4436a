#include "simd/surface_views.h"

#include <utility>

#include "dccd/tolerances.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/surface_views.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#include "simd/group_lanes-inl.h"
#include "simd/vector_lanes-inl.h"

HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using ViewFloats = hn::CappedTag<float, GROUP>;
using ViewFloat = hn::Vec<ViewFloats>;
using ViewVector = VectorOf<ViewFloats>;
constexpr size_t SIDES_SIZE = 4 * GROUP;  // floats of one difference of all lanes

/// p0, q0, p1, q1 of a face.
HWY_INLINE void gatherSides(const double* HWY_RESTRICT vertices, const uint32_t* HWY_RESTRICT face, size_t lane,
                            float* HWY_RESTRICT block) {
  const hn::CappedTag<double, 4> dd;
  const hn::Rebind<float, decltype(dd)> df;
  const double* a = vertices + size_t{face[lane]} * 8;
  const double* b = vertices + size_t{face[GROUP + lane]} * 8;
  const double* c = vertices + size_t{face[2 * GROUP + lane]} * 8;
  for (size_t k = 0; k < 8; k += hn::Lanes(dd)) {
    const auto origin = hn::Load(dd, a + k);
    float* to = block + (k < 4 ? 0 : 2 * SIDES_SIZE) + lane * 4 + k % 4;
    hn::StoreU(hn::DemoteTo(df, hn::Sub(hn::Load(dd, b + k), origin)), df, to);
    hn::StoreU(hn::DemoteTo(df, hn::Sub(hn::Load(dd, c + k), origin)), df, to + SIDES_SIZE);
  }
}

HWY_INLINE ViewVector sum(const ViewVector& a, const ViewVector& b) {
  return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}

/// Along VIEW_LINE[K], not normalised.
template <size_t K>
HWY_INLINE ViewFloat along(const ViewVector& v) {
  constexpr int X = VIEW_LINE[K][0], Y = VIEW_LINE[K][1], Z = VIEW_LINE[K][2];
  const ViewFloats d;
  ViewFloat total = hn::Zero(d);
  if (X != 0) total = v.x;  // never -1
  if (Y != 0) total = Y > 0 ? hn::Add(total, v.y) : hn::Sub(total, v.y);
  if (Z != 0) total = Z > 0 ? hn::Add(total, v.z) : hn::Sub(total, v.z);
  return total;
}

/// Bits of the views along VIEW_LINE[K], where the three all lie beyond the margin, on one side.
template <size_t K>
HWY_INLINE hn::Vec<hn::RebindToUnsigned<ViewFloats>> facedAlong(const ViewVector& first, const ViewVector& middle,
                                                                const ViewVector& last, ViewFloat margin) {
  const hn::RebindToUnsigned<ViewFloats> du;
  const ViewFloat a = along<K>(first), b = along<K>(middle), c = along<K>(last);
  const auto front = hn::RebindMask(du, hn::Gt(hn::Min(hn::Min(a, b), c), margin));
  const auto back = hn::RebindMask(du, hn::Lt(hn::Max(hn::Max(a, b), c), hn::Neg(margin)));
  return hn::Or(hn::IfThenElseZero(front, hn::Set(du, 1u << 2 * K)),
                hn::IfThenElseZero(back, hn::Set(du, 2u << 2 * K)));
}

template <size_t... K>
HWY_INLINE hn::Vec<hn::RebindToUnsigned<ViewFloats>> facedAlongAll(std::index_sequence<K...>, const ViewVector& first,
                                                                   const ViewVector& middle, const ViewVector& last,
                                                                   ViewFloat margin) {
  auto faced = hn::Zero(hn::RebindToUnsigned<ViewFloats>());
  ((faced = hn::Or(faced, facedAlong<K>(first, middle, last, margin))), ...);
  return faced;
}

HWY_INLINE void viewGroup(const float* HWY_RESTRICT block, uint32_t* HWY_RESTRICT views) {
  const ViewFloats d;
  const hn::RebindToUnsigned<ViewFloats> du;
  for (size_t part = 0; part < GROUP; part += hn::Lanes(d), block += 4 * hn::Lanes(d)) {
    const ViewVector p0 = loadPoint(d, block), q0 = loadPoint(d, block + SIDES_SIZE);
    const ViewVector p1 = loadPoint(d, block + 2 * SIDES_SIZE), q1 = loadPoint(d, block + 3 * SIDES_SIZE);
    const ViewVector first = cross(p0, q0), middle = sum(cross(p0, q1), cross(p1, q0)), last = cross(p1, q1);
    const ViewFloat size = hn::Max(hn::Max(largest(p0), largest(q0)), hn::Max(largest(p1), largest(q1)));
    const ViewFloat margin = hn::Add(hn::Mul(hn::Set(d, tolerance::FUSED_PLANAR), hn::Mul(size, size)),
                                     hn::Set(d, tolerance::FUSED_UNDERFLOW));
    const auto faced = facedAlongAll(std::make_index_sequence<VIEW_LINES>(), first, middle, last, margin);
    const auto guarded = hn::RebindMask(du, hn::Le(size, hn::Set(d, tolerance::FUSED_LARGEST_M)));
    hn::StoreU(hn::IfThenElseZero(guarded, faced), du, views + part);
  }
}

void FacedViews(const double* HWY_RESTRICT vertices, const uint32_t* HWY_RESTRICT groups, size_t count,
                uint32_t* HWY_RESTRICT views) {
  HWY_ALIGN_MAX float blocks[2][4 * SIDES_SIZE] = {};
  const auto fill = [&](size_t g) HWY_ATTR {
    const uint32_t* group = groups + g * 3 * GROUP;
    for (size_t lane = 0; g < count && lane < GROUP; ++lane) {
      if (group[lane] != UINT32_MAX) gatherSides(vertices, group, lane, blocks[g % 2]);
    }
  };
  fill(0);
  for (size_t g = 0; g < count; ++g) {
    fill(g + 1);  // before this one is read: a load in larger pieces than was written waits for the cache
    viewGroup(blocks[g % 2], views + g * GROUP);
    for (size_t lane = 0; lane < GROUP; ++lane) {
      if (groups[g * 3 * GROUP + lane] == UINT32_MAX) views[g * GROUP + lane] = (1u << VIEWS) - 1;
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
HWY_EXPORT(FacedViews);

void facedViews(const double* vertices, const std::uint32_t* groups, std::size_t count, std::uint32_t* views) {
  HWY_DYNAMIC_DISPATCH(FacedViews)(vertices, groups, count, views);
}

}  // namespace simd
}  // namespace dccd
#endif
