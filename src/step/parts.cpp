#include "step/parts.h"

#include <algorithm>
#include <cmath>

#include "dccd/mesh_store.h"

namespace dccd {
namespace {

double rotationAngle(const Eigen::Isometry3d& a, const Eigen::Isometry3d& b) {
  const Eigen::Quaterniond turn(a.linear().transpose() * b.linear());
  return 2 * std::atan2(turn.vec().norm(), std::abs(turn.w()));
}

/// What moves a turning body from t0 to where it is at the fraction u of the step.
Eigen::Isometry3d movedBy(const Step& step, const Body& body, double u) {
  return interpolate(body.pose_t0, body.pose_t1, u * step.pose_scale) * body.pose_t0.inverse();
}

}  // namespace

std::size_t requiredSubsteps(const Step& step, double tolerance_m) {
  double parts = 1;
  for (const Body& body : step.bodies) {
    if (!body.turns) continue;
    const double angle = step.pose_scale * rotationAngle(body.pose_t0, body.pose_t1);
    double radius = 0;
    for (const Vec3& p : *body.t0) radius = std::max(radius, (p - body.pose_t0.translation()).norm());
    // A chord leaves its arc by radius (1 - cos(angle / 2)) at most, which is the whole diameter from a full turn on.
    if (radius * (1 - std::cos(std::min(angle, 2 * M_PI) / 2)) <= tolerance_m) continue;
    parts = std::max(parts, std::ceil(angle / (2 * std::acos(1 - tolerance_m / radius))));
  }
  return parts < 1e9 ? static_cast<std::size_t>(parts) : static_cast<std::size_t>(1e9);
}

void advance(const Step& step, std::size_t part, std::size_t parts, Step& at) {
  const double u = static_cast<double>(part) / static_cast<double>(parts);
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Body& body = step.bodies[b];
    Body& moved = at.bodies[b];
    moved.t0 = moved.t1;
    if (part == parts) {
      moved.t1 = body.t1;
      continue;
    }
    auto end = std::make_shared<Positions>();
    if (body.turns) {
      const Eigen::Isometry3d motion = movedBy(step, body, u);
      end->resize(body.t0->size());
      for (std::size_t v = 0; v < end->size(); ++v) (*end)[v] = motion * (*body.t0)[v];
    } else {
      interpolate(*body.t0, *body.t1, u, *end);
    }
    moved.t1 = std::move(end);
  }
}

Vec3 placeVertex(const Step& step, std::size_t b, Index vertex, std::size_t part, std::size_t parts) {
  const Body& body = step.bodies[b];
  const Vec3 &from = (*body.t0)[vertex], &to = (*body.t1)[vertex];
  if (part == 0 || part == parts) return part == 0 ? from : to;
  const double u = static_cast<double>(part) / static_cast<double>(parts);
  return body.turns ? Vec3(movedBy(step, body, u) * from) : Vec3(from + u * (to - from));
}

}  // namespace dccd
