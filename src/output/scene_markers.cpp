// What surrounds a step's contacts: the map and the bodies.
#include "output/marker_drawing.h"

#include <algorithm>
#include <cmath>
#include <map>

#include <tf2_eigen/tf2_eigen.h>

namespace dccd {

namespace {

using visualization_msgs::Marker;

constexpr double SHOWN_EDGE = 0.97;  // of its edge: a cube a little smaller, so that one shows beside the next

/// By a point, if that is finite.
void widen(Box& box, const Vec3& p) {
  if (!p.allFinite()) return;
  box.min = box.min.cwiseMin(p);
  box.max = box.max.cwiseMax(p);
}

/// Box around all bodies at the end of the step, in the map's frame.
Box boundsInMap(const Outcome& outcome) {
  Box box;
  for (const Body& body : outcome.step->bodies) {
    for (const Vec3& p : *body.t1) widen(box, outcome.step->map.fromFixedAt(1) * p);
  }
  return box;
}

/// Of the map around the bodies more are not drawn: it may have millions, and a marker of so many is of no use to
/// anybody.
constexpr std::size_t MAX_VOXELS_SHOWN = 200000;

void addObstacle(MarkerDrawing& drawing) {
  const Outcome& outcome = drawing.outcome;
  const double within_m = drawing.config.obstacle_m;
  if (!outcome.obstacle || within_m <= 0) return;
  const Box bodies = boundsInMap(outcome);
  const double resolution = outcome.obstacle->resolution();
  std::map<std::uint32_t, Marker> by_size;  // one list of cubes for each size of leaf
  std::size_t shown = 0;
  for (const OccupiedLeaf& leaf : outcome.obstacle->leaves()) {
    if (shown == MAX_VOXELS_SHOWN) break;
    const double edge = leaf.size * resolution;
    const Vec3 min = voxelMin(leaf.min, resolution), max = min + Vec3::Constant(edge);
    if ((min.array() > bodies.max.array() + within_m).any()) continue;
    if ((max.array() < bodies.min.array() - within_m).any()) continue;
    ++shown;
    const auto [list, is_new] = by_size.try_emplace(leaf.size);
    if (is_new) {
      list->second = drawing.makeInMap("obstacle", Marker::CUBE_LIST, SHOWN_EDGE * edge);
      list->second.id = static_cast<int>(leaf.size);
      list->second.color = color(0.62, 0.62, 0.6);
    }
    list->second.points.push_back(point(min + Vec3::Constant(0.5 * edge)));
  }
  for (auto& voxels : by_size) drawing.add(std::move(voxels.second));
}

/// What is a body's own, and what is in doubt, is no obstacle and not among those above.
void addOwn(MarkerDrawing& drawing) {
  const auto& voxels = drawing.outcome.step->map.own.voxels;
  if (!drawing.outcome.obstacle || !voxels) return;
  const double edge = drawing.outcome.obstacle->resolution();
  Marker marker = drawing.makeInMap("own", Marker::CUBE_LIST, SHOWN_EDGE * edge);
  for (std::size_t i = 0; i < std::min(voxels->size(), MAX_VOXELS_SHOWN); ++i) {
    const OwnVoxel& voxel = (*voxels)[i];
    marker.points.push_back(point(voxelMin(voxel.key, edge) + Vec3::Constant(0.5 * edge)));
    marker.colors.push_back(voxel.doubted ? color(0.95, 0.75, 0.2, 0.4) : color(0.35, 0.65, 0.45, 0.25));
  }
  drawing.add(std::move(marker));
}

// RViz draws nothing on top of anything: contacts shine through.
constexpr double BODY_ALPHA = 0.7;

/// Shaded by the angle to a light above, the back in another tint: RViz itself leaves backs of faces black, and a fold
/// shows both sides.
std_msgs::ColorRGBA shaded(const Vec3& a, const Vec3& b, const Vec3& c) {
  static const Vec3 LIGHT = Vec3(0.4, 0.3, 0.87).normalized();
  const Vec3 normal = (b - a).cross(c - a);
  const double length = normal.norm();
  const double cosine = length > 0 ? normal.dot(LIGHT) / length : 0;
  const double light = 0.45 + 0.55 * std::abs(cosine);
  if (cosine >= 0) return color(0.36 * light, 0.58 * light, light, BODY_ALPHA);
  return color(0.30 * light, 0.62 * light, 0.70 * light, BODY_ALPHA);
}

void addTriangle(const Vec3& a, const Vec3& b, const Vec3& c, Marker& marker) {
  for (const Vec3* p : {&a, &b, &c}) marker.points.push_back(point(*p));
  marker.colors.insert(marker.colors.end(), 3, shaded(a, b, c));
}

void addMeshes(MarkerDrawing& drawing) {
  for (std::size_t b = 0; b < drawing.bodies.size(); ++b) {
    const Topology& topology = *drawing.outcome.step->bodies[b].topology;
    const Positions& at = *drawing.outcome.step->bodies[b].t1;
    const std::string& name = drawing.bodies[b].name;
    const bool has_faces = topology.hasFaces();
    Marker marker = drawing.make("mesh/" + name, has_faces ? Marker::TRIANGLE_LIST : Marker::LINE_LIST,
                                 has_faces ? 1.0 : 0.8 * drawing.config.point_size_m);
    marker.color = color(0.36, 0.58, 1, BODY_ALPHA);
    for (const auto& f : topology.faces()) {
      if (at[f[0]].allFinite() && at[f[1]].allFinite() && at[f[2]].allFinite()) {
        addTriangle(at[f[0]], at[f[1]], at[f[2]], marker);
      }
    }
    for (const auto& e : topology.edges()) {
      if (has_faces || !at[e[0]].allFinite() || !at[e[1]].allFinite()) continue;
      for (const Index v : e) marker.points.push_back(point(at[v]));
    }
    if (marker.points.empty()) continue;
    drawing.add(std::move(marker));
    Box box;
    for (const Vec3& p : at) widen(box, p);
    const Vec3 middle = 0.5 * (box.min + box.max);
    const Vec3 above(middle.x(), middle.y(), box.max.z() + drawing.textHeight());
    drawing.addText("mesh/" + name, 1, above, color(0.75, 0.85, 1), name);
  }
}

}  // namespace

void addScene(MarkerDrawing& drawing) {
  addObstacle(drawing);
  addOwn(drawing);
  if (drawing.config.mesh) addMeshes(drawing);
}

}  // namespace dccd
