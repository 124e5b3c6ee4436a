// The connectivity of one body: faces, unique edges, and which vertices carry a feature.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/types.h"

namespace dccd {

/// Thrown for connectivity that cannot be a mesh; the text names the element and the value.
struct DCCD_EXPORT TopologyError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// Immutable connectivity of one body. Edges are unique and sorted; degenerate faces (a repeated index) are refused.
class DCCD_EXPORT Topology {
 public:
  Topology() = default;

  /// Triangle mesh. Throws TopologyError on an index >= vertex_count or a face that repeats a vertex.
  /// A face given twice (same three vertices in any order) is kept once.
  static Topology fromTriangles(std::size_t vertex_count, const std::vector<Face>& faces);

  /// Row-major grid of rows x cols points, two triangles a cell. Throws when rows or cols < 2.
  static Topology grid(std::size_t rows, std::size_t cols);

  /// Rope: edges between consecutive points, no faces. Throws when vertex_count < 2.
  static Topology polyline(std::size_t vertex_count);

  std::size_t vertexCount() const { return vertex_count_; }
  const std::vector<Face>& faces() const { return faces_; }
  const std::vector<Edge>& edges() const { return edges_; }
  bool hasFaces() const { return !faces_.empty(); }
  /// There are faces and every edge lies on an even number of them: no border, so that each point of space that is not
  /// on the surface is inside of it or outside, however it is bent.
  bool isClosed() const { return closed_; }
  /// An edge that keeps it from being closed; of a closed surface, any edge. There must be faces.
  const Edge& borderEdge() const { return border_edge_; }

  /// Vertices that belong to at least one edge, ascending. Others are not features and never in contact.
  const std::vector<Index>& usedVertices() const { return used_vertices_; }

  friend bool operator==(const Topology& a, const Topology& b) {
    return a.vertex_count_ == b.vertex_count_ && a.faces_ == b.faces_ && a.edges_ == b.edges_;
  }
  friend bool operator!=(const Topology& a, const Topology& b) { return !(a == b); }

 private:
  std::size_t vertex_count_ = 0;
  std::vector<Face> faces_;
  std::vector<Edge> edges_;
  std::vector<Index> used_vertices_;
  bool closed_ = false;
  Edge border_edge_{};
  void finish();
};

}  // namespace dccd
