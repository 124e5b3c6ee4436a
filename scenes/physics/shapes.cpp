#include "scenes/physics/shapes.h"

#include <algorithm>
#include <cmath>

namespace dccd::scene {
namespace {

Eigen::Quaterniond rotation(const Vec3& rotation_rad) {
  const double angle = rotation_rad.norm();
  if (angle == 0.0) return Eigen::Quaterniond::Identity();
  return Eigen::Quaterniond(Eigen::AngleAxisd(angle, rotation_rad / angle));
}

Vec3 localVertex(const Shape& shape, int row, int col) {
  const double across = shape.cols > 1 ? static_cast<double>(col) / (shape.cols - 1) - 0.5 : 0.0;
  const double along = shape.rows > 1 ? static_cast<double>(row) / (shape.rows - 1) - 0.5 : 0.0;
  switch (shape.kind) {
    case Shape::Kind::TUBE: {
      const double angle = 2.0 * M_PI * col / shape.cols;
      return Vec3(shape.size_m[0] * std::cos(angle), along * shape.size_m[1], shape.size_m[0] * std::sin(angle));
    }
    case Shape::Kind::ROPE:
      return Vec3(across * shape.size_m[0], 0.0, 0.0);
    case Shape::Kind::SHEET:
      break;
  }
  return Vec3(across * shape.size_m[0], along * shape.size_m[1], 0.0);
}

/// The share of the way between two keys after a share of the time. The velocity is zero at both: a gripper that starts
/// with a jerk tears at the cloth.
double smooth(double share) { return share * share * (3.0 - 2.0 * share); }

}  // namespace

Positions startPositions(const Shape& shape) {
  const Eigen::Quaterniond turn = rotation(shape.rotation_rad);
  Positions positions;
  positions.reserve(static_cast<std::size_t>(shape.rows) * shape.cols);
  for (int row = 0; row < shape.rows; ++row) {
    for (int col = 0; col < shape.cols; ++col)
      positions.push_back(shape.center_m + turn * localVertex(shape, row, col));
  }
  return positions;
}

std::vector<Face> shapeFaces(const Shape& shape) {
  std::vector<Face> faces;
  if (shape.kind == Shape::Kind::ROPE) return faces;
  const bool closed = shape.kind == Shape::Kind::TUBE;
  const int cells = closed ? shape.cols : shape.cols - 1;
  for (int row = 0; row + 1 < shape.rows; ++row) {
    for (int col = 0; col < cells; ++col) {
      const int next = (col + 1) % shape.cols;
      const Index a = row * shape.cols + col, b = row * shape.cols + next;
      const Index c = a + shape.cols, d = b + shape.cols;
      if ((row + col) % 2 == 0) {
        faces.push_back({a, b, d});
        faces.push_back({a, d, c});
      } else {
        faces.push_back({a, b, c});
        faces.push_back({b, d, c});
      }
    }
  }
  return faces;
}

Eigen::Isometry3d motionAt(const Motion& motion, const Vec3& centroid_m, double time_s) {
  MotionKey now;
  const auto after = std::upper_bound(motion.begin(), motion.end(), time_s,
                                      [](double time, const MotionKey& key) { return time < key.time_s; });
  if (after == motion.end()) {
    if (!motion.empty()) now = motion.back();
  } else {
    const MotionKey before = after == motion.begin() ? MotionKey{} : *(after - 1);
    const double way = smooth(std::clamp((time_s - before.time_s) / (after->time_s - before.time_s), 0.0, 1.0));
    now.offset_m = before.offset_m + way * (after->offset_m - before.offset_m);
    now.rotation_rad = before.rotation_rad + way * (after->rotation_rad - before.rotation_rad);
  }
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.linear() = rotation(now.rotation_rad).toRotationMatrix();
  pose.translation() = centroid_m + now.offset_m - pose.linear() * centroid_m;
  return pose;
}

double jointAt(const std::vector<JointKey>& keys, double time_s) {
  if (keys.empty()) return 0.0;
  const auto after = std::upper_bound(keys.begin(), keys.end(), time_s,
                                      [](double time, const JointKey& key) { return time < key.time_s; });
  if (after == keys.begin()) return keys.front().position;
  if (after == keys.end()) return keys.back().position;
  const JointKey& before = *(after - 1);
  const double way = smooth((time_s - before.time_s) / (after->time_s - before.time_s));
  return before.position + way * (after->position - before.position);
}

std::vector<Eigen::Isometry3d> posesInParents(const Robot& robot, double time_s) {
  std::vector<Eigen::Isometry3d> poses;
  for (const Link& link : robot.links) {
    poses.push_back(link.origin);
    if (link.parent < 0) poses.back().translation() += robot.base_m;
    const double position = jointAt(link.keys, time_s);
    if (link.joint == Link::Joint::SLIDES) poses.back().translate(position * link.axis);
    if (link.joint == Link::Joint::TURNS) poses.back().rotate(Eigen::AngleAxisd(position, link.axis));
  }
  return poses;
}

std::vector<Eigen::Isometry3d> linkPoses(const Robot& robot, double time_s) {
  std::vector<Eigen::Isometry3d> poses = posesInParents(robot, time_s);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const int parent = robot.links[i].parent;
    if (parent >= 0) poses[i] = poses[static_cast<std::size_t>(parent)] * poses[i];
  }
  return poses;
}

bool contains(const Solid& solid, const Vec3& point_m) {
  if (solid.kind == Solid::Kind::BOX) {
    return (point_m.array() >= solid.box.min.array()).all() && (point_m.array() <= solid.box.max.array()).all();
  }
  return distanceToRing(solid, point_m) <= 0.0;
}

double distanceToRing(const Solid& ring, const Vec3& point_m) {
  const Vec3 from_center = point_m - ring.center_m;
  const double height = from_center.dot(ring.axis);
  const double from_circle = (from_center - height * ring.axis).norm() - ring.radius_m;
  return std::hypot(height, from_circle) - ring.tube_radius_m;
}

Box bounds(const Solid& solid) {
  if (solid.kind == Solid::Kind::BOX) return solid.box;
  Box box;
  const Vec3 reach = Vec3::Constant(solid.radius_m + solid.tube_radius_m);
  box.min = solid.center_m - reach;
  box.max = solid.center_m + reach;
  return box;
}

Solid shrunk(const Solid& solid, double inset_m) {
  Solid inner = solid;
  inner.box.min.array() += inset_m;
  inner.box.max.array() -= inset_m;
  inner.tube_radius_m -= inset_m;
  return inner;
}

bool empty(const Solid& solid) {
  if (solid.kind == Solid::Kind::RING) return !(solid.tube_radius_m > 0.0);
  return !(solid.box.min.array() < solid.box.max.array()).all();
}

}  // namespace dccd::scene
