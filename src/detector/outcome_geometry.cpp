// Where a contact of an outcome is, for display and control; nothing is decided here, so plain double will do.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "deformable_ccd/monitor.h"

namespace deformable_ccd {

namespace {

struct Closest {
  double u = 0, v = 0;  // along the first and the second segment
  Vec3 on_first = Vec3::Zero(), on_second = Vec3::Zero();
};

/// Closest points of segments a and b by alternating projection onto the closed segments: for two segments, solving for
/// u, clamping, projecting and clamping again is exact (Ericson, Real-Time Collision Detection, 5.1.9).
Closest closestOnSegments(const Vec3& a0, const Vec3& a1, const Vec3& b0, const Vec3& b1) {
  const Vec3 da = a1 - a0, db = b1 - b0, between = a0 - b0;
  const double aa = da.squaredNorm(), bb = db.squaredNorm(), ab = da.dot(db);
  const double denominator = aa * bb - ab * ab;
  const auto unit = [](double x) { return std::isfinite(x) ? std::clamp(x, 0.0, 1.0) : 0.0; };
  Closest out;
  out.u = unit((ab * db.dot(between) - bb * da.dot(between)) / denominator);
  out.v = unit((ab * out.u + db.dot(between)) / bb);
  out.u = unit((ab * out.v - da.dot(between)) / aa);
  out.on_first = a0 + out.u * da;
  out.on_second = b0 + out.v * db;
  return out;
}

/// Barycentric weights of p's projection onto the triangle's plane, clamped into the triangle.
std::array<double, 3> barycentric(const Vec3& p, const Vec3& f0, const Vec3& f1, const Vec3& f2) {
  const Vec3 e1 = f1 - f0, e2 = f2 - f0, d = p - f0;
  const double d11 = e1.dot(e1), d12 = e1.dot(e2), d22 = e2.dot(e2), dp1 = d.dot(e1), dp2 = d.dot(e2);
  const double denominator = d11 * d22 - d12 * d12;
  double w1 = (d22 * dp1 - d12 * dp2) / denominator, w2 = (d11 * dp2 - d12 * dp1) / denominator;
  if (!std::isfinite(w1) || !std::isfinite(w2)) w1 = w2 = 1.0 / 3;
  w1 = std::clamp(w1, 0.0, 1.0);
  w2 = std::clamp(w2, 0.0, 1.0 - w1);
  return {1 - w1 - w2, w1, w2};
}

Vec3 unitOr(const Vec3& v, const Vec3& fallback) {
  const double n = v.norm();
  return n > 0 && std::isfinite(n) ? Vec3(v / n) : fallback;
}

/// The mesh feature's points in the map's frame at toc, and their displacement over the step.
struct Feature {
  std::array<Vec3, 3> at, motion;
};

struct Cube {
  Vec3 min, max;
  Vec3 centre() const { return 0.5 * (min + max); }
  Vec3 corner(int k) const { return {k & 1 ? max.x() : min.x(), k & 2 ? max.y() : min.y(), k & 4 ? max.z() : min.z()}; }
};

void vertexOnFace(const Feature& f, const Cube& cube, ContactGeometry& out) {
  // The face it meets is the one whose plane it is nearest to.
  double nearest = std::numeric_limits<double>::infinity();
  for (int side = 0; side < 6; ++side) {
    const int axis = side / 2;
    const double plane = side & 1 ? cube.max[axis] : cube.min[axis];
    const double distance = std::abs(f.at[0][axis] - plane);
    if (distance >= nearest) continue;
    nearest = distance;
    out.normal = Vec3::Zero();
    out.normal[axis] = side & 1 ? 1 : -1;
  }
  out.point = f.at[0];
  out.weights = {1, 0, 0, 0};
  out.approach_speed = -out.normal.dot(f.motion[0]);
}

void edgeOnEdge(const Feature& f, const Cube& cube, ContactGeometry& out) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 8; ++k) {
    for (int axis = 0; axis < 3; ++axis) {
      if (k & (1 << axis)) continue;
      const Vec3 b0 = cube.corner(k), b1 = cube.corner(k | (1 << axis));
      const Closest c = closestOnSegments(f.at[0], f.at[1], b0, b1);
      const double distance = (c.on_first - c.on_second).squaredNorm();
      if (distance >= nearest) continue;
      nearest = distance;
      out.point = 0.5 * (c.on_first + c.on_second);
      out.weights = {1 - c.u, c.u, 1 - c.v, c.v};
      const Vec3 outwards = unitOr(0.5 * (b0 + b1) - cube.centre(), Vec3::UnitZ());
      out.normal = unitOr((f.at[1] - f.at[0]).cross(b1 - b0), outwards);
      if (out.normal.dot(outwards) < 0) out.normal = -out.normal;
    }
  }
  out.approach_speed = -out.normal.dot(out.weights[0] * f.motion[0] + out.weights[1] * f.motion[1]);
}

void faceOnCorner(const Feature& f, const Cube& cube, ContactGeometry& out) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int k = 0; k < 8; ++k) {
    const Vec3 corner = cube.corner(k);
    const auto w = barycentric(corner, f.at[0], f.at[1], f.at[2]);
    const Vec3 on_face = w[0] * f.at[0] + w[1] * f.at[1] + w[2] * f.at[2];
    const double distance = (on_face - corner).squaredNorm();
    if (distance >= nearest) continue;
    nearest = distance;
    out.point = 0.5 * (on_face + corner);
    out.weights = {w[0], w[1], w[2], 1};
    const Vec3 outwards = unitOr(corner - cube.centre(), Vec3::UnitZ());
    out.normal = unitOr((f.at[1] - f.at[0]).cross(f.at[2] - f.at[0]), outwards);
    if (out.normal.dot(outwards) < 0) out.normal = -out.normal;
  }
  const Vec3 motion = out.weights[0] * f.motion[0] + out.weights[1] * f.motion[1] + out.weights[2] * f.motion[2];
  out.approach_speed = -out.normal.dot(motion);
}

ContactGeometry obstacleGeometry(const StepOutcome& outcome, const core::Contact& contact) {
  const Positions& t0 = (*outcome.positions_t0)[contact.body[0]];
  const Positions& t1 = (*outcome.positions_t1)[contact.body[0]];
  Feature feature;
  const int points = contact.kind == PairKind::VERTEX_VOXEL_FACE ? 1 : contact.kind == PairKind::EDGE_VOXEL_EDGE ? 2 : 3;
  for (int i = 0; i < points; ++i) {
    const Vec3 from = outcome.map_from_fixed * t0[contact.vertex[i]], to = outcome.map_from_fixed * t1[contact.vertex[i]];
    feature.at[i] = from + contact.toc_lower * (to - from);
    feature.motion[i] = to - from;
  }
  const double resolution = outcome.obstacle->resolution();
  const std::int64_t size = contact.voxel_size;
  const Cube cube{{voxelPlane(contact.voxel.x, resolution), voxelPlane(contact.voxel.y, resolution),
                   voxelPlane(contact.voxel.z, resolution)},
                  {voxelPlane(contact.voxel.x + size, resolution), voxelPlane(contact.voxel.y + size, resolution),
                   voxelPlane(contact.voxel.z + size, resolution)}};
  ContactGeometry out;
  if (points == 1) vertexOnFace(feature, cube, out);
  if (points == 2) edgeOnEdge(feature, cube, out);
  if (points == 3) faceOnCorner(feature, cube, out);
  const Eigen::Isometry3d fixed_from_map = outcome.map_from_fixed.inverse();
  out.point = fixed_from_map * out.point;
  out.normal = fixed_from_map.linear() * out.normal;
  return out;
}

}  // namespace

ContactGeometry contactGeometry(const StepOutcome& outcome, const core::Contact& contact) {
  if (contact.body[1] == OBSTACLE_BODY) return obstacleGeometry(outcome, contact);
  PairMotion pair;
  const int first = contact.kind == PairKind::VERTEX_FACE ? 1 : 2;  // points of body[0]
  for (int i = 0; i < 4; ++i) {
    const std::uint16_t body = contact.body[i < first ? 0 : 1];
    for (int axis = 0; axis < 3; ++axis) {
      pair.x[0][i][axis] = (*outcome.positions_t0)[body][contact.vertex[i]][axis];
      pair.x[1][i][axis] = (*outcome.positions_t1)[body][contact.vertex[i]][axis];
    }
  }
  return contactGeometry(contact.kind, pair, contact.toc_lower);
}

}  // namespace deformable_ccd
