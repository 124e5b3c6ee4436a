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

/// What became of polygons.
struct PolygonFaces {
  std::vector<Face> faces;             ///< of all polygons, in their order; none repeats a vertex
  std::vector<std::size_t> ends;       ///< of each polygon among the faces
  std::vector<std::size_t> unchecked;  ///< numbers of the polygons that lie in no face, ascending
};

/// Triangulates. Every corner is below positions.size().
PolygonFaces facesOf(const Polygons& polygons, const Positions& positions);

}  // namespace dccd
