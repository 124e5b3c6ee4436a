// Polygons, as files and messages bring them, become triangles here and nowhere else.
#pragma once

#include <vector>

#include "dccd/types.h"

namespace dccd {

/// Polygons by vertex, one after the other; of any number of corners.
struct Polygons {
  std::vector<Index> corners;
  std::vector<std::size_t> ends;  ///< of each polygon among the corners

  std::size_t size() const { return ends.size(); }
  std::size_t begin(std::size_t polygon) const { return polygon == 0 ? 0 : ends[polygon - 1]; }
  void add(const std::vector<Index>& polygon) {
    corners.insert(corners.end(), polygon.begin(), polygon.end());
    ends.push_back(corners.size());
  }
  friend bool operator==(const Polygons& a, const Polygons& b) { return a.corners == b.corners && a.ends == b.ends; }
};

/// Of a polygon that is not convex: beyond this it is unchecked. The time of one is quadratic in its corners.
constexpr std::size_t MAX_CONCAVE_CORNERS = 256;

/// What became of polygons.
struct PolygonFaces {
  std::vector<Face> faces;             ///< of all polygons, in their order; none repeats a vertex
  std::vector<std::size_t> ends;       ///< of each polygon among the faces
  std::vector<std::size_t> unchecked;  ///< numbers of the polygons that lie in no face, ascending
  std::vector<std::size_t> unseen;     ///< of these, the ones with a corner that was not finite
};

/// Every corner is below positions.size(). Corners that repeat the one before count once. Then
///  - one or two corners are a vertex or an edge: unchecked unless a face has that, too; none is nothing;
///  - three are their triangle;
///  - more are judged in the coordinate plane where their area is largest (of Newell's normal), by exact signs. A
///  convex
///    polygon is the fan of its first corner; another one that does not touch itself is cut by ears: the triangles lie
///    side by side and fill its outline. Of a polygon that is not plane the same triangles are taken.
/// What else there is (a corner named twice, an outline that touches itself or has no area, a corner that is not
/// finite, too many corners) is unchecked.
///
/// before: what became of the same polygons earlier. It is kept, so that a mesh that deforms stays one mesh; only its
/// `unseen` ones are looked at again.
PolygonFaces facesOf(const Polygons& polygons, const Positions& positions, const PolygonFaces* before = nullptr);

}  // namespace dccd
