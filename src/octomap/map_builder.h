// Builds octomaps, of known shapes and of clouds, for recorded scenes and tests.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <vector>

#include "dccd/types.h"

namespace octomap {
class OcTree;
}

namespace dccd {

/// Serializes an OcTree whose voxels are occupied where `occupied(center)` says so, and unknown elsewhere.
/// @param resolution_m edge of a voxel
/// @param bounds what is asked about, in the map's frame [m]
/// @param binary true: OctoMap's binary stream (a .bt file's body), pruned; false: the full stream with log-odds
std::vector<std::int8_t> buildOctomap(double resolution_m, const Box& bounds,
                                      const std::function<bool(const Vec3& center_m)>& occupied, bool binary);

/// The map that octomap_server makes of a depth camera's clouds with its defaults: hit 0.7, miss 0.4, clamped at 0.12
/// and 0.97, any range, pruned.
class MapOfClouds {
 public:
  explicit MapOfClouds(double resolution_m);
  ~MapOfClouds();

  /// Clears along the rays from the camera to the points, and marks what the points lie in. Points that are not finite
  /// are left out, as are those beyond the 65536 voxels that a map can span. All in the map's frame [m].
  void insert(const Vec3& camera_m, const std::vector<Eigen::Vector3f>& points_m);
  /// Serialized as by buildOctomap().
  std::vector<std::int8_t> serialized(bool binary) const;

 private:
  std::unique_ptr<octomap::OcTree> tree_;
};

}  // namespace dccd
