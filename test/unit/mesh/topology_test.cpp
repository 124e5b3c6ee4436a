#include "dccd/topology.h"
#include "support/said.h"

#include <gtest/gtest.h>

namespace dccd {
namespace {

TEST(Topology, EdgesOfASharedSideAreUnique) {
  const Topology t = Topology::fromTriangles(4, {{0, 1, 2}, {2, 1, 3}});
  const std::vector<Edge> expected{{0, 1}, {0, 2}, {1, 2}, {1, 3}, {2, 3}};
  EXPECT_EQ(t.edges(), expected);
  EXPECT_EQ(t.usedVertices(), (std::vector<Index>{0, 1, 2, 3}));
}

TEST(Topology, FaceGivenTwiceIsKeptOnceInItsFirstForm) {
  const Topology t = Topology::fromTriangles(5, {{2, 1, 0}, {0, 1, 2}, {1, 2, 4}});
  ASSERT_EQ(t.faces().size(), 2u);
  EXPECT_EQ(t.faces()[0], (Face{2, 1, 0}));
  EXPECT_EQ(t.usedVertices(), (std::vector<Index>{0, 1, 2, 4})) << "vertex 3 carries no feature";
}

TEST(Topology, ClosedIsWhatHasNoBorder) {
  const std::vector<Face> tetrahedron{{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
  EXPECT_TRUE(Topology::fromTriangles(5, tetrahedron).isClosed()) << "vertex 4 is part of nothing";
  std::vector<Face> faces = tetrahedron;
  faces.pop_back();
  EXPECT_FALSE(Topology::fromTriangles(4, faces).isClosed());
  faces = tetrahedron;
  for (const Face& f : tetrahedron)
    faces.push_back({f[0] > 1 ? f[0] + 2 : f[0], f[1] > 1 ? f[1] + 2 : f[1], f[2] > 1 ? f[2] + 2 : f[2]});
  const Topology joined = Topology::fromTriangles(6, faces);
  EXPECT_EQ(joined.edges().size(), 11u);
  EXPECT_TRUE(joined.isClosed()) << "two that share an edge, with four faces at it";
  faces.push_back({0, 1, 6});
  EXPECT_FALSE(Topology::fromTriangles(7, faces).isClosed()) << "five faces at one edge";
  EXPECT_FALSE(Topology::grid(3, 3).isClosed());
  EXPECT_FALSE(Topology::polyline(3).isClosed());
  EXPECT_FALSE(Topology().isClosed());
}

TEST(Topology, RefusesWhatIsNoMeshAndNamesIt) {
  const std::string text = test::said<TopologyError>([&] { Topology::fromTriangles(3, {{0, 1, 2}, {0, 1, 7}}); });
  EXPECT_NE(text.find("face 1 (0, 1, 7)"), std::string::npos) << text;
  EXPECT_NE(text.find("index 7"), std::string::npos) << text;
  EXPECT_THROW(Topology::fromTriangles(3, {{0, 1, 1}}), TopologyError);
  EXPECT_THROW(Topology::grid(1, 5), TopologyError);
  EXPECT_THROW(Topology::grid(70000, 70000), TopologyError);
  EXPECT_THROW(Topology::polyline(1), TopologyError);
}

TEST(Topology, GridCountsFollowEuler) {
  const std::size_t rows = 4, cols = 6;
  const Topology t = Topology::grid(rows, cols);
  EXPECT_EQ(t.faces().size(), 2 * (rows - 1) * (cols - 1));
  // A disc: V - E + F = 1.
  EXPECT_EQ(t.vertexCount() - t.edges().size() + t.faces().size(), 1u);
}

TEST(Topology, PolylineHasNoFaces) {
  const Topology t = Topology::polyline(3);
  EXPECT_FALSE(t.hasFaces());
  EXPECT_EQ(t.edges(), (std::vector<Edge>{{0, 1}, {1, 2}}));
}

TEST(Topology, RopesAreTheEdgesThatAreGiven) {
  const Topology t = Topology::fromEdges(6, {{4, 2}, {0, 1}, {2, 4}, {1, 2}});
  EXPECT_FALSE(t.hasFaces());
  EXPECT_FALSE(t.isClosed());
  EXPECT_EQ(t.edges(), (std::vector<Edge>{{0, 1}, {1, 2}, {2, 4}}));
  EXPECT_EQ(t.usedVertices(), (std::vector<Index>{0, 1, 2, 4}));
  EXPECT_EQ(Topology::fromEdges(3, {{1, 2}, {0, 1}}), Topology::polyline(3));
  EXPECT_THROW(Topology::fromEdges(3, {{0, 1}, {2, 2}}), TopologyError);
  EXPECT_THROW(Topology::fromEdges(3, {{0, 3}}), TopologyError);
}

}  // namespace
}  // namespace dccd
