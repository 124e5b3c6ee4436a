// Meshes that come as markers: which of a message's markers are the mesh, and what of the others nobody looks at.
#include <algorithm>
#include <array>
#include <set>
#include <sstream>

#include "input/marker_ropes.h"
#include "input/mesh_decoder.h"

namespace dccd {

namespace {

/// Of a triangle list. Of lines and points, scale is how thick they are drawn.
Eigen::Affine3d poseAndScaleOf(const MarkerView& marker) {
  Eigen::Affine3d transform = poseOf(marker);
  const Vec3 scale(marker.scale[0], marker.scale[1], marker.scale[2]);
  if (!scale.allFinite()) refuseMessage("scale is not finite");
  if (scale.isZero(0)) return transform;  // it was never set
  if ((scale.array() == 0).any()) {
    std::ostringstream text;
    text << "scale is (" << scale.x() << ", " << scale.y() << ", " << scale.z()
         << "), which leaves the mesh no depth; set no component to 0, or all three for no scale";
    refuseMessage(text.str());
  }
  transform.linear() = transform.linear() * scale.asDiagonal();
  return transform;
}

/// Arrows and texts are none, nor is what is taken away.
bool mayBeThing(const MarkerView& marker) {
  return marker.action == MARKER_ADD && marker.type != MARKER_ARROW && marker.type != MARKER_TEXT &&
         (!isListOfPoints(marker) || marker.points.size > 0);
}

}  // namespace

std::size_t declaredBy(const MarkerView& marker) {
  if (!isListOfPoints(marker)) return 1;
  return marker.type == MARKER_TRIANGLE_LIST ? (marker.points.size + 2) / 3 : marker.points.size;
}

bool MeshDecoder::isWanted(const MarkerView& marker) const {
  return (!config_.marker_namespace || marker.ns == *config_.marker_namespace) &&
         (!config_.marker_id || marker.id == *config_.marker_id) && marker.action == MARKER_ADD;
}

bool MeshDecoder::isReadable(const MarkerView& marker) const {
  const bool is_polyline = config_.source == TopologySource::POLYLINE;
  return marker.type == MARKER_TRIANGLE_LIST
             ? !is_polyline
             : isLineMarker(marker) || (isPointMarker(marker) && (is_polyline || hasFixedTopology()));
}

bool MeshDecoder::passesOver(const std::vector<MarkerView>& markers) const {
  const auto none = [&](auto is) { return !markers.empty() && std::none_of(markers.begin(), markers.end(), is); };
  if (none([](const MarkerView& one) { return one.action == MARKER_ADD; })) return true;
  const bool is_named = config_.marker_namespace || config_.marker_id;
  if (is_named && none([&](const MarkerView& one) { return isWanted(one); })) return true;
  return none([&](const MarkerView& one) { return isWanted(one) && (isReadable(one) || !names_.isOther(one)); });
}

DecodedMesh MeshDecoder::decodeView(const std::vector<MarkerView>& markers) {
  shown_.remove(markers);
  std::string seen;
  std::vector<const MarkerView*> lists, lines, points;
  for (const MarkerView& marker : markers) {
    const bool wanted = isWanted(marker);
    if (wanted && marker.type == MARKER_TRIANGLE_LIST && config_.source != TopologySource::POLYLINE) {
      lists.push_back(&marker);
    } else if (wanted && isLineMarker(marker) && marker.points.size > 0) {
      lines.push_back(&marker);
    } else if (wanted && isPointMarker(marker) && marker.points.size > 0) {
      points.push_back(&marker);
    } else if (seen.size() < 200) {
      seen += " ('" + std::string(marker.ns.substr(0, 32)) + "', " + std::to_string(marker.id) + ", type " +
              std::to_string(marker.type) + (marker.points.size == 0 ? " without points)" : ")");
    }
  }
  const std::vector<const MarkerView*>& taken = !lists.empty() ? lists : !lines.empty() ? lines : points;
  const bool passed_over = passesOver(markers);
  if (taken.empty() || passed_over) {
    const std::string text =
        "no " + std::string(config_.source == TopologySource::POLYLINE ? "" : "TRIANGLE_LIST marker and no ") +
        "LINE_STRIP, LINE_LIST or POINTS with the wanted namespace and id; there are (namespace, id, type):" +
        (seen.empty() ? " none" : seen);
    if (passed_over) throw PassedOver(text, std::any_of(markers.begin(), markers.end(), mayBeThing));
    refuseMessage(text);
  }
  if (&taken == &points && config_.source != TopologySource::POLYLINE && !hasFixedTopology()) {
    refuseMessage("marker " + nameOf(*points[0]) +
                  " has points without a topology; set topology/source to polyline or file, or topology/rows and "
                  "topology/cols for a grid");
  }
  names_.require(taken);
  DecodedMesh mesh = &taken == &lists ? decodeSoup(*lists[0]) : decodeRopes(taken);
  names_.keep(taken);
  if (&taken == &lists) lists.resize(1);
  tellUnread(markers, taken, mesh);
  return mesh;
}

/// Lines and points that lie just where the mesh has vertices are drawn of it, and arrows and texts are no things. All
/// else may be one that the mesh is not, and nobody looks at it; so may what came before and is shown still.
void MeshDecoder::tellUnread(const std::vector<MarkerView>& markers, const std::vector<const MarkerView*>& taken,
                             DecodedMesh& mesh) {
  std::set<std::array<double, 3>> places;
  const auto isVertex = [&](const Vec3& p) { return !p.allFinite() || places.count({p.x(), p.y(), p.z()}) > 0; };
  const auto isDrawnOfIt = [&](const MarkerView& marker) {
    if (!isLineMarker(marker) && !isPointMarker(marker)) return false;
    if (marker.header.frame_id != taken.front()->header.frame_id) return false;
    if (places.empty()) {
      for (const Vec3& p : mesh.positions) places.insert({p.x(), p.y(), p.z()});
    }
    const Eigen::Affine3d pose = poseOf(marker);
    for (std::size_t i = 0; i < marker.points.size; ++i) {
      const auto p = marker.points[i];
      if (!isVertex(pose * Vec3(p[0], p[1], p[2]))) return false;
    }
    return true;
  };
  const auto tell = [&](const std::string& what) {
    if (mesh.unread_markers++ == 0) mesh.unread_marker = what;
  };
  std::vector<const MarkerView*> things = taken;
  for (const MarkerView& marker : markers) {
    const bool by_choice = config_.source == TopologySource::POLYLINE && marker.type == MARKER_TRIANGLE_LIST;
    const bool is_taken = std::binary_search(taken.begin(), taken.end(), &marker);  // they are in their order
    mesh.has_others = mesh.has_others || (!isWanted(marker) && mayBeThing(marker));
    if (!isWanted(marker) || !mayBeThing(marker) || by_choice || is_taken || isDrawnOfIt(marker)) {
      mesh.census.account(declaredBy(marker));
      continue;
    }
    things.push_back(&marker);
    tell(nameOf(marker) + ", type " + std::to_string(marker.type));
  }
  if (const ShownMarkers::Left left = shown_.show(things); left.count > 0) {
    tell(left.example + ", which came before and was not deleted");
    mesh.census.declare(left.count);
    mesh.unread_markers += left.count - 1;
  }
}

DecodedMesh MeshDecoder::decodeSoup(const MarkerView& marker) {
  DecodedMesh mesh;
  start(marker.header, mesh);
  const std::size_t count = marker.points.size;
  checkCount(count);
  checkFaces(count / 3);
  if (count % 3 != 0)
    refuseMessage("a TRIANGLE_LIST of " + std::to_string(count) + " points, which is not a multiple of 3");
  const Eigen::Affine3d transform = poseAndScaleOf(marker);
  Positions corners(count);
  for (std::size_t i = 0; i < count; ++i) {
    const auto p = marker.points[i];
    corners[i] = Vec3(p[0], p[1], p[2]);
  }
  const bool had_joints = hasJoints();
  if (!known_ropes_.empty()) forgetJoints();  // they are of their ends
  const bool welds_anew = weld_.vertexOfCorner().size() != count;
  mesh.is_joined_anew = had_joints && welds_anew;
  if (config_.weld && config_.source != TopologySource::FILE) {
    mesh.weld_changes = weld_.weld(corners);
  } else {
    weld_.keepApart(count);
  }
  mesh.positions.reserve(weld_.cornerOfVertex().size());
  for (const Index corner : weld_.cornerOfVertex()) mesh.positions.push_back(transform * corners[corner]);
  if (config_.source == TopologySource::FILE) {
    takeFixed(count, 0, 0, mesh);
  } else {
    try {
      Polygons sent{weld_.vertexOfCorner(), {}};
      sent.ends.reserve(count / 3);
      for (std::size_t end = 3; end <= count; end += 3) sent.ends.push_back(end);
      takeFaces(std::move(sent), mesh);
    } catch (...) {
      if (welds_anew) weld_.forget();  // a soup that is refused does not say which corners of the next one are one
      throw;
    }
  }
  addRadii(nullptr, mesh);
  return mesh;
}

}  // namespace dccd
