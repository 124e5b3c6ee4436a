// The pixels or points of a view, each looked at once: which voxels they end in, and how deep a picture is.
#pragma once

#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "base/cloud_map.h"
#include "octomap/cloud_rays.h"
#include "octomap/depth_picture.h"

namespace dccd {

/// How a map divides space, and how far a view may reach.
struct ViewLimits {
  double resolution_m = 0, voxels_per_m = 0;
  double near_m = 0, fill_m = 0, clear_m = 0;
  bool no_return_clears = false;
  Eigen::Vector3d lo, hi;  ///< [voxels] of what may be filled and cleared; hi exclusive; infinite where it has no end
  /// [voxels] From the corner of the voxel whose key is 0.
  Eigen::Vector3d voxels(const Vec3& map_m) const { return map_m * voxels_per_m + Eigen::Vector3d::Constant(32768); }
};

/// Scratch, used again.
class ViewReader {
 public:
  /// Words of the voxels in which the view's points end (endWord()), sorted; some more than once.
  std::vector<std::uint64_t> ends;
  DepthPicture picture;  ///< if counts say that it is one, and that it cleared
  CloudRays rays;        ///< if it is none, and cleared

  /// Throws OctomapError for the sensor or a point outside of what a map can span. most_bytes: that `rays` may take.
  SeenCounts read(const SensorView& view, const ViewLimits& limits, std::size_t most_bytes);
  std::size_t memoryBytes() const;

 private:
  std::vector<std::uint64_t> recent_, other_;

  template <class TakeInto, class KindOf>
  void readPoints(const SensorView& view, const ViewLimits& limits, float* depths, const TakeInto& takeInto,
                  const KindOf& kindOf, SeenCounts& counts);
};

}  // namespace dccd
