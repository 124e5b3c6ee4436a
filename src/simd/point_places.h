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
  /// 1: as the one before it lies in the limits, further away than nothing, at the least the nearest and at the most
  /// the farthest, and in the same voxel. Else 0.
  std::int32_t repeats[MOST];
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

}  // namespace simd
}  // namespace dccd
