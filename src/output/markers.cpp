#include "output/markers.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>

#include <tf2_eigen/tf2_eigen.h>

#include "dccd/monitor_extras.h"
#include "output/marker_drawing.h"
#include "output/patch_messages.h"

namespace dccd {

namespace {

using visualization_msgs::Marker;
using visualization_msgs::MarkerArray;

// What means what: config/rviz/monitor.rviz says it beside the view.
const std_msgs::ColorRGBA INITIAL = color(0.75, 0.4, 1), EXPECTED = color(0.65, 0.65, 0.68),
                          PREDICTED = color(0.2, 0.9, 1), NORMAL = color(0.2, 0.9, 0.4), VOXEL = color(1, 0.55, 0.15);
constexpr double TOLD_S = 2;  // this long a patch's text says that it began

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
void addClearances(MarkerDrawing& drawing) {
  Marker segments = drawing.make("clearance", Marker::LINE_LIST, 1.5 * drawing.config.lineWidth());
  int id = 0;
  for (const Clearance& clearance : drawing.outcome.clearances) {
    ++id;
    const auto& [from, to] = clearance.at_end.point;
    if (!from.allFinite() || !to.allFinite() || from == to) continue;
    const double length_m = clearance.at_end.upper_m, far = std::min(length_m / drawing.config.clearance_max_m, 1.0);
    const std_msgs::ColorRGBA rgba =
        clearance.expected ? EXPECTED : color(std::min(2 - 2 * far, 1.0), std::min(2 * far, 1.0), 0.1);
    for (const Vec3& end : {from, to}) segments.points.push_back(point(end));
    segments.colors.insert(segments.colors.end(), 2, rgba);
    const Vec3 at = clearOf(drawing.array, 0.5 * (from + to), drawing.textHeight());
    drawing.addText("clearance", id, at, rgba, pairOf(clearance.body, drawing.bodies) + ' ' + lengthInWords(length_m));
  }
  drawing.add(std::move(segments));
}

/// At the patch of each pair of partners that began last, as long as that is news.
void addBeginnings(MarkerDrawing& drawing) {
  std::map<std::array<std::uint16_t, 2>, const Patch*> newest;
  for (const Patch& patch : drawing.outcome.patches) {
    if (patch.beginning != PatchBeginning::NEW || patch.began_to_ns == UNKNOWN_NS) continue;
    const Patch*& so_far = newest[patch.body];
    if (!so_far || so_far->began_to_ns < patch.began_to_ns) so_far = &patch;
  }
  int id = 0;
  const double height = drawing.textHeight();
  for (const auto& [body, patch] : newest) {
    const double ago_s = secondsBetween(patch->began_to_ns, drawing.outcome.stamp_ns);
    if (ago_s > TOLD_S || !patch->centroid.allFinite()) continue;
    const Vec3 at = clearOf(drawing.array, patch->centroid + Vec3(0, 0, 2 * height), height);
    drawing.addText("began", id++, at, color(1, 1, 1), pairOf(body, drawing.bodies) + ", " + inSeconds(ago_s) + " ago");
  }
}

/// Of each patch, or where there are none of each contact that is new.
void addNormal(const MarkerDrawing& drawing, const std::array<std::uint16_t, 2>& body, const Vec3& at,
               const Vec3& normal, Marker& normals) {
  const Vec3 length = drawing.config.normalLength() * normal;
  // Of a body against itself neither side is the first one: both ways.
  normals.points.push_back(point(body[0] == body[1] ? Vec3(at - length) : at));
  normals.points.push_back(point(at + length));
}

}  // namespace

Marker MarkerDrawing::make(const std::string& ns, int type, double scale) const {
  Marker marker;
  marker.header = headerOf(outcome.stamp_ns, frame);
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

Marker MarkerDrawing::makeInMap(const std::string& ns, int type, double scale) const {
  Marker marker = make(ns, type, scale);
  marker.pose = tf2::toMsg(outcome.step->map.fromFixedAt(1).inverse());
  return marker;
}

void MarkerDrawing::add(Marker&& marker) {
  if (!marker.points.empty()) array.markers.push_back(std::move(marker));
}

void MarkerDrawing::addText(const std::string& ns, int id, const Vec3& at, const std_msgs::ColorRGBA& rgba,
                            const std::string& words) {
  Marker marker = make(ns, Marker::TEXT_VIEW_FACING, textHeight());
  marker.id = id;
  marker.pose.position = point(at);
  marker.color = rgba;
  marker.text = words;
  array.markers.push_back(std::move(marker));
}

std_msgs::ColorRGBA color(double r, double g, double b, double a) {
  std_msgs::ColorRGBA out;
  out.r = static_cast<float>(r);
  out.g = static_cast<float>(g);
  out.b = static_cast<float>(b);
  out.a = static_cast<float>(a);
  return out;
}

geometry_msgs::Point point(const Vec3& p) { return tf2::toMsg(p); }

Vec3 voxelMin(const VoxelKey& key, double resolution_m) {
  return {voxelPlane(key.x, resolution_m), voxelPlane(key.y, resolution_m), voxelPlane(key.z, resolution_m)};
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

MarkerArray toMarkers(const Outcome& outcome, const std::vector<Body>& bodies, const MarkerConfig& config,
                      const std::string& frame) {
  MarkerDrawing drawing{outcome, bodies, config, frame, {}};
  Marker clear = drawing.make("", Marker::CUBE, 1);
  clear.action = Marker::DELETEALL;
  drawing.array.markers.push_back(clear);
  if (!outcome.answered) return std::move(drawing.array);

  Marker contacts = drawing.make("contacts", Marker::SPHERE_LIST, config.point_size_m);
  Marker initial = drawing.make("initial", Marker::SPHERE_LIST, config.point_size_m);
  Marker expected = drawing.make("expected", Marker::SPHERE_LIST, config.point_size_m);
  Marker normals = drawing.make("normals", Marker::LINE_LIST, 2 * config.lineWidth());
  Marker faces = drawing.make("faces", Marker::TRIANGLE_LIST, 1);
  Marker voxels = drawing.makeInMap("voxels", Marker::LINE_LIST, 1.5 * config.lineWidth());
  initial.color = INITIAL;
  expected.color = EXPECTED;
  normals.color = NORMAL;
  voxels.color = VOXEL;
  faces.color = color(1, 0.2, 0.2, 0.7);
  for (const Patch& patch : outcome.patches) {
    if (!patch.centroid.allFinite() || !patch.normal.allFinite()) continue;
    addNormal(drawing, patch.body, patch.centroid, patch.normal, normals);
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
    if (outcome.patches.empty()) addNormal(drawing, contact.body, geometry.point, geometry.normal, normals);
    addFace(outcome, contact, faces);
  }
  addScene(drawing);
  addBeginnings(drawing);
  addClearances(drawing);
  for (Marker* marker : {&voxels, &faces, &normals, &expected, &initial, &contacts}) drawing.add(std::move(*marker));
  return std::move(drawing.array);
}

void addPath(const Outcome& outcome, const IntendedPath& path, const std::string& frame, MarkerArray& array) {
  if (!outcome.answered) return;
  const MarkerDrawing drawing{outcome, outcome.step->bodies, {}, frame, {}};
  for (const IntendedPath::Of& of : path.bodies) {
    Marker tube = drawing.make("intended", Marker::LINE_STRIP, std::max(0.002, 2 * path.tubeAt(path.endsAt())));
    tube.id = of.body;
    tube.color = PREDICTED;
    tube.color.a = 0.3f;
    Eigen::AlignedBox3d box;
    for (const Vec3& p : *outcome.step->bodies[of.body].t1) box.extend(p);
    const Vec3 middle = outcome.step->bodies[of.frameOf()].pose_t1.inverse() * box.center();
    for (const Eigen::Isometry3d& pose : of.pose) tube.points.push_back(point(pose * middle));
    if (tube.points.size() > 1) array.markers.push_back(std::move(tube));
  }
}

MarkerArray toPredictedMarkers(const Outcome& prediction, double horizon_s, const std::vector<Body>& bodies,
                               const MarkerConfig& config, const std::string& frame) {
  MarkerDrawing drawing{prediction, bodies, config, frame, {}};
  if (!prediction.answered) return std::move(drawing.array);
  Marker points = drawing.make("predicted", Marker::CUBE_LIST, 0.7 * config.point_size_m);
  points.color = PREDICTED;
  points.color.a = 0.6f;
  for (const Contact& contact : prediction.contacts) {
    if (contact.initial || points.points.size() == static_cast<std::size_t>(config.max_contacts)) continue;
    const Vec3 at = contactGeometry(prediction, contact).point;
    if (at.allFinite()) points.points.push_back(point(at));
  }
  drawing.add(std::move(points));
  for (const NewContact& next : newContacts(prediction)) {
    // Below its place: what has begun is told above.
    const double height = drawing.textHeight();
    const Vec3 place = contactGeometry(prediction, next.contact).point;
    const Vec3 at = clearOf(drawing.array, place - Vec3(0, 0, 3 * height), height);
    if (!at.allFinite()) continue;
    drawing.addText("predicted first", static_cast<int>(drawing.array.markers.size()), at, PREDICTED,
                    pairOf(next.body, bodies) + " in " + inSeconds(next.contact.toc_lower * horizon_s));
  }
  for (Marker& marker : drawing.array.markers) marker.header.stamp = toRosTime(prediction.start_ns);
  return std::move(drawing.array);
}

}  // namespace dccd
