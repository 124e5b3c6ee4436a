// Where a contact of an outcome is, for display and control; nothing is decided here, so plain double will do.
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "dccd/outcome.h"
#include "step/pairs/closest_points.h"
#include "step/parts.h"

namespace dccd {

namespace {

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

/// The straight part of the step in which a contact begins: a turning body's step is tested in several.
struct Part {
  const Step& step;
  std::size_t parts, part;
  double toc;  ///< [0,1] within the part

  Part(const Outcome& outcome, const Contact& contact)
      : step(*outcome.step), parts(std::max<std::size_t>(outcome.substeps, 1)) {
    const double along = contact.toc_lower * static_cast<double>(parts);
    part = std::min(static_cast<std::size_t>(along), parts - 1);
    toc = std::min(along - static_cast<double>(part), 1.0);
  }
  Vec3 from(std::size_t body, Index vertex) const { return placeVertex(step, body, vertex, part, parts); }
  Vec3 to(std::size_t body, Index vertex) const { return placeVertex(step, body, vertex, part + 1, parts); }
};

ContactGeometry obstacleGeometry(const Outcome& outcome, const Contact& contact) {
  const Part part(outcome, contact);
  const auto mapAt = [&](double t) {
    return outcome.step->map.fromFixedAt((static_cast<double>(part.part) + t) / static_cast<double>(part.parts));
  };
  const Eigen::Isometry3d map_at_start = mapAt(0), map_at_end = mapAt(1);
  Feature feature;
  const int points = factsOf(contact.kind).vertices[0];
  for (int i = 0; i < points; ++i) {
    const Vec3 from = map_at_start * part.from(contact.body[0], contact.vertex[i]);
    const Vec3 to = map_at_end * part.to(contact.body[0], contact.vertex[i]);
    feature.at[i] = from + part.toc * (to - from);
    feature.motion[i] = static_cast<double>(part.parts) * (to - from);
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
  const Eigen::Isometry3d fixed_from_map = mapAt(part.toc).inverse();
  out.point = fixed_from_map * out.point;
  out.normal = fixed_from_map.linear() * out.normal;
  return out;
}

}  // namespace

ContactGeometry contactGeometry(const Outcome& outcome, const Contact& contact) {
  if (contact.body[1] == OBSTACLE_BODY) return obstacleGeometry(outcome, contact);
  const Part part(outcome, contact);
  PairMotion pair;
  for (int i = 0; i < 4; ++i) {
    const std::uint16_t body = contact.bodyOf(i);
    std::copy_n(part.from(body, contact.vertex[i]).data(), 3, pair.x[0][i]);
    std::copy_n(part.to(body, contact.vertex[i]).data(), 3, pair.x[1][i]);
  }
  ContactGeometry geometry = contactGeometry(contact.kind, pair, part.toc);
  geometry.approach_speed *= static_cast<double>(part.parts);
  return geometry;
}

Vec3 vertexAtContact(const Outcome& outcome, const Contact& contact, int i) {
  const Part part(outcome, contact);
  const std::uint16_t body = contact.bodyOf(i);
  const Vec3 from = part.from(body, contact.vertex[i]);
  return from + part.toc * (part.to(body, contact.vertex[i]) - from);
}

}  // namespace dccd
