#include "step/parts.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "dccd/mesh_store.h"
#include "dccd/tolerances.h"

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

double radiusOf(const Body& body) {
  double squared = 0;
  for (const Vec3& p : *body.t0) squared = std::max(squared, (p - body.pose_t0.translation()).squaredNorm());
  return std::sqrt(squared);
}

/// A chord leaves its arc by this at most, which is the whole diameter from a full turn on.
double sagitta(double radius, double angle) {
  const double half = std::sin(std::min(angle, 2 * M_PI) / 4);
  return radius * 2 * half * half;
}

/// Holds all of the body's ways through the step. One that turns does so about its frame's origin, which moves
/// straight: on whichever way, no vertex is further from there than its radius.
Eigen::AlignedBox3d sweptBounds(const Step& step, const Body& body, double margin_m) {
  Eigen::AlignedBox3d bounds;
  if (body.turns) {
    const Vec3 from = body.pose_t0.translation();
    bounds.extend(from);
    bounds.extend(Vec3(from + step.pose_scale * (body.pose_t1.translation() - from)));
    margin_m += radiusOf(body);
  } else {
    for (const Positions* positions : {body.t0.get(), body.t1.get()}) {
      for (const Vec3& p : *positions) {
        if (p.allFinite()) bounds.extend(p);
      }
    }
  }
  if (body.radius_m && !body.radius_m->empty()) {
    margin_m += *std::max_element(body.radius_m->begin(), body.radius_m->end());
  }
  bounds.min().array() -= margin_m;
  bounds.max().array() += margin_m;
  return bounds;
}

}  // namespace

double partsFor(const Body& body, double pose_scale, double tolerance_m, const Extent* extent) {
  const double angle = pose_scale * rotationAngle(body.pose_t0, body.pose_t1);
  const auto isStraight = [&](double radius) { return sagitta(radius, angle) <= tolerance_m; };
  // The farthest corner of what its vertices span is no nearer than any of them, also as it is rounded.
  if (extent && extent->of == body.t0 && extent->is_finite) {
    const Vec3 centre = body.pose_t0.translation();
    const Vec3 corner = (extent->lo - centre).cwiseAbs().cwiseMax((extent->hi - centre).cwiseAbs());
    if (isStraight(corner.norm())) return 1;
  }
  const double radius = radiusOf(body);
  return isStraight(radius) ? 1 : std::ceil(angle / (2 * std::acos(1 - tolerance_m / radius)));
}

double leavesArcBy(const Body& body, double pose_scale, double parts) {
  if (!body.turns) return 0;
  const double radius = radiusOf(body);
  double largest = radius;
  for (const Eigen::Isometry3d* pose : {&body.pose_t0, &body.pose_t1})
    largest = std::max(largest, pose->translation().cwiseAbs().maxCoeff() + radius);
  const double angle = pose_scale * rotationAngle(body.pose_t0, body.pose_t1);
  return (sagitta(radius, angle / parts) + tolerance::CLEARANCE * largest) * (1 + tolerance::CLEARANCE);
}

std::size_t neededParts(const Step& step, double tolerance_m, const std::vector<SceneBody>& before, double apart_m) {
  std::vector<std::optional<Eigen::AlignedBox3d>> bounds(step.bodies.size());
  // The tolerance is far above all rounding. A distance is told less what both bodies leave their arcs by.
  const double margin_m = std::max(largestSeparation(step.bodies), apart_m / 2) + tolerance_m;
  const auto boundsOf = [&](std::size_t b) -> const Eigen::AlignedBox3d& {
    const double leaves_m = apart_m > 0 && !bounds[b] ? leavesArcBy(step.bodies[b], step.pose_scale, 1) : 0;
    if (!bounds[b]) bounds[b] = sweptBounds(step, step.bodies[b], margin_m + leaves_m);
    return *bounds[b];
  };
  const auto isNear = [&](std::size_t b) {
    if (meetsMap(step.bodies[b]) && step.map.surface) return true;
    for (std::size_t other = 0; other < step.bodies.size(); ++other) {
      const bool tested = other != b && meet(step.bodies[b], b, step.bodies[other], other);
      if (tested && boundsOf(b).intersects(boundsOf(other))) return true;
    }
    return false;
  };
  double parts = 1;
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const Body& body = step.bodies[b];
    if (!body.turns) continue;
    const double own =
        partsFor(body, step.pose_scale, tolerance_m, b < before.size() ? &before[b].extents[1] : nullptr);
    if (own > parts && isNear(b)) parts = own;
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
