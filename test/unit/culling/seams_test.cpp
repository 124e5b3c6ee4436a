// Seams of doubled corners, held against a count of merged faces; and what was found in one step spares no later one.
#include "culling/seams.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

namespace dccd {
namespace {

/// Whether the merged faces, each once, are at least one, and an even number at each edge.
bool closes(const Topology& topology, const Positions& t0, const Positions& t1) {
  std::set<std::set<std::vector<double>>> faces;
  for (const Face& f : topology.faces()) {
    std::set<std::vector<double>> places;
    for (const Index v : f) places.insert({t0[v][0], t0[v][1], t0[v][2], t1[v][0], t1[v][1], t1[v][2]});
    if (places.size() == 3) faces.insert(places);
  }
  std::map<std::set<std::vector<double>>, int> faces_at;
  for (const auto& face : faces) {
    for (const auto& corner : face) {
      auto edge = face;
      edge.erase(corner);
      ++faces_at[edge];
    }
  }
  const auto odd = [](const auto& edge) { return edge.second % 2 != 0; };
  return !faces.empty() && std::none_of(faces_at.begin(), faces_at.end(), odd);
}

TEST(Seams, CloseWhatTheMergedFacesClose) {
  std::mt19937_64 random(5);
  std::size_t closed = 0, open_again = 0;
  for (int round = 0; round < 4000; ++round) {
    // Faces of a tetrahedron or two, in any number, with corners of their own, at one of few places each.
    const std::size_t count = 3 + random() % 9;
    std::vector<Face> faces;
    std::vector<Index> place;
    for (std::size_t f = 0; f < count; ++f) {
      const auto n = static_cast<Index>(place.size());
      faces.push_back({n, n + 1, n + 2});
      const std::size_t without = f < 4 ? f : random() % 4;  // a face of the tetrahedron has all places but one
      for (Index k = 0; k < 4; ++k) {
        if (k != without) place.push_back(k);
      }
      if (random() % 16 == 0) place.back() = static_cast<Index>(random() % 5);
    }
    const Topology topology = Topology::fromTriangles(place.size(), faces);
    Seams kept;
    for (int step = 0; step < 4; ++step) {
      Positions at(5), t0, t1;
      for (Vec3& p : at) p = Vec3(static_cast<double>(random() % 3), static_cast<double>(random() % 3), 1.0);
      if (random() % 2) at = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {2, 2, 2}};
      for (const Index p : place) t0.push_back(at[p]);
      t1 = t0;
      if (random() % 4 == 0) t1[random() % t1.size()].x() += 1;
      const bool truth = !topology.isClosed() && closes(topology, t0, t1);
      open_again += !truth && kept.border[0] != kept.border[1];
      kept = seamsOf(topology, t0, t1, kept);
      const Seams fresh = seamsOf(topology, t0, t1);
      ASSERT_EQ(!fresh.vertices.empty(), truth) << round;
      ASSERT_EQ(kept.vertices, fresh.vertices) << round;
      ASSERT_EQ(kept.repeated, fresh.repeated) << round;
      closed += truth;
      if (!truth) continue;
      ASSERT_TRUE(hold(fresh, t0, t1));
      t1[fresh.vertices[0][1]].y() += 1;
      ASSERT_FALSE(hold(fresh, t0, t1));
    }
  }
  EXPECT_GT(closed, 500u);
  EXPECT_GT(open_again, 500u);
}

TEST(Seams, NothingIsSewnThatIsClosedByItsNumbersOrHasNoFaces) {
  const Positions points = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0, 0, 0}};
  const Topology closed = Topology::fromTriangles(5, {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}});
  EXPECT_TRUE(seamsOf(closed, points, points).vertices.empty());
  EXPECT_TRUE(seamsOf(Topology::polyline(5), points, points).vertices.empty());
  const Topology open = Topology::fromTriangles(5, {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 4}});
  EXPECT_EQ(seamsOf(open, points, points).vertices, (std::vector<std::array<Index, 2>>{{0, 4}}));
}

}  // namespace
}  // namespace dccd
