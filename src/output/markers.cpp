#include "output/markers.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace dccd {

namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

std_msgs::ColorRGBA color(double r, double g, double b, double a = 1) {
  std_msgs::ColorRGBA out;
  out.r = static_cast<float>(r);
  out.g = static_cast<float>(g);
  out.b = static_cast<float>(b);
  out.a = static_cast<float>(a);
  return out;
}

geometry_msgs::Point point(const Vec3& p) {
  geometry_msgs::Point out;
  out.x = p.x();
  out.y = p.y();
  out.z = p.z();
  return out;
}

Marker list(const Outcome& outcome, const std::string& frame, const std::string& ns, int type, double scale) {
  Marker marker;
  marker.header.frame_id = frame;
  marker.header.stamp = toRosTime(outcome.stamp_ns);
  marker.ns = ns;
  marker.type = type;
  marker.action = Marker::ADD;
  marker.pose.orientation.w = 1;
  marker.scale.x = marker.scale.y = marker.scale.z = scale;
  marker.color = color(1, 1, 1);
  return marker;
}

/// The mesh face that takes part, at the time of contact; nothing for edge pairs.
void addFace(const Outcome& outcome, const Contact& contact, Marker& faces) {
  int first = -1;
  if (contact.kind == PairKind::VERTEX_FACE) first = 1;
  if (contact.kind == PairKind::FACE_VOXEL_CORNER) first = 0;
  if (first < 0) return;
  for (int i = first; i < first + 3; ++i) {
    faces.points.push_back(point(vertexAtContact(outcome, contact, i)));
    faces.colors.push_back(faces.color);  // with colours of its own a list is drawn unlit, so that no side is black
  }
}

/// Voxels of a map: one list of cubes for each size of leaf.
using VoxelLists = std::map<std::uint32_t, Marker>;

Vec3 voxelMin(const VoxelKey& key, double resolution_m) {
  return {voxelPlane(key.x, resolution_m), voxelPlane(key.y, resolution_m), voxelPlane(key.z, resolution_m)};
}

/// The list for leaves of this size, in the map's pose; `share` of the edge is drawn.
Marker& voxelList(const Outcome& outcome, const std::string& frame, const std::string& ns, std::uint32_t size,
                  double share, const std_msgs::ColorRGBA& rgba, VoxelLists& by_size) {
  const auto found = by_size.find(size);
  if (found != by_size.end()) return found->second;
  Marker marker = list(outcome, frame, ns, Marker::CUBE_LIST, share * size * outcome.obstacle->resolution());
  marker.id = static_cast<int>(size);
  marker.color = rgba;
  const Eigen::Isometry3d pose = outcome.step->map.map_from_fixed.inverse();
  const Eigen::Quaterniond q(pose.linear());
  marker.pose.position = point(pose.translation());
  marker.pose.orientation.x = q.x();
  marker.pose.orientation.y = q.y();
  marker.pose.orientation.z = q.z();
  marker.pose.orientation.w = q.w();
  return by_size.emplace(size, std::move(marker)).first->second;
}

/// Box around all bodies at the end of the step, in the map's frame.
Box boundsInMap(const Outcome& outcome) {
  Box box;
  for (const Body& body : outcome.step->bodies) {
    for (const Vec3& p : *body.t1) {
      if (!p.allFinite()) continue;
      const Vec3 in_map = outcome.step->map.map_from_fixed * p;
      box.min = box.min.cwiseMin(in_map);
      box.max = box.max.cwiseMax(in_map);
    }
  }
  return box;
}

/// The map around the bodies: cubes a little smaller than the voxels, so that those that were hit show.
/// More are not drawn: a map may have millions, and a marker of so many is of no use to anybody.
constexpr std::size_t MAX_VOXELS_SHOWN = 200000;

void addObstacle(const Outcome& outcome, double within_m, const std::string& frame, MarkerArray& out) {
  if (!outcome.obstacle || within_m <= 0) return;
  const Box bodies = boundsInMap(outcome);
  const double resolution = outcome.obstacle->resolution();
  VoxelLists by_size;
  std::size_t shown = 0;
  for (const OccupiedLeaf& leaf : outcome.obstacle->leaves()) {
    if (shown == MAX_VOXELS_SHOWN) break;
    const double edge = leaf.size * resolution;
    const Vec3 min = voxelMin(leaf.min, resolution), max = min + Vec3::Constant(edge);
    if ((min.array() > bodies.max.array() + within_m).any()) continue;
    if ((max.array() < bodies.min.array() - within_m).any()) continue;
    ++shown;
    voxelList(outcome, frame, "obstacle", leaf.size, 0.97, color(0.62, 0.62, 0.6), by_size)
        .points.push_back(point(min + Vec3::Constant(0.5 * edge)));
  }
  for (auto& voxels : by_size) out.markers.push_back(std::move(voxels.second));
}

void addVoxel(const Outcome& outcome, const Contact& contact, const std::string& frame, VoxelLists& by_size) {
  if (contact.body[1] != OBSTACLE_BODY) return;
  const double resolution = outcome.obstacle->resolution();
  const geometry_msgs::Point centre =
      point(voxelMin(contact.voxel, resolution) + Vec3::Constant(0.5 * contact.voxel_size * resolution));
  // Contacts come sorted by feature, so one voxel comes many times; once is enough where it is next to itself.
  auto& points = voxelList(outcome, frame, "voxels", contact.voxel_size, 1, color(0.9, 0.4, 0.1, 0.5), by_size).points;
  if (points.empty() || points.back().x != centre.x || points.back().y != centre.y || points.back().z != centre.z) {
    points.push_back(centre);
  }
}

/// Shaded by the angle to a light above, the back in another tint: RViz itself leaves backs of faces black, and a fold
/// shows both sides.
std_msgs::ColorRGBA shaded(const Vec3& a, const Vec3& b, const Vec3& c) {
  static const Vec3 LIGHT = Vec3(0.4, 0.3, 0.87).normalized();
  const Vec3 normal = (b - a).cross(c - a);
  const double length = normal.norm();
  const double cosine = length > 0 ? normal.dot(LIGHT) / length : 0;
  const double light = 0.45 + 0.55 * std::abs(cosine);
  if (cosine >= 0) return color(0.36 * light, 0.58 * light, light, 0.85);
  return color(0.30 * light, 0.62 * light, 0.70 * light, 0.85);
}

void addMeshes(const Outcome& outcome, const std::vector<Body>& bodies, const MarkerConfig& config,
               const std::string& frame, MarkerArray& out) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const Topology& topology = *outcome.step->bodies[b].topology;
    const Positions& at = *outcome.step->bodies[b].t1;
    const bool rope = !topology.hasFaces();
    Marker marker = list(outcome, frame, "mesh/" + bodies[b].name, rope ? Marker::LINE_LIST : Marker::TRIANGLE_LIST,
                         rope ? config.line_width_m : 1.0);
    marker.color = color(0.3, 0.5, 0.9, 0.6);
    const auto add = [&](const auto& feature) {
      for (const Index v : feature) {
        if (!at[v].allFinite()) return;
      }
      for (const Index v : feature) marker.points.push_back(point(at[v]));
      if (rope) return;
      const std_msgs::ColorRGBA rgba = shaded(at[feature[0]], at[feature[1]], at[feature.back()]);
      marker.colors.insert(marker.colors.end(), 3, rgba);
    };
    if (rope)
      std::for_each(topology.edges().begin(), topology.edges().end(), add);
    else
      std::for_each(topology.faces().begin(), topology.faces().end(), add);
    if (!marker.points.empty()) out.markers.push_back(std::move(marker));
  }
}

}  // namespace

MarkerArray toMarkers(const Outcome& outcome, const std::vector<Body>& bodies, const MarkerConfig& config,
                      const std::string& frame) {
  MarkerArray out;
  Marker clear = list(outcome, frame, "", Marker::CUBE, 1);
  clear.action = Marker::DELETEALL;
  out.markers.push_back(clear);
  if (!outcome.answered) return out;

  Marker contacts = list(outcome, frame, "contacts", Marker::SPHERE_LIST, config.point_size_m);
  Marker initial = list(outcome, frame, "initial", Marker::SPHERE_LIST, config.point_size_m);
  Marker normals = list(outcome, frame, "normals", Marker::LINE_LIST, config.line_width_m);
  Marker faces = list(outcome, frame, "faces", Marker::TRIANGLE_LIST, 1);
  initial.color = color(0.6, 0.2, 0.9);
  normals.color = color(0.2, 0.9, 0.4);
  faces.color = color(1, 0.2, 0.2, 0.7);
  VoxelLists voxels;
  const std::size_t shown = std::min(outcome.contacts.size(), static_cast<std::size_t>(config.max_contacts));
  for (std::size_t i = 0; i < shown; ++i) {
    const Contact& contact = outcome.contacts[i];
    const ContactGeometry geometry = contactGeometry(outcome, contact);
    if (!geometry.point.allFinite() || !geometry.normal.allFinite()) continue;
    addVoxel(outcome, contact, frame, voxels);
    if (contact.initial) {
      initial.points.push_back(point(geometry.point));
      continue;
    }
    contacts.points.push_back(point(geometry.point));
    contacts.colors.push_back(color(1, contact.toc_lower, contact.certainty == Certainty::CERTAIN ? 0 : 0.8));
    normals.points.push_back(point(geometry.point));
    normals.points.push_back(point(geometry.point + config.normal_length_m * geometry.normal));
    addFace(outcome, contact, faces);
  }
  addObstacle(outcome, config.obstacle_m, frame, out);
  if (config.mesh) addMeshes(outcome, bodies, config, frame, out);
  for (Marker* marker : {&contacts, &initial, &normals, &faces}) {
    if (!marker->points.empty()) out.markers.push_back(std::move(*marker));
  }
  for (auto& voxel : voxels) out.markers.push_back(std::move(voxel.second));
  return out;
}

}  // namespace dccd
