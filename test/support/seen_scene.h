// A room with boxes, and what a camera or a lidar sees of it.
#pragma once

#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "base/cloud_map.h"
#include "dccd/types.h"

namespace dccd {
namespace test {

struct SeenScene {
  Box room;
  std::vector<Box> things;

  static SeenScene make(std::mt19937& random, const Vec3& room_m, int things) {
    std::uniform_real_distribution<double> unit(0, 1);
    SeenScene scene;
    scene.room = Box{-0.5 * room_m, 0.5 * room_m};
    for (int i = 0; i < things; ++i) {
      Box box;
      for (int axis = 0; axis < 3; ++axis) {
        box.min[axis] = scene.room.min[axis] + unit(random) * 0.9 * room_m[axis];
        box.max[axis] = box.min[axis] + (0.02 + 0.15 * unit(random)) * room_m[axis];
      }
      scene.things.push_back(box);
    }
    return scene;
  }

  /// How many times `way` it is from there to what is seen.
  double depth(const Vec3& from, const Vec3& way) const {
    double nearest = std::numeric_limits<double>::infinity();
    const auto cut = [&](const Box& box, bool from_within) {
      double enters = -nearest, leaves = std::numeric_limits<double>::infinity();
      for (int axis = 0; axis < 3; ++axis) {
        double a = (box.min[axis] - from[axis]) / way[axis], b = (box.max[axis] - from[axis]) / way[axis];
        if (a > b) std::swap(a, b);
        enters = std::max(enters, a);
        leaves = std::min(leaves, b);
      }
      const double at = from_within ? leaves : enters;
      if (enters < leaves && at > 0) nearest = std::min(nearest, at);
    };
    cut(room, true);
    for (const Box& box : things) cut(box, false);
    return nearest;
  }

  /// Depths [m], row by row.
  std::vector<float> picture(const Eigen::Isometry3d& camera, const Pinhole& lens, std::size_t width,
                             std::size_t height) const {
    std::vector<float> depths;
    depths.reserve(width * height);
    for (std::size_t v = 0; v < height; ++v) {
      for (std::size_t u = 0; u < width; ++u) {
        const Vec3 way((double(u) - lens.cx) / lens.fx, (double(v) - lens.cy) / lens.fy, 1);
        depths.push_back(static_cast<float>(depth(camera.translation(), camera.linear() * way)));
      }
    }
    return depths;
  }
};

/// The points of a picture, in the camera's frame, in rows.
inline std::vector<float> pointsOf(const std::vector<float>& depths, const Pinhole& lens, std::size_t width) {
  std::vector<float> xyz;
  xyz.reserve(3 * depths.size());
  for (std::size_t i = 0; i < depths.size(); ++i) {
    const double z = static_cast<double>(depths[i]);
    xyz.push_back(static_cast<float>((double(i % width) - lens.cx) / lens.fx * z));
    xyz.push_back(static_cast<float>((double(i / width) - lens.cy) / lens.fy * z));
    xyz.push_back(depths[i]);
  }
  return xyz;
}

/// Points that are finite, in no order: as drivers send them that leave lost points out.
inline std::vector<float> withoutLost(const std::vector<float>& xyz) {
  std::vector<float> left;
  for (std::size_t i = 0; i < xyz.size(); i += 3) {
    if (std::isfinite(xyz[i] + xyz[i + 1] + xyz[i + 2])) left.insert(left.end(), &xyz[i], &xyz[i] + 3);
  }
  return left;
}

inline SensorView viewOf(const Eigen::Isometry3d& pose, const std::vector<float>& xyz, std::size_t width = 0) {
  SensorView view;
  view.map_from_sensor = pose;
  view.width = width > 0 ? width : xyz.size() / 3;
  view.height = view.width > 0 ? xyz.size() / 3 / view.width : 1;
  view.xyz = xyz.data();
  return view;
}
inline SensorView viewOf(const Eigen::Isometry3d& pose, const std::vector<float>& depths, const Pinhole& lens,
                         std::size_t width) {
  SensorView view;
  view.map_from_sensor = pose;
  view.width = width;
  view.height = depths.size() / width;
  view.depth_m = depths.data();
  view.pinhole = lens;
  return view;
}

}  // namespace test
}  // namespace dccd
