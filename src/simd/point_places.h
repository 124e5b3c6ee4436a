// Where a sensor's points and pixels lie in a map's grid, some at a time, with the widest vectors of the processor.
// Each number is the same on all of them.
#pragma once

#include <cstddef>
#include <cstdint>

#include "dccd/export.h"

namespace dccd {
namespace simd {

/// Places relative to the sensor, along the map's axes [voxels]; zeros for what is no point.
struct PointPlaces {
  static constexpr std::size_t MOST = 512;
  std::size_t count = 0;
  double x[MOST], y[MOST], z[MOST], away2[MOST];
  float depth[MOST];
  std::int32_t key[3][MOST];  ///< of those that are in
  std::int32_t is_in[MOST];   ///< the limits: 1, or 0
  /// All but those that lie, as the one before, in the limits, further away than nothing, at the least the nearest and
  /// at the most the farthest, and in the same voxel.
  std::int32_t fresh[MOST];
  std::size_t fresh_count = 0;
};

/// [voxels] From the corner of the voxel whose key is 0. The limits are within 0 and 65536; hi is exclusive.
struct PlaceLimits {
  double sensor[3], lo[3], hi[3];
  double nearest2, farthest2;  ///< squares of distances from the sensor
};

/// Of `places.count` pixels of a row of depths [m]: a pixel of depth 1 m lies at `first`, each next one `right` of it.
DCCD_EXPORT void placeDepths(const float* depth_m, const double* first, const double* right, const PlaceLimits& limits,
                             PointPlaces& places);
/// Of `places.count` points, three coordinates each, by a matrix, column by column. depth: along `ahead`.
DCCD_EXPORT void placePoints(const float* xyz, const double* from_sensor, const double* ahead,
                             const PlaceLimits& limits, PointPlaces& places);

/// A row of points in a picture's order. Those nearer than that and those that are not finite do not count.
struct PixelRow {
  const float* xyz;
  std::size_t width;  ///< at least 1
  double v;           ///< the row's number
  double nearest2;    ///< square of a distance from the camera
};

/// [px] So far at most is a point that counts from its pixel, along u or v; infinite where one is not ahead. Pixels are
/// `to_u` and `to_v` of a point by its depth, which is along `ahead`.
DCCD_EXPORT double mostOffPx(const PixelRow& row, const double* to_u, const double* to_v, const double* ahead);

}  // namespace simd
}  // namespace dccd
