#include "paper/feature_ownership.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

namespace dccd {
namespace {

void expectEveryFeatureOwnedOnce(const Topology& topology, Index offset) {
  std::map<Index, int> vertices;
  std::map<Edge, int> edges;
  std::size_t faces = 0;
  for (const Primitive& p : ownedPrimitives(topology, offset)) {
    for (int i = 0; i < 3; ++i) {
      if (p.ownsVertex(i)) ++vertices[p.vertex[i] - offset];
      if (p.ownsEdge(i)) {
        const Index a = p.vertex[i] - offset, b = p.vertex[(i + 1) % 3] - offset;
        ++edges[{std::min(a, b), std::max(a, b)}];
      }
    }
    if (p.isFace()) {
      const Face face{p.vertex[0] - offset, p.vertex[1] - offset, p.vertex[2] - offset};
      EXPECT_EQ(face, topology.faces()[faces++]);
    }
  }
  EXPECT_EQ(faces, topology.faces().size());
  EXPECT_EQ(vertices.size(), topology.usedVertices().size());
  for (Index v : topology.usedVertices()) EXPECT_EQ(vertices[v], 1) << "vertex " << v;
  EXPECT_EQ(edges.size(), topology.edges().size());
  for (const Edge& e : topology.edges()) EXPECT_EQ(edges[e], 1) << "edge " << e[0] << ' ' << e[1];
}

TEST(FeatureOwnership, EveryFeatureHasOneOwner) {
  expectEveryFeatureOwnedOnce(Topology::grid(5, 7), 0);
  expectEveryFeatureOwnedOnce(Topology::grid(5, 7), 1000);
  expectEveryFeatureOwnedOnce(Topology::polyline(12), 3);
  // An edge with three faces, two faces that share only a vertex, an unused vertex.
  expectEveryFeatureOwnedOnce(Topology::fromTriangles(9, {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {4, 5, 6}, {6, 5, 8}}), 10);
  expectEveryFeatureOwnedOnce(Topology::fromTriangles(0, {}), 0);
}

TEST(FeatureOwnership, PartsAreWhatSharedVerticesConnect) {
  const Topology t = Topology::fromTriangles(
      11, {{0, 1, 2}, {3, 4, 5}, {2, 6, 7}, {8, 9, 10}, {7, 5, 6}});  // the last joins the first three
  EXPECT_EQ(connectedParts(ownedPrimitives(t, 20)), (std::vector<Index>{0, 0, 0, 1, 0}));
  EXPECT_TRUE(connectedParts({}).empty());
}

}  // namespace
}  // namespace dccd
