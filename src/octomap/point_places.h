// Where a sensor's points and pixels lie in a map's grid, some at a time, with the widest vectors of the processor.
// Each number is the same on all of them.
#pragma once

#include <cstddef>
#include <cstdint>

#include <Eigen/Core>

namespace dccd {

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

  Eigen::Vector3d at(std::size_t i) const { return {x[i], y[i], z[i]}; }
};

/// [voxels] From the corner of the voxel whose key is 0. The limits are within 0 and 65536; hi is exclusive.
struct PlaceLimits {
  double sensor[3], lo[3], hi[3];
  double nearest2, farthest2;  ///< squares of distances from the sensor
};

/// Of `places.count` pixels of a row of depths [m]: a pixel of depth 1 m lies at `first`, each next one `right` of it.
void placeDepths(const float* depth_m, const Eigen::Vector3d& first, const Eigen::Vector3d& right,
                 const PlaceLimits& limits, PointPlaces& places);
/// Of `places.count` points, three coordinates each. depth: along `ahead`.
void placePoints(const float* xyz, const Eigen::Matrix3d& from_sensor, const Eigen::Vector3d& ahead,
                 const PlaceLimits& limits, PointPlaces& places);

}  // namespace dccd
