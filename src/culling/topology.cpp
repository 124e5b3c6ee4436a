#include "dccd/topology.h"

#include <algorithm>

namespace dccd {
namespace {

std::string faceText(std::size_t i, const Face& f) {
  return "face " + std::to_string(i) + " (" + std::to_string(f[0]) + ", " + std::to_string(f[1]) + ", " +
         std::to_string(f[2]) + ")";
}

Face sorted(Face f) {
  std::sort(f.begin(), f.end());
  return f;
}

void requireIndexable(std::size_t vertex_count) {
  if (vertex_count >= NO_INDEX) {
    throw TopologyError("vertex count " + std::to_string(vertex_count) + " does not fit a 32-bit index");
  }
}

}  // namespace

Topology Topology::fromTriangles(std::size_t vertex_count, const std::vector<Face>& faces) {
  requireIndexable(vertex_count);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    const Face& f = faces[i];
    for (Index v : f) {
      if (v >= vertex_count) {
        throw TopologyError(faceText(i, f) + ": index " + std::to_string(v) + " is not below the vertex count " +
                            std::to_string(vertex_count));
      }
    }
    if (f[0] == f[1] || f[1] == f[2] || f[2] == f[0]) {
      throw TopologyError(faceText(i, f) + " repeats a vertex");
    }
  }
  // Keep the first of equal faces, in the order of the input: each feature pair is reported once at most.
  std::vector<std::pair<Face, Index>> keyed(faces.size());
  for (std::size_t i = 0; i < faces.size(); ++i) keyed[i] = {sorted(faces[i]), static_cast<Index>(i)};
  std::sort(keyed.begin(), keyed.end());
  std::vector<std::uint8_t> keep(faces.size(), 1);
  for (std::size_t i = 1; i < keyed.size(); ++i) {
    if (keyed[i].first == keyed[i - 1].first) keep[keyed[i].second] = 0;
  }
  Topology t;
  t.vertex_count_ = vertex_count;
  t.faces_.reserve(faces.size());
  t.edges_.reserve(faces.size() * 3);
  for (std::size_t i = 0; i < faces.size(); ++i) {
    if (!keep[i]) continue;
    const Face& f = faces[i];
    t.faces_.push_back(f);
    for (int k = 0; k < 3; ++k) t.edges_.push_back({std::min(f[k], f[(k + 1) % 3]), std::max(f[k], f[(k + 1) % 3])});
  }
  t.finish();
  return t;
}

Topology Topology::grid(std::size_t rows, std::size_t cols) {
  if (rows < 2 || cols < 2) {
    throw TopologyError("a grid needs at least 2 rows and 2 cols, got " + std::to_string(rows) + " x " +
                        std::to_string(cols));
  }
  if (rows >= NO_INDEX / cols) {
    throw TopologyError("a grid of " + std::to_string(rows) + " x " + std::to_string(cols) +
                        " does not fit a 32-bit index");
  }
  std::vector<Face> faces;
  faces.reserve(2 * (rows - 1) * (cols - 1));
  for (std::size_t r = 0; r + 1 < rows; ++r) {
    for (std::size_t c = 0; c + 1 < cols; ++c) {
      const Index a = static_cast<Index>(r * cols + c), b = a + 1;
      const Index d = static_cast<Index>(a + cols), e = d + 1;
      faces.push_back({a, d, b});
      faces.push_back({b, d, e});
    }
  }
  return fromTriangles(rows * cols, faces);
}

Topology Topology::polyline(std::size_t vertex_count) {
  if (vertex_count < 2) {
    throw TopologyError("a polyline needs at least 2 points, got " + std::to_string(vertex_count));
  }
  requireIndexable(vertex_count);
  Topology t;
  t.vertex_count_ = vertex_count;
  t.edges_.reserve(vertex_count - 1);
  for (Index i = 0; i + 1 < vertex_count; ++i) t.edges_.push_back({i, i + 1});
  t.finish();
  return t;
}

Topology Topology::fromEdges(std::size_t vertex_count, const std::vector<Edge>& edges) {
  requireIndexable(vertex_count);
  Topology t;
  t.vertex_count_ = vertex_count;
  t.edges_.reserve(edges.size());
  for (std::size_t i = 0; i < edges.size(); ++i) {
    const auto [first, second] = std::minmax(edges[i][0], edges[i][1]);
    if (first == second || second >= vertex_count) {
      throw TopologyError(
          "edge " + std::to_string(i) + " (" + std::to_string(edges[i][0]) + ", " + std::to_string(edges[i][1]) + ") " +
          (first == second ? "repeats a vertex"
                           : "names a vertex that is not below the vertex count " + std::to_string(vertex_count)));
    }
    t.edges_.push_back({first, second});
  }
  t.finish();
  return t;
}

void Topology::finish() {
  std::sort(edges_.begin(), edges_.end());
  closed_ = hasFaces();  // an edge is still listed once for each of its faces
  for (auto first = edges_.begin(); closed_ && first != edges_.end();) {
    const auto last = std::find_if(first, edges_.end(), [&](const Edge& e) { return e != *first; });
    border_edge_ = *first;
    closed_ = (last - first) % 2 == 0;
    first = last;
  }
  edges_.erase(std::unique(edges_.begin(), edges_.end()), edges_.end());
  edges_.shrink_to_fit();
  std::vector<std::uint8_t> used(vertex_count_, 0);
  for (const Edge& e : edges_) used[e[0]] = used[e[1]] = 1;
  for (std::size_t v = 0; v < vertex_count_; ++v) {
    if (used[v]) used_vertices_.push_back(static_cast<Index>(v));
  }
}

}  // namespace dccd
