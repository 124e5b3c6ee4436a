// What depth cameras and lidars see, made one map: an octree of liboctomap's, in which points fill voxels, and what the
// sensor looked through is cleared. No OctoMap or ROS header is needed here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "base/octomap_decode.h"
#include "dccd/export.h"
#include "dccd/types.h"

namespace dccd {

/// The sensor model's defaults are octomap_server's.
struct CloudMapOptions {
  double resolution_m = 0.05;  ///< edge of a voxel
  double max_range_m = 0;  ///< what is seen further away only clears so far; 0: it fills, and clears MOST_RAY_VOXELS
  double min_range_m = 0;  ///< a point that is nearer to the sensor is no measurement
  bool no_return_clears = false;  ///< a pixel that is infinite has seen through all that is within the range
  std::optional<Box> box;         ///< [m, map frame] voxels that are not in it, be it in part, stay unknown
};

/// Pixel (u, v) looks along ((u - cx) / fx, (v - cy) / fy, 1) in the camera's frame: z ahead, x to the right.
struct Pinhole {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [px] fx and fy above 0
};

/// What a sensor saw at one moment, in its own frame. It names what must live until the answer.
/// A depth, or a coordinate of a point, that is not a number or -inf says nothing. +inf (of a point: any coordinate)
/// is "no return". (0, 0, 0), and a depth of 0 or less, is no measurement.
struct SensorView {
  Eigen::Isometry3d map_from_sensor = Eigen::Isometry3d::Identity();  ///< the sensor's place is its translation
  std::size_t width = 0, height = 1;  ///< points, or pixels, in a row; rows. A height of 1: in no order
  const float* xyz = nullptr;         ///< [m] row by row, three a point; or null:
  const float* depth_m = nullptr;     ///< along z, one a pixel, by this pinhole:
  Pinhole pinhole;
  bool clears = true;  ///< false: its points fill, and nothing is cleared. What an overload may leave out
};

/// What became of a view's pixels or points; each is counted once.
struct SeenCounts {
  std::size_t filled = 0;     ///< lie in a voxel that they filled
  std::size_t near = 0;       ///< no measurement: (0, 0, 0), a depth of 0 or less, or nearer than min_range_m
  std::size_t far = 0;        ///< beyond max_range_m
  std::size_t outside = 0;    ///< within the range, outside of the box
  std::size_t no_return = 0;  ///< infinite
  std::size_t nothing = 0;    ///< not a number
  bool is_picture = false;    ///< a depth picture, or points in rows that a pinhole's pixels explain
  bool cleared = false;       ///< what was seen through was cleared (SensorView::clears)
  /// Those with no return cleared. They cannot where they are no pixels: nobody knows in which direction they looked.
  bool no_return_cleared = false;
};

/// Not thread-safe.
class DCCD_EXPORT CloudMap {
 public:
  /// Nothing is cleared that is further away.
  static constexpr double MOST_RAY_VOXELS = 4096;

  explicit CloudMap(const CloudMapOptions& options);
  ~CloudMap();

  /// A voxel in which a point lies takes a hit; one that a ray crosses, from the sensor to a point or as far as the
  /// range, and in which no point lies, a miss; each once. Throws OctomapError, and the map is as it was, for a sensor
  /// or a point outside of the 65536 voxels that a map spans; and where more than `max_bytes` would be needed: a part
  /// of the view may then be in the map.
  SeenCounts insert(const SensorView& view, std::size_t max_bytes);
  /// As decodeOctomap() would find them in the map's message; found: what the last view did. Throws OctomapError for
  /// limits exceeded.
  DecodedOctomap leaves(const OctomapLimits& limits = {}) const;
  /// Voxels in Morton order in which a point lay that were not occupied with it, and which nothing has looked through
  /// since.
  const std::vector<OccupiedLeaf>& doubtful() const;
  /// Of these, the ones in which a point of the newest cloud lies.
  std::vector<OccupiedLeaf> doubtfulNow() const;
  /// The data of its Octomap message: OctoMap's binary stream, or the full one with log-odds.
  std::vector<std::int8_t> serialized(bool binary) const;
  /// [bytes] At most.
  std::size_t memoryBytes() const;

 private:
  struct DCCD_HIDDEN Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
