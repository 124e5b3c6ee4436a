// The rays of points in no order. Near the sensor, where a voxel covers several cells of direction, the cells are the
// pixels of pictures, each with the farthest of its points; beyond, rays are followed one by one.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <Eigen/Core>

#include "base/cloud_map.h"
#include "octomap/depth_picture.h"
#include "octomap/passed_voxels.h"

namespace dccd {

struct ViewLimits;

class CloudRays {
 public:
  /// Of a view's points. most_bytes: what they may take.
  void read(const SensorView& view, const ViewLimits& limits, std::size_t most_bytes);
  std::size_t memoryBytes() const;
  /// There was no room for all rays.
  bool isFull() const { return followed_.isFull(); }

  Seen look(const OctreeCube& cube);
  bool crosses(const OctreeCube& cube) const;

 private:
  /// A picture whose pixel (u, v) is the cell of the directions (x, y, 1) with u - 0.5 <= x * focal + cx < u + 0.5.
  struct Face {
    Eigen::Matrix3d from_sensor;
    Eigen::Array2d lo, hi;  // of x and y
    bool is_seen = false;   // a point lies there
    std::int32_t width = 0, height = 0;
    float* depths = nullptr;
    std::vector<std::uint32_t> points;  // of its pixels, where depths say that there is one
    std::array<std::vector<float>, 3> ways;
    DepthPicture picture;
  };
  std::array<Face, 6> faces_;
  std::size_t face_count_ = 0;
  unsigned asked_ = 0;  // of faces, as bits: crosses() has to ask
  double farthest_m_ = 0;
  Eigen::Vector3d sensor_;  // in voxels
  Eigen::Matrix3d sensor_from_map_;
  PassedVoxels followed_;
  std::vector<std::uint64_t> recent_;  // ends of rays

  bool measure(const SensorView& view, double near2);
  void fill(const SensorView& view, double near2, double focal);
  void setWays(const SensorView& view, const Eigen::Matrix3d& from_meters, Face& face);
  void follow(const SensorView& view, double near2, const Eigen::Vector3d& sensor, const Eigen::Matrix3d& from_meters,
              double from, double to);
  std::size_t faceOf(const Eigen::Vector3d& point) const;
};

}  // namespace dccd
