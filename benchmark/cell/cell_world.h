// Of the cell of cell_publisher: how it is set, and what moves in it: an arm, and a cloth in its hand.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <kdl_parser/kdl_parser.hpp>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "robot/robot_model.h"

namespace dccd {
namespace benchmarks {

using Pose = Eigen::Isometry3d;

struct Settings {
  std::string urdf, out, monitor;
  std::vector<std::string> processes;  // NAME=PID
  double camera_hz = 15, noise_m = 0.003, lost_share = 0.05, flying_share = 0.001, start_s = 5, seconds = 20;
  bool clouds = false, images = false;
  int stride = 1;
};

// The cloth's rate is not a multiple of the camera's, so that each phase between the two comes. Frames come later than
// their stamps: a tracker takes a picture's time, a camera's driver less.
constexpr double JOINT_HZ = 100, CLOTH_HZ = 29.9, TRACKER_LAG_S = 0.03, DRIVER_LAG_S = 0.025;
// When the cloth comes, is seen, and the arm sets off; how long it takes to and fro.
constexpr double CLOTH_S = 2, SEEN_S = 2.2, MOVES_S = 2.5, PERIOD_S = 8;
constexpr int ROWS = 20, COLS = 30, JOINTS = 6;
constexpr double SPACING_M = 0.015;
inline const std::array<std::string, JOINTS> NAMES{"shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint",
                                                   "wrist_1_joint",      "wrist_2_joint",       "wrist_3_joint"};

/// 0 to 1 and back, from rest to rest.
inline double wayAt(double time_s) {
  return 0.5 - 0.5 * std::cos(2 * M_PI * std::max(0.0, time_s - MOVES_S) / PERIOD_S);
}

inline std::array<double, JOINTS> jointsAt(double time_s) {
  const double way = wayAt(time_s);
  // The hand points down, half a metre before the base.
  return {-0.7 + 1.4 * way, -1.57 + 0.15 * way, 1.17, -1.17 - 0.15 * way, -1.57, 0.6 * way};
}

class Arm {
 public:
  explicit Arm(const std::string& urdf) {
    if (!kdl_parser::treeFromString(urdf, tree_)) throw std::runtime_error("KDL cannot read the robot");
    robot_ = makeRobot({"urdf", urdf, ""}, {}, {}, 1e-3);
    if (!robot_.missing.empty()) throw std::runtime_error(robot_.missing.front());
  }
  const Robot& robot() const { return robot_; }

  std::map<std::string, Pose> linksAt(double time_s) const {
    const auto joints = jointsAt(time_s);
    std::map<std::string, Pose> links{{tree_.getRootSegment()->first, Pose::Identity()}};
    const std::function<void(const KDL::TreeElement&)> go = [&](const KDL::TreeElement& parent) {
      for (const auto& child : parent.children) {
        const KDL::Segment& segment = child->second.segment;
        const auto joint = std::find(NAMES.begin(), NAMES.end(), segment.getJoint().getName());
        const KDL::Frame frame =
            segment.pose(joint == NAMES.end() ? 0 : joints[static_cast<std::size_t>(joint - NAMES.begin())]);
        Pose pose = Pose::Identity();
        for (int row = 0; row < 3; ++row) {
          for (int col = 0; col < 3; ++col) pose.linear()(row, col) = frame.M(row, col);
          pose.translation()[row] = frame.p(row);
        }
        links[segment.getName()] = links.at(parent.segment.getName()) * pose;
        go(child->second);
      }
    };
    go(tree_.getRootSegment()->second);
    return links;
  }

 private:
  KDL::Tree tree_;
  Robot robot_;
};

/// It hangs from the flange, of which it is held 3 mm inside, swings and ripples.
inline Positions clothAt(const Pose& tool, double time_s) {
  const Vec3 along = Vec3(tool.linear()(0, 0), tool.linear()(1, 0), 0).normalized(),
             across = Vec3::UnitZ().cross(along);
  const double turn = 2 * M_PI * std::max(0.0, time_s - MOVES_S) / PERIOD_S, swing = 0.08 * std::sin(6 * turn);
  Positions cloth;
  for (int row = 0; row < ROWS; ++row) {
    for (int col = 0; col < COLS; ++col) {
      const double down = SPACING_M * row, aside = SPACING_M * (col - 0.5 * (COLS - 1));
      const double ripple = 0.02 * down * std::sin(25 * aside + 4 * turn);
      cloth.push_back(tool.translation() + Vec3(0, 0, 0.003 - down * std::cos(swing)) + aside * along +
                      (down * std::sin(swing) + ripple) * across);
    }
  }
  return cloth;
}

inline std::vector<Face> clothFaces() {
  std::vector<Face> faces;
  for (Index row = 0; row + 1 < ROWS; ++row) {
    for (Index col = 0; col + 1 < COLS; ++col) {
      const Index at = row * COLS + col;
      faces.push_back({at, at + 1, at + COLS});
      faces.push_back({at + 1, at + COLS + 1, at + COLS});
    }
  }
  return faces;
}

}  // namespace benchmarks
}  // namespace dccd
