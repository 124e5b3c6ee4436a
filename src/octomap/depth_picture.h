// What a picture of depths says of a map's cubes: the smallest and the largest depth of squares of pixels tell at once
// that all of a cube was seen through, or nothing of it; single pixels are asked of voxels in between alone.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>

#include "octomap/octree_update.h"

namespace dccd {

/// Lengths are in voxels where no name says otherwise; points are relative to the sensor, along the map's axes.
struct PictureGeometry {
  Eigen::Vector3d sensor;           ///< place in voxels of the map, key 0 beginning at 0
  Eigen::Matrix3d camera_from_map;  ///< rotation
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double off_px = 0;  ///< so far a point may be from the pixel that it is
  double range = 0;   ///< how far is cleared
  double resolution_m = 0;
  const float* xyz = nullptr;    ///< [m] the points in the sensor's frame; null: they are what pixel and depth say
  Eigen::Matrix3d map_from_xyz;  ///< with the scale from metres
  /// Where each pixel's point would be at a depth of 1 m; null: where the middle of the pixel is.
  std::array<const float*, 3> ways{};
};

class DepthPicture {
 public:
  /// Depths [m] of a new picture, row by row, to be written: not a number for what says nothing.
  float* depths(std::size_t width, std::size_t height);
  /// Once they are there.
  void build(const PictureGeometry& geometry);
  std::size_t memoryBytes() const;

  Seen look(const OctreeCube& cube);
  bool crosses(const OctreeCube& cube) const;

 private:
  /// Squares of 2^level pixels a side; level 0 has the depths themselves in both.
  struct Level {
    std::int32_t width = 0, height = 0;
    std::vector<float> nearest, farthest;
    std::vector<std::uint8_t> hole;  // the largest empty square that begins there [px]; none: nothing is empty
  };
  /// Pixels, both ends inclusive.
  struct Area {
    std::int32_t u0 = 0, u1 = -1, v0 = 0, v1 = -1;
  };
  struct Depths {
    float nearest = NOWHERE, farthest = NOWHERE;
    int hole = 0;  // the largest empty square [px]
  };
  static constexpr float NOWHERE = std::numeric_limits<float>::infinity();
  static constexpr int LEVELS = 16, CUBE_DEPTHS = 17;
  static constexpr std::uint64_t NO_CUBE = ~std::uint64_t{0};
  static constexpr int MOST_HOLE = 255;

  PictureGeometry geometry_;
  Eigen::Matrix3d pixel_ways_;  // columns: of pixel (u, v, 1): where it ends at a depth of 1 m
  Eigen::Matrix3d project_;     // rows: x and y, in pixels at a depth of 1 m; depth [m]
  Eigen::Vector3d spread_;      // of a cube of 2 voxels a side along these
  double square_px_ = 0;        // the side of a square that a voxel covers at a depth of 1 m, however it is turned
  std::array<Level, LEVELS> levels_;
  int level_count_ = 0;
  bool has_holes_ = false;
  // The last cube of each depth of the octree all of whose pixels end beyond it, as its place among those: none, if
  // the last of that depth is none.
  std::array<std::uint64_t, CUBE_DEPTHS> beyond_;
  Area area_;  // of the cube that was looked at last
  double nearest_m_ = 0, farthest_m_ = 0;
  std::int32_t center_u_ = 0, center_v_ = 0;

  Depths depthsOf(const Area& area) const;
  void findHoles();
  void reduce(const Level& from, Level& to, bool is_first) const;
  bool passes(std::int32_t u, std::int32_t v, const OctreeCube& cube) const;
};

}  // namespace dccd
