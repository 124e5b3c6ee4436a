// Clouds of points to a map: one octree of liboctomap's, along whose rays a sensor's points clear and fill voxels.
// No OctoMap or ROS header is needed here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "dccd/export.h"
#include "dccd/octomap_decode.h"
#include "dccd/types.h"

namespace dccd {

/// Defaults are octomap_server's.
struct CloudMapOptions {
  double resolution_m = 0.05;  ///< edge of a voxel
  double max_range_m = 0;      ///< what is seen further away only clears so far; 0: as far as a ray may be
  double hit = 0.7;            ///< probability that a voxel is occupied in which a point lies; 0.5 to 1
  double miss = 0.4;           ///< the same of a voxel that a ray goes through; 0 to 0.5
  double min = 0.12;           ///< no voxel's probability is taken to be less; 0 to 0.5
  double max = 0.97;           ///< nor more; 0.5 to 1
};

/// Not thread-safe.
class DCCD_EXPORT CloudMap {
 public:
  /// No ray is longer: what lies beyond clears so far.
  static constexpr double MOST_RAY_VOXELS = 4096;

  explicit CloudMap(const CloudMapOptions& options);
  ~CloudMap();

  /// What octomap::OcTree::insertPointCloud() makes of the points, which are finite [m, map frame], as is the sensor's
  /// place: in one cloud a voxel is cleared or filled once, and a point in it wins. What leaves the 65536 voxels that a
  /// map spans is left out. Throws OctomapError for a sensor outside of these, and where more than `max_bytes` would be
  /// needed: a part of the cloud may then be in the map.
  void insert(const Vec3& sensor, const Positions& points, std::size_t max_bytes);
  /// As decodeOctomap() would find them in the map's message. Throws OctomapError for limits exceeded.
  DecodedOctomap leaves(const OctomapLimits& limits = {}) const;
  /// The data of its Octomap message: OctoMap's binary stream, or the full one with log-odds.
  std::vector<std::int8_t> serialized(bool binary) const;
  /// [bytes] At most.
  std::size_t memoryBytes() const;

 private:
  struct DCCD_HIDDEN Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
