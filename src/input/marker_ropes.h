// Ropes that come as markers: lines, or points in a row.
#pragma once

#include <string>
#include <vector>

#include <Eigen/Geometry>

#include "input/mesh_views.h"
#include "input/soup_weld.h"

namespace dccd {

inline bool isLineMarker(const MarkerView& marker) {
  return marker.type == MARKER_LINE_STRIP || marker.type == MARKER_LINE_LIST;
}
inline bool isPointMarker(const MarkerView& marker) {
  return marker.type == MARKER_POINTS || marker.type == MARKER_SPHERE_LIST;
}
/// Of a type whose geometry its points are.
inline bool isListOfPoints(const MarkerView& marker) {
  return isLineMarker(marker) || isPointMarker(marker) || marker.type == MARKER_CUBE_LIST ||
         marker.type == MARKER_TRIANGLE_LIST;
}
/// How many faces or points the marker carries; a shape of its own is one.
std::size_t declaredBy(const MarkerView& marker);
/// Without its scale: of lines and points that is how thick they are drawn. Throws WireError for a pose that is not
/// finite.
Eigen::Affine3d poseOf(const MarkerView& marker);

/// Which marker a rope is.
struct RopeName {
  std::string ns;
  std::int32_t id = 0, type = 0;
  std::size_t points = 0;
};

struct Ropes {
  std::vector<RopeName> names;  ///< ascending by namespace and id, as are
  Positions points;             ///< their points
  std::vector<Edge> edges;
  std::vector<Index> ends;  ///< points where another line may go on: both of a segment, the first and last of a strip
};

/// Of markers that are lines, or points. Throws WireError for one of too few points.
Ropes ropesOf(std::vector<const MarkerView*> markers);

/// Adds the edges of a line through the points from `begin` to before `end`. Returns the point at which it ends. Of
/// equal points in a row the first stands for all: the edges before and after them, which touch there, are neighbours
/// then. No edge has the others, as long as they are equal.
Index addLine(const Positions& points, std::size_t begin, std::size_t end, std::vector<Edge>& edges);

/// Whether these are the ropes of the message before: as many, of as many points. Throws WireError where some have
/// other names then, and others not.
bool continues(const std::vector<RopeName>& before, const std::vector<RopeName>& ropes);

/// Makes one point of ends that are equal, where `weld` knows or finds it; `joins` false: of none. Segments without a
/// length go. Ends that came apart since the message before are all joined anew. Returns how many came apart.
std::size_t joinEnds(bool joins, SoupWeld& weld, Ropes& ropes);

}  // namespace dccd
