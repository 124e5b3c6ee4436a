#include "input/marker_ropes.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "input/marker_names.h"
#include "input/mesh_decoder.h"
#include "input/short_text.h"

namespace dccd {

namespace {

// A publisher that stamps each marker with the time at which it makes it needs less for all of them.
constexpr double MOST_APART_S = 1e-3;

void requirePoints(const MarkerView& marker) {
  const bool pairs = marker.type == MARKER_LINE_LIST;
  if (pairs ? marker.points.size % 2 == 0 : marker.points.size > 1) return;
  throw WireError("marker " + nameOf(marker) + " has " + std::to_string(marker.points.size) +
                  (pairs ? " points, and a LINE_LIST two for each segment" : " point, and a rope needs 2"));
}

/// The earliest and the latest of a message: one frame shows all of them at one time.
void requireOneTime(const MarkerView& first, const MarkerView& last) {
  const double apart_s = secondsBetween(first.header.stamp_ns, last.header.stamp_ns);
  if (apart_s <= MOST_APART_S) return;
  throw WireError("marker " + nameOf(last) + " is stamped " + std::to_string(apart_s) + " s after " + nameOf(first) +
                  "; give the ropes of a message one stamp, or name one rope a body by marker/id");
}

void add(const MarkerView& marker, Ropes& ropes) {
  const Eigen::Affine3d pose = poseOf(marker);
  const auto first = static_cast<Index>(ropes.points.size());
  for (std::size_t i = 0; i < marker.points.size; ++i) {
    const auto p = marker.points[i];
    ropes.points.push_back(pose * Vec3(p[0], p[1], p[2]));
  }
  if (marker.type == MARKER_LINE_LIST) {
    for (Index v = first; v < ropes.points.size(); ++v) {
      if ((v - first) % 2 == 1) ropes.edges.push_back({v - 1, v});
      ropes.ends.push_back(v);
    }
    return;
  }
  const Index last = addLine(ropes.points, first, ropes.points.size(), ropes.edges);
  if (isLineMarker(marker)) ropes.ends.insert(ropes.ends.end(), {first, last});
}

}  // namespace

Eigen::Affine3d poseOf(const MarkerView& marker) {
  for (const double value : marker.pose) {
    if (!std::isfinite(value)) throw WireError("pose is not finite");
  }
  const Eigen::Quaterniond q(marker.pose[6], marker.pose[3], marker.pose[4], marker.pose[5]);
  Eigen::Affine3d transform = Eigen::Affine3d::Identity();
  // Publishers that leave the quaternion at zero mean none, and RViz shows it so.
  if (q.norm() > 0) transform.linear() = q.normalized().toRotationMatrix();
  transform.translation() = Vec3(marker.pose[0], marker.pose[1], marker.pose[2]);
  return transform;
}

Index addLine(const Positions& points, std::size_t begin, std::size_t end, std::vector<Edge>& edges) {
  auto at = static_cast<Index>(begin);
  for (std::size_t i = begin + 1; i < end; ++i) {
    if (points[i] == points[at]) continue;
    edges.push_back({at, static_cast<Index>(i)});
    at = static_cast<Index>(i);
  }
  return at;
}

Ropes ropesOf(std::vector<const MarkerView*> markers) {
  std::stable_sort(markers.begin(), markers.end(), [](const MarkerView* a, const MarkerView* b) {
    return std::tie(a->ns, a->id) < std::tie(b->ns, b->id);
  });
  Ropes ropes;
  for (const MarkerView* one : markers) {
    requirePoints(*one);
    // A name may be as long as a message; its beginning tells ropes apart.
    ropes.names.push_back({std::string(one->ns.substr(0, MAX_NAME)), one->id, one->type, one->points.size});
    add(*one, ropes);
  }
  return ropes;
}

bool continues(const std::vector<RopeName>& before, const std::vector<RopeName>& ropes) {
  const auto alike = [](const RopeName& a, const RopeName& b) { return a.type == b.type && a.points == b.points; };
  const auto named = [](const RopeName& a, const RopeName& b) { return a.ns == b.ns && a.id == b.id; };
  const auto lower = [](const RopeName& a, const RopeName& b) { return std::tie(a.ns, a.id) < std::tie(b.ns, b.id); };
  if (!std::equal(before.begin(), before.end(), ropes.begin(), ropes.end(), alike)) return false;
  const auto [was, is] = std::mismatch(before.begin(), before.end(), ropes.begin(), named);
  const auto stays = [&](const RopeName& one) { return std::binary_search(before.begin(), before.end(), one, lower); };
  // Some publishers number all of them anew each time.
  if (was == before.end() || std::none_of(ropes.begin(), ropes.end(), stays)) return true;
  throw WireError("marker " + nameOf(is->ns, is->id) + " stands where " + nameOf(was->ns, was->id) +
                  " was, so that it is not known which rope it is; keep namespaces and ids, or call ~reset");
}

std::size_t joinEnds(bool joins, SoupWeld& weld, Ropes& ropes) {
  Positions ends;
  for (const Index end : ropes.ends) ends.push_back(ropes.points[end]);
  std::size_t apart = 0;
  if (!joins) {
    weld.keepApart(ends.size());
  } else if (apart = weld.weld(ends); apart > 0) {
    weld.forget();  // an end that came apart may go on in another rope: all are joined anew
    weld.weld(ends);
  }
  std::vector<Index> vertex(ropes.points.size(), NO_INDEX);
  for (std::size_t e = 0; e < ends.size(); ++e) {
    vertex[ropes.ends[e]] = ropes.ends[weld.cornerOfVertex()[weld.vertexOfCorner()[e]]];
  }
  Positions points;
  for (Index i = 0; i < vertex.size(); ++i) {
    if (vertex[i] == NO_INDEX || vertex[i] == i) {
      vertex[i] = static_cast<Index>(points.size());
      points.push_back(ropes.points[i]);
    } else {
      vertex[i] = vertex[vertex[i]];  // of a point before it
    }
  }
  ropes.points = std::move(points);
  for (Edge& edge : ropes.edges) edge = {vertex[edge[0]], vertex[edge[1]]};
  const auto has_no_length = [](const Edge& edge) { return edge[0] == edge[1]; };
  ropes.edges.erase(std::remove_if(ropes.edges.begin(), ropes.edges.end(), has_no_length), ropes.edges.end());
  return apart;
}

DecodedMesh MeshDecoder::decodeRopes(std::vector<const MarkerView*> markers) {
  DecodedMesh mesh;
  start(markers[0]->header, mesh);
  std::size_t count = 0;
  const MarkerView *first = markers[0], *last = markers[0];
  for (const MarkerView* one : markers) {
    if (one->header.stamp_ns < first->header.stamp_ns) first = one;
    if (one->header.stamp_ns > last->header.stamp_ns) last = one;
    DecodedMesh other;
    start(one->header, other);
    if (other.frame_id != mesh.frame_id) {
      throw MeshError(StepStatus::BAD_MESSAGE, "marker " + nameOf(*one) + " is in frame '" + other.frame_id +
                                                   "', and " + nameOf(*markers[0]) + " in frame '" + mesh.frame_id +
                                                   "'; publish the ropes of a message in one frame");
    }
    count += one->points.size;
  }
  requireOneTime(*first, *last);
  mesh.stamp_ns = first->header.stamp_ns;  // so that no time that is reported is late
  checkCount(count);
  Ropes ropes = ropesOf(markers);
  const bool goes_on = continues(known_ropes_, ropes.names);
  mesh.is_joined_anew = !goes_on && hasJoints();
  if (hasFixedTopology()) {
    mesh.positions = std::move(ropes.points);
    takeFixed(count, 0, 0, mesh);
    if (mesh.is_joined_anew) {  // the topology, being the same, would not tell
      throw WireError(
          "its markers are not those of the message before, or have other numbers of points; send the same "
          "ones each time, or call ~reset");
    }
    addRadii(nullptr, mesh);
    known_ropes_ = std::move(ropes.names);
    return mesh;
  }
  SoupWeld weld = goes_on ? weld_ : SoupWeld();
  mesh.weld_changes = joinEnds(config_.weld, weld, ropes);
  if (ropes.edges.empty()) {
    throw MeshError(StepStatus::BAD_MESSAGE, "there is nothing to check: the lines have no length");
  }
  mesh.positions = std::move(ropes.points);
  addRadii(nullptr, mesh);
  takeLines(ropes.edges, mesh);
  weld_ = std::move(weld);
  known_ropes_ = std::move(ropes.names);
  return mesh;
}

}  // namespace dccd
