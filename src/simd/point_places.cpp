#include "simd/point_places.h"

#include <limits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simd/point_places.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// Plain loops: the compiler makes vectors of them for each target.
HWY_BEFORE_NAMESPACE();
namespace dccd {
namespace simd {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

void locateAxis(const double* HWY_RESTRICT place, size_t count, double sensor, double lo, double hi,
                int32_t* HWY_RESTRICT key, int32_t* HWY_RESTRICT is_in) {
  for (size_t i = 0; i < count; ++i) {
    const double at = sensor + place[i];
    const bool within = (at >= lo) & (at < hi);
    key[i] = static_cast<int32_t>(within ? at : 0.0);
    is_in[i] &= within ? 1 : 0;
  }
}

void findFresh(const PlaceLimits& limits, PointPlaces& places) {
  const size_t count = places.count;
  const int32_t* const x = places.key[0];
  const int32_t* const y = places.key[1];
  const int32_t* const z = places.key[2];
  int32_t within[PointPlaces::MOST];
  for (size_t i = 0; i < count; ++i) {
    const double away2 = places.away2[i];
    const bool is_within = (away2 > 0) & (away2 >= limits.nearest2) & (away2 <= limits.farthest2);
    within[i] = is_within ? places.is_in[i] : 0;
  }
  int32_t is_fresh[PointPlaces::MOST];
  is_fresh[0] = 1;
  for (size_t i = 1; i < count; ++i) {
    const int32_t differs = (x[i] ^ x[i - 1]) | (y[i] ^ y[i - 1]) | (z[i] ^ z[i - 1]);
    is_fresh[i] = 1 ^ (within[i] & within[i - 1] & (differs == 0 ? 1 : 0));
  }
  size_t fresh_count = 0;
  for (size_t i = 0; i < count; ++i) {  // processors guess badly which they are
    places.fresh[fresh_count] = static_cast<int32_t>(i);
    fresh_count += static_cast<size_t>(is_fresh[i]);
  }
  places.fresh_count = fresh_count;
}

void locate(const PlaceLimits& limits, PointPlaces& places) {
  const size_t count = places.count;
  for (size_t i = 0; i < count; ++i) {
    places.away2[i] = places.x[i] * places.x[i] + places.y[i] * places.y[i] + places.z[i] * places.z[i];
  }
  for (size_t i = 0; i < count; ++i) places.is_in[i] = 1;
  const double* const axes[3] = {places.x, places.y, places.z};
  for (int a = 0; a < 3; ++a) {
    locateAxis(axes[a], count, limits.sensor[a], limits.lo[a], limits.hi[a], places.key[a], places.is_in);
  }
  findFresh(limits, places);
}

void PlaceDepths(const float* HWY_RESTRICT depth_m, const double* HWY_RESTRICT first, const double* HWY_RESTRICT right,
                 const PlaceLimits& limits, PointPlaces& places) {
  const size_t count = places.count;
  constexpr float LARGEST = std::numeric_limits<float>::max();
  double* const axes[3] = {places.x, places.y, places.z};
  for (size_t i = 0; i < count; ++i) {
    const float z = depth_m[i];
    places.depth[i] = (z > 0) & (z <= LARGEST) ? z : 0.0f;
  }
  for (int a = 0; a < 3; ++a) {
    const double begin = first[a], step = right[a];
    double* HWY_RESTRICT const out = axes[a];
    for (size_t i = 0; i < count; ++i) {
      out[i] = (begin + step * static_cast<int32_t>(i)) * static_cast<double>(places.depth[i]);
    }
  }
  locate(limits, places);
}

template <class D>
hn::Vec<D> along(const double* way, hn::Vec<D> x, hn::Vec<D> y, hn::Vec<D> z) {
  const D d;
  const auto xy = hn::Add(hn::Mul(hn::Set(d, way[0]), x), hn::Mul(hn::Set(d, way[1]), y));
  return hn::Add(xy, hn::Mul(hn::Set(d, way[2]), z));
}

/// Of at least as many points as a vector has lanes. The last points of a row are placed again with those before.
template <class D>
void placeAll(D d, const float* HWY_RESTRICT xyz, const double* m, const double* ahead, PointPlaces& places) {
  const hn::Rebind<float, D> floats;
  const size_t lanes = hn::Lanes(d), count = places.count;
  const double to_x[3] = {m[0], m[3], m[6]}, to_y[3] = {m[1], m[4], m[7]}, to_z[3] = {m[2], m[5], m[8]};
  const auto none = hn::Zero(floats);
  double depth[PointPlaces::MOST];
  for (size_t next = 0; next < count; next += lanes) {
    const size_t i = next + lanes <= count ? next : count - lanes;
    hn::Vec<decltype(floats)> px, py, pz;
    hn::LoadInterleaved3(floats, xyz + 3 * i, px, py, pz);
    const auto sum = hn::Add(hn::Add(hn::Mul(px, none), hn::Mul(py, none)), hn::Mul(pz, none));
    const auto is_point = hn::Eq(sum, none);
    const auto x = hn::PromoteTo(d, hn::IfThenElseZero(is_point, px));
    const auto y = hn::PromoteTo(d, hn::IfThenElseZero(is_point, py));
    const auto z = hn::PromoteTo(d, hn::IfThenElseZero(is_point, pz));
    hn::StoreU(along<D>(to_x, x, y, z), d, places.x + i);
    hn::StoreU(along<D>(to_y, x, y, z), d, places.y + i);
    hn::StoreU(along<D>(to_z, x, y, z), d, places.z + i);
    hn::StoreU(along<D>(ahead, x, y, z), d, depth + i);
  }
  for (size_t i = 0; i < count; ++i) places.depth[i] = static_cast<float>(depth[i]);  // as plain numbers overflow
}

void PlacePoints(const float* HWY_RESTRICT xyz, const double* HWY_RESTRICT m, const double* HWY_RESTRICT ahead,
                 const PlaceLimits& limits, PointPlaces& places) {
  const hn::ScalableTag<double> d;
  if (places.count >= hn::Lanes(d)) {
    placeAll(d, xyz, m, ahead, places);
  } else {
    placeAll(hn::CappedTag<double, 1>(), xyz, m, ahead, places);
  }
  locate(limits, places);
}

/// For rows of at least as many points as a vector has lanes.
template <class D>
double mostOff(D d, const PixelRow& row, const double* to_u, const double* to_v, const double* ahead) {
  const hn::Rebind<float, D> floats;
  const size_t lanes = hn::Lanes(d);
  const auto infinite = hn::Set(d, std::numeric_limits<double>::infinity()), zero = hn::Zero(d);
  auto most = zero;
  for (size_t next = 0; next < row.width; next += lanes) {
    const size_t i = next + lanes <= row.width ? next : row.width - lanes;  // some twice
    hn::Vec<decltype(floats)> px, py, pz;
    hn::LoadInterleaved3(floats, row.xyz + 3 * i, px, py, pz);
    const auto x = hn::PromoteTo(d, px), y = hn::PromoteTo(d, py), z = hn::PromoteTo(d, pz);
    const auto square = hn::Add(hn::Add(hn::Mul(x, x), hn::Mul(y, y)), hn::Mul(z, z));
    const auto is_far = hn::And(hn::Gt(square, zero), hn::Ge(square, hn::Set(d, row.nearest2)));
    const auto counts = hn::And(is_far, hn::Lt(square, infinite));
    const auto depth = along<D>(ahead, x, y, z), inverse = hn::Div(hn::Set(d, 1.0), depth);
    const auto u = hn::Iota(d, static_cast<double>(i)), v = hn::Set(d, row.v);
    const auto off_u = hn::Abs(hn::Sub(hn::Mul(along<D>(to_u, x, y, z), inverse), u));
    const auto off_v = hn::Abs(hn::Sub(hn::Mul(along<D>(to_v, x, y, z), inverse), v));
    const auto larger = hn::IfThenElse(hn::Lt(off_u, off_v), off_v, off_u);
    const auto off = hn::IfThenElse(hn::Gt(depth, zero), larger, infinite);
    most = hn::IfThenElse(hn::And(counts, hn::Lt(most, off)), off, most);
  }
  return hn::GetLane(hn::MaxOfLanes(d, most));
}

double MostOffPx(const PixelRow& row, const double* to_u, const double* to_v, const double* ahead) {
  const hn::ScalableTag<double> d;
  if (row.width >= hn::Lanes(d)) return mostOff(d, row, to_u, to_v, ahead);
  return mostOff(hn::CappedTag<double, 1>(), row, to_u, to_v, ahead);
}

}  // namespace HWY_NAMESPACE
}  // namespace simd
}  // namespace dccd
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace dccd {
namespace simd {

HWY_EXPORT(PlaceDepths);
HWY_EXPORT(PlacePoints);
HWY_EXPORT(MostOffPx);

void placeDepths(const float* depth_m, const double* first, const double* right, const PlaceLimits& limits,
                 PointPlaces& places) {
  HWY_DYNAMIC_DISPATCH(PlaceDepths)(depth_m, first, right, limits, places);
}

void placePoints(const float* xyz, const double* from_sensor, const double* ahead, const PlaceLimits& limits,
                 PointPlaces& places) {
  HWY_DYNAMIC_DISPATCH(PlacePoints)(xyz, from_sensor, ahead, limits, places);
}

double mostOffPx(const PixelRow& row, const double* to_u, const double* to_v, const double* ahead) {
  return HWY_DYNAMIC_DISPATCH(MostOffPx)(row, to_u, to_v, ahead);
}

}  // namespace simd
}  // namespace dccd
#endif
