#include "paper/feature_ownership.h"

#include <algorithm>

namespace dccd {
namespace {

Edge sortedEdge(Index a, Index b) { return a < b ? Edge{a, b} : Edge{b, a}; }

std::size_t edgeIndex(const std::vector<Edge>& edges, const Edge& edge) {
  return static_cast<std::size_t>(std::lower_bound(edges.begin(), edges.end(), edge) - edges.begin());
}

}  // namespace

std::vector<Primitive> ownedPrimitives(const Topology& topology, Index vertex_offset) {
  const std::vector<Edge>& edges = topology.edges();  // sorted
  std::vector<std::uint8_t> vertex_owned(topology.vertexCount(), 0), edge_owned(edges.size(), 0);
  std::vector<Primitive> primitives;
  primitives.reserve(topology.faces().size());
  const auto take = [](std::vector<std::uint8_t>& owned, std::size_t i, std::uint8_t bit) -> std::uint8_t {
    if (owned[i]) return 0;
    owned[i] = 1;
    return bit;
  };
  for (const Face& face : topology.faces()) {
    Primitive p;
    p.features = Primitive::FACE_BIT;
    for (unsigned i = 0; i < 3; ++i) {
      p.vertex[i] = face[i] + vertex_offset;
      const std::size_t edge = edgeIndex(edges, sortedEdge(face[i], face[(i + 1) % 3]));
      p.features |= take(vertex_owned, face[i], static_cast<std::uint8_t>(Primitive::VERTEX_BIT << i));
      p.features |= take(edge_owned, edge, static_cast<std::uint8_t>(Primitive::EDGE_BIT << i));
    }
    primitives.push_back(p);
  }
  for (std::size_t e = 0; e < edges.size(); ++e) {
    if (edge_owned[e]) continue;
    Primitive p;
    p.vertex = {edges[e][0] + vertex_offset, edges[e][1] + vertex_offset, edges[e][1] + vertex_offset};
    p.features = Primitive::EDGE_BIT;
    for (unsigned i = 0; i < 2; ++i) {
      p.features |= take(vertex_owned, edges[e][i], static_cast<std::uint8_t>(Primitive::VERTEX_BIT << i));
    }
    primitives.push_back(p);
  }
  return primitives;
}

std::vector<Index> connectedParts(const std::vector<Primitive>& primitives) {
  Index vertex_count = 0;
  for (const Primitive& p : primitives) {
    for (Index v : p.vertex) vertex_count = std::max(vertex_count, v + 1);
  }
  std::vector<Index> parent(vertex_count);
  for (Index v = 0; v < vertex_count; ++v) parent[v] = v;
  const auto root = [&parent](Index v) {
    while (parent[v] != v) v = parent[v] = parent[parent[v]];  // path halving
    return v;
  };
  for (const Primitive& p : primitives) {
    for (int i = 1; i < 3; ++i) parent[root(p.vertex[i])] = root(p.vertex[0]);
  }
  std::vector<Index> part_of_root(vertex_count, NO_INDEX), parts;
  parts.reserve(primitives.size());
  Index count = 0;
  for (const Primitive& p : primitives) {
    Index& part = part_of_root[root(p.vertex[0])];
    if (part == NO_INDEX) part = count++;
    parts.push_back(part);
  }
  return parts;
}

}  // namespace dccd
