// Which primitive owns which feature (representative triangles, Curtis et al. 2008): a vertex and an edge belong to
// several triangles, and a pair of features to several pairs of triangles. Each feature has one owner, the first
// primitive that carries it; a feature pair is tested only where its owners meet, so once at most.
//
// Adjacent primitives are paired like all others. A scheme that skips them must test their orphans (feature pairs that
// occur in adjacent triangles alone, Tang et al. 2009) elsewhere; here nothing is orphaned, and of the pairs of two
// adjacent primitives only those that share a vertex are left out.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "dccd/topology.h"

namespace dccd {

/// A face, or an edge that no face carries (its third vertex repeats the second).
struct Primitive {
  std::array<Index, 3> vertex{NO_INDEX, NO_INDEX, NO_INDEX};
  /// Bit i: owns vertex i. Bit 3 + i: owns the edge from vertex i to vertex (i + 1) % 3. Bit 6: is a face.
  std::uint8_t features = 0;

  static constexpr std::uint8_t VERTEX_BIT = 1, EDGE_BIT = 8, FACE_BIT = 64;
  bool ownsVertex(int i) const { return (features >> i) & 1; }
  bool ownsEdge(int i) const { return (features >> (3 + i)) & 1; }
  bool isFace() const { return features & FACE_BIT; }
};

/// The primitives of a body: its faces in order, then the edges without a face. Every used vertex, every edge and every
/// face of the topology is owned exactly once. `vertex_offset` is added to every index.
std::vector<Primitive> ownedPrimitives(const Topology& topology, Index vertex_offset = 0);

/// Connected parts: primitives that share a vertex are in one part. Returns one part number a primitive, numbered from
/// 0 in the order of each part's first primitive.
std::vector<Index> connectedParts(const std::vector<Primitive>& primitives);

}  // namespace dccd
