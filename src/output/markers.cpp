#include "output/markers.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include <tf2_eigen/tf2_eigen.h>

#include "dccd/new_contacts.h"
#include "output/patch_messages.h"

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

geometry_msgs::Point point(const Vec3& p) { return tf2::toMsg(p); }

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
  // What a node that is gone has said last shall not stand as what is.
  marker.lifetime = ros::Duration(1 + 2 * std::max(outcome.duration_s(), 0.0));
  return marker;
}

// What means what: config/rviz/monitor.rviz says it beside the view.
const std_msgs::ColorRGBA INITIAL = color(0.75, 0.4, 1), EXPECTED = color(0.65, 0.65, 0.68),
                          PREDICTED = color(0.2, 0.9, 1), NORMAL = color(0.2, 0.9, 0.4), VOXEL = color(1, 0.55, 0.15),
                          NAME = color(0.75, 0.85, 1);
constexpr double TEXT = 3;    // letters are this much higher than a point
constexpr double TOLD_S = 2;  // this long a patch's text says that it began

Marker text(const Outcome& outcome, const std::string& frame, const std::string& ns, int id, const Vec3& at,
            double height, const std_msgs::ColorRGBA& rgba, const std::string& words) {
  Marker marker = list(outcome, frame, ns, Marker::TEXT_VIEW_FACING, height);
  marker.id = id;
  marker.pose.position = point(at);
  marker.color = rgba;
  marker.text = words;
  return marker;
}

std::string inSeconds(double s) {
  char words[32];
  std::snprintf(words, sizeof words, "%.2f s", s);
  return words;
}

/// The mesh face that takes part, at the time of contact; nothing for edge pairs.
void addFace(const Outcome& outcome, const Contact& contact, Marker& faces) {
  const auto& size = factsOf(contact.kind).vertices;
  if (size[0] != 3 && size[1] != 3) return;
  const int first = size[0] == 3 ? 0 : size[0];
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

/// Points of it are in the map's frame.
void placeInMap(const Outcome& outcome, Marker& marker) {
  marker.pose = tf2::toMsg(outcome.step->map.map_from_fixed.inverse());
}

/// The list for leaves of this size: cubes a little smaller than the voxels, so that one shows beside the next.
Marker& voxelList(const Outcome& outcome, const std::string& frame, std::uint32_t size, VoxelLists& by_size) {
  const auto found = by_size.find(size);
  if (found != by_size.end()) return found->second;
  Marker marker = list(outcome, frame, "obstacle", Marker::CUBE_LIST, 0.97 * size * outcome.obstacle->resolution());
  marker.id = static_cast<int>(size);
  marker.color = color(0.62, 0.62, 0.6);
  placeInMap(outcome, marker);
  return by_size.emplace(size, std::move(marker)).first->second;
}

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
    for (const Vec3& p : *body.t1) widen(box, outcome.step->map.map_from_fixed * p);
  }
  return box;
}

/// Of the map around the bodies more are not drawn: it may have millions, and a marker of so many is of no use to
/// anybody.
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
    voxelList(outcome, frame, leaf.size, by_size).points.push_back(point(min + Vec3::Constant(0.5 * edge)));
  }
  for (auto& voxels : by_size) out.markers.push_back(std::move(voxels.second));
}

/// What is a body's own, and what is in doubt, is no obstacle and not among those above.
void addOwn(const Outcome& outcome, const std::string& frame, MarkerArray& out) {
  const auto& voxels = outcome.step->map.own.voxels;
  if (!outcome.obstacle || !voxels || voxels->empty()) return;
  const double edge = outcome.obstacle->resolution();
  Marker marker = list(outcome, frame, "own", Marker::CUBE_LIST, 0.97 * edge);
  placeInMap(outcome, marker);
  for (std::size_t i = 0; i < std::min(voxels->size(), MAX_VOXELS_SHOWN); ++i) {
    const OwnVoxel& voxel = (*voxels)[i];
    marker.points.push_back(point(voxelMin(voxel.key, edge) + Vec3::Constant(0.5 * edge)));
    marker.colors.push_back(voxel.doubted ? color(0.95, 0.75, 0.2, 0.4) : color(0.35, 0.65, 0.45, 0.25));
  }
  out.markers.push_back(std::move(marker));
}

void addEdges(const Vec3& min, const Vec3& size, Marker& edges) {
  for (int a = 0; a < 3; ++a) {
    for (int side = 0; side < 4; ++side) {
      Vec3 from = min;
      from[(a + 1) % 3] += (side & 1) * size[(a + 1) % 3];
      from[(a + 2) % 3] += (side >> 1) * size[(a + 2) % 3];
      edges.points.push_back(point(from));
      edges.points.push_back(point(from + size[a] * Vec3::Unit(a)));
    }
  }
}

/// Its edges, so that it hides nothing of what touches it; in the map's pose.
void addVoxel(const Outcome& outcome, const Contact& contact, Marker& edges) {
  if (contact.body[1] != OBSTACLE_BODY) return;
  const double edge = contact.voxel_size * outcome.obstacle->resolution();
  const Vec3 min = voxelMin(contact.voxel, outcome.obstacle->resolution());
  const geometry_msgs::Point corner = point(min);
  // Contacts come sorted by feature, so one voxel comes many times; once is enough where it is next to itself.
  if (edges.points.size() >= 24) {
    const geometry_msgs::Point& last = edges.points[edges.points.size() - 24];
    if (last.x == corner.x && last.y == corner.y && last.z == corner.z) return;
  }
  addEdges(min, Vec3::Constant(edge), edges);
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

/// A rope's edge, for a line has no light and shade.
void addTube(const Vec3& a, const Vec3& b, double radius_m, Marker& marker) {
  if (a == b) return;
  constexpr int SIDES = 6;
  const Vec3 along = (b - a).normalized(), u = along.unitOrthogonal(), v = along.cross(u);
  const auto around = [&](int k) {
    return Vec3(radius_m * (std::cos(2 * M_PI * k / SIDES) * u + std::sin(2 * M_PI * k / SIDES) * v));
  };
  for (int k = 0; k < SIDES; ++k) {
    const Vec3 p = around(k), q = around(k + 1);
    addTriangle(a + p, a + q, b + q, marker);
    addTriangle(a + p, b + q, b + p, marker);
  }
}

void addMeshes(const Outcome& outcome, const std::vector<Body>& bodies, const MarkerConfig& config,
               const std::string& frame, MarkerArray& out) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const Topology& topology = *outcome.step->bodies[b].topology;
    const Positions& at = *outcome.step->bodies[b].t1;
    Marker marker = list(outcome, frame, "mesh/" + bodies[b].name, Marker::TRIANGLE_LIST, 1.0);
    for (const auto& f : topology.faces()) {
      if (at[f[0]].allFinite() && at[f[1]].allFinite() && at[f[2]].allFinite()) {
        addTriangle(at[f[0]], at[f[1]], at[f[2]], marker);
      }
    }
    for (const auto& e : topology.edges()) {
      if (topology.hasFaces()) break;
      if (at[e[0]].allFinite() && at[e[1]].allFinite()) addTube(at[e[0]], at[e[1]], 0.4 * config.point_size_m, marker);
    }
    if (marker.points.empty()) continue;
    out.markers.push_back(std::move(marker));
    Box box;
    for (const Vec3& p : at) widen(box, p);
    const double height = TEXT * config.point_size_m;
    const Vec3 above(0.5 * (box.min.x() + box.max.x()), 0.5 * (box.min.y() + box.max.y()), box.max.z() + height);
    out.markers.push_back(text(outcome, frame, "mesh/" + bodies[b].name, 1, above, height, NAME, bodies[b].name));
  }
}

/// Each vertex by the separation along the mean of its faces' normals, as far as it takes for each of these faces.
Positions grown(const Topology& topology, const Positions& at, double by_m) {
  Positions normals(at.size(), Vec3::Zero()), out = at;
  double volume = 0;
  for (const Face& f : topology.faces()) {
    const Vec3 area = (at[f[1]] - at[f[0]]).cross(at[f[2]] - at[f[0]]);
    volume += at[f[0]].dot(area);
    for (const Index v : f) normals[v] += area.normalized();
  }
  if (topology.isClosed() && volume < 0) by_m = -by_m;  // its faces look inwards
  for (std::size_t v = 0; v < at.size(); ++v) out[v] += by_m * normals[v].stableNormalized();
  return out;
}

/// Of rigid bodies: what must not come nearer than their separation, roughly, and the box of all that they sweep.
void addSwept(const Outcome& outcome, const MarkerConfig& config, const std::string& frame, MarkerArray& out) {
  for (const Body& body : outcome.step->bodies) {
    Box box;
    for (const Positions* at : {body.t0.get(), body.t1.get()}) {
      for (const Vec3& p : *at) {
        box.min = box.min.cwiseMin(p);
        box.max = box.max.cwiseMax(p);
      }
    }
    if (!body.rigid || box.empty() || !box.min.allFinite() || !box.max.allFinite()) continue;
    const double separation_m = body.minimum_separation_m;
    if (separation_m > 0) {
      Marker padding = list(outcome, frame, "padding/" + body.name, Marker::TRIANGLE_LIST, 1.0);
      padding.color = color(1, 0.7, 0.2, 0.25);
      const Positions at = grown(*body.topology, *body.t1, separation_m);
      for (const Face& face : body.topology->faces()) {
        for (const Index v : face) padding.points.push_back(point(at[v]));
      }
      out.markers.push_back(std::move(padding));
    }
    Marker edges = list(outcome, frame, "swept/" + body.name, Marker::LINE_LIST, config.line_width_m);
    edges.color = color(0.5, 0.7, 1);
    const Vec3 min = box.min - Vec3::Constant(separation_m);
    addEdges(min, box.max + Vec3::Constant(separation_m) - min, edges);
    out.markers.push_back(std::move(edges));
  }
}

/// Upwards until it covers none of the texts that stand already: each is some ten letters wide to either side.
Vec3 clearOf(const MarkerArray& markers, Vec3 at, double height) {
  const auto covers = [&](const Marker& other) {
    if (other.type != Marker::TEXT_VIEW_FACING) return false;
    const Vec3 away = at - Vec3(other.pose.position.x, other.pose.position.y, other.pose.position.z);
    return std::abs(away.z()) < 1.2 * height && away.head<2>().norm() < 12 * height;
  };
  constexpr int MOST = 100;  // far from the origin a height may be too little to change a coordinate
  for (int i = 0; i < MOST && std::any_of(markers.markers.begin(), markers.markers.end(), covers); ++i) {
    at.z() += 0.4 * height;
  }
  return at;
}

std::string lengthInWords(double m) {
  char words[32];
  std::snprintf(words, sizeof words, m < 0.1 ? "%.1f mm" : "%.3f m", m < 0.1 ? 1e3 * m : m);
  return words;
}

/// The shortest segment between each two partners at the step's end, with its length; where they touch, contacts show.
void addClearances(const Outcome& outcome, const std::vector<Body>& bodies, const MarkerConfig& config,
                   const std::string& frame, MarkerArray& out) {
  Marker segments = list(outcome, frame, "clearance", Marker::LINE_LIST, 1.5 * config.line_width_m);
  const double height = TEXT * config.point_size_m;
  for (std::size_t i = 0; i < outcome.clearances.size(); ++i) {
    const Clearance& clearance = outcome.clearances[i];
    const auto& [from, to] = clearance.at_end.point;
    if (!from.allFinite() || !to.allFinite() || from == to) continue;
    const double length_m = clearance.at_end.upper_m, far = std::min(length_m / config.clearance_max_m, 1.0);
    const std_msgs::ColorRGBA rgba =
        clearance.expected ? EXPECTED : color(std::min(2 - 2 * far, 1.0), std::min(2 * far, 1.0), 0.1);
    for (const Vec3& end : {from, to}) segments.points.push_back(point(end));
    segments.colors.insert(segments.colors.end(), 2, rgba);
    const Vec3 at = clearOf(out, 0.5 * (from + to), height);
    out.markers.push_back(text(outcome, frame, "clearance", static_cast<int>(i) + 1, at, height, rgba,
                               pairOf(clearance.body, bodies) + ' ' + lengthInWords(length_m)));
  }
  if (!segments.points.empty()) out.markers.push_back(std::move(segments));
}

/// At the patch of each pair of partners that began last, as long as that is news.
void addBeginnings(const Outcome& outcome, const std::vector<Body>& bodies, double height, const std::string& frame,
                   MarkerArray& out) {
  std::map<std::array<std::uint16_t, 2>, const Patch*> newest;
  for (const Patch& patch : outcome.patches) {
    if (patch.beginning != PatchBeginning::NEW || patch.began_to_ns == UNKNOWN_NS) continue;
    const Patch*& so_far = newest[patch.body];
    if (!so_far || so_far->began_to_ns < patch.began_to_ns) so_far = &patch;
  }
  int id = 0;
  for (const auto& [body, patch] : newest) {
    const double ago_s = secondsBetween(patch->began_to_ns, outcome.stamp_ns);
    if (ago_s > TOLD_S || !patch->centroid.allFinite()) continue;
    const Vec3 at = clearOf(out, patch->centroid + Vec3(0, 0, 2 * height), height);
    const std::string words = pairOf(body, bodies) + ", " + inSeconds(ago_s) + " ago";
    out.markers.push_back(text(outcome, frame, "began", id++, at, height, color(1, 1, 1), words));
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
  Marker normals = list(outcome, frame, "normals", Marker::LINE_LIST, 2 * config.line_width_m);
  Marker faces = list(outcome, frame, "faces", Marker::TRIANGLE_LIST, 1);
  Marker expected = list(outcome, frame, "expected", Marker::SPHERE_LIST, config.point_size_m);
  Marker voxels = list(outcome, frame, "voxels", Marker::LINE_LIST, 1.5 * config.line_width_m);
  initial.color = INITIAL;
  expected.color = EXPECTED;
  normals.color = NORMAL;
  voxels.color = VOXEL;
  faces.color = color(1, 0.2, 0.2, 0.7);
  if (outcome.obstacle) placeInMap(outcome, voxels);
  // Of a body against itself neither side is the first one: both ways.
  const auto addNormal = [&](const std::array<std::uint16_t, 2>& body, const Vec3& at, const Vec3& normal) {
    normals.points.push_back(point(body[0] == body[1] ? Vec3(at - config.normal_length_m * normal) : at));
    normals.points.push_back(point(at + config.normal_length_m * normal));
  };
  for (const Patch& patch : outcome.patches) {
    if (patch.centroid.allFinite() && patch.normal.allFinite()) addNormal(patch.body, patch.centroid, patch.normal);
  }
  const std::size_t shown = std::min(outcome.contacts.size(), static_cast<std::size_t>(config.max_contacts));
  for (std::size_t i = 0; i < shown; ++i) {
    const Contact& contact = outcome.contacts[i];
    const ContactGeometry geometry = contactGeometry(outcome, contact);
    if (!geometry.point.allFinite() || !geometry.normal.allFinite()) continue;
    addVoxel(outcome, contact, voxels);
    if (contact.initial || contact.expected) {
      (contact.expected ? expected : initial).points.push_back(point(geometry.point));
      continue;
    }
    contacts.points.push_back(point(geometry.point));
    contacts.colors.push_back(color(1, contact.toc_lower, contact.certainty == Certainty::CERTAIN ? 0 : 0.8));
    if (outcome.patches.empty()) addNormal(contact.body, geometry.point, geometry.normal);
    addFace(outcome, contact, faces);
  }
  addObstacle(outcome, config.obstacle_m, frame, out);
  addOwn(outcome, frame, out);
  if (config.swept) addSwept(outcome, config, frame, out);
  if (config.mesh) addMeshes(outcome, bodies, config, frame, out);
  addBeginnings(outcome, bodies, TEXT * config.point_size_m, frame, out);
  addClearances(outcome, bodies, config, frame, out);
  for (Marker* marker : {&voxels, &faces, &normals, &expected, &initial, &contacts}) {
    if (!marker->points.empty()) out.markers.push_back(std::move(*marker));
  }
  return out;
}

MarkerArray toPredictedMarkers(const Outcome& prediction, double horizon_s, const std::vector<Body>& bodies,
                               const MarkerConfig& config, const std::string& frame) {
  MarkerArray out;
  if (!prediction.answered) return out;
  Marker points = list(prediction, frame, "predicted", Marker::CUBE_LIST, 0.7 * config.point_size_m);
  points.color = PREDICTED;
  points.color.a = 0.6f;
  for (const Contact& contact : prediction.contacts) {
    if (contact.initial || points.points.size() == static_cast<std::size_t>(config.max_contacts)) continue;
    const Vec3 at = contactGeometry(prediction, contact).point;
    if (at.allFinite()) points.points.push_back(point(at));
  }
  if (!points.points.empty()) out.markers.push_back(std::move(points));
  for (const NewContact& next : newContacts(prediction)) {
    // Below its place: what has begun is told above.
    const double height = TEXT * config.point_size_m;
    const Vec3 at = clearOf(out, contactGeometry(prediction, next.contact).point - Vec3(0, 0, 3 * height), height);
    const std::string words = pairOf(next.body, bodies) + " in " + inSeconds(next.contact.toc_lower * horizon_s);
    if (!at.allFinite()) continue;
    out.markers.push_back(
        text(prediction, frame, "predicted first", static_cast<int>(out.markers.size()), at, height, PREDICTED, words));
  }
  for (Marker& marker : out.markers) marker.header.stamp = toRosTime(prediction.start_ns);
  return out;
}

}  // namespace dccd
