// Which features of a body are not asked for how far they are from each other: those that are near along its edges, by
// ways that are computed otherwise.
#include "step/clearance/surface_neighbours.h"

#include <gtest/gtest.h>

#include <functional>
#include <limits>
#include <queue>

#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

/// A square sheet, wavy, so that its edges have many lengths.
struct Sheet {
  Sheet(std::size_t side, double self_m) {
    Body body;
    body.name = "sheet";
    body.topology = share(Topology::grid(side, side));
    Positions positions;
    for (std::size_t i = 0; i < side * side; ++i) {
      const auto x = static_cast<double>(i % side), y = static_cast<double>(i / side);
      positions.emplace_back(x, y, std::sin(0.9 * x + 0.4 * y));
    }
    body.t0 = body.t1 = share(positions);
    scene.setBodies({body});
    tree.build(scene.bodies()[0], positions);
    neighbours.set(*body.topology, positions, self_m, tree);
    edges.resize(positions.size());
    for (const Edge& e : body.topology->edges()) {
      const double length_m = (positions[e[0]] - positions[e[1]]).norm();
      edges[e[0]].emplace_back(length_m, e[1]);
      edges[e[1]].emplace_back(length_m, e[0]);
    }
    near.resize(positions.size());
    for (Index v = 0; v < positions.size(); ++v) near[v] = nearTo(v, self_m);
    all_near.assign(tree.nodeCount(), std::vector<signed char>(tree.nodeCount(), -1));
    depth.assign(tree.nodeCount(), 0);
    for (std::uint32_t n = 0; n < tree.nodeCount(); ++n) {
      if (!tree.isLeaf(n)) tree.forChildren(n, [&](std::uint32_t child) { depth[child] = depth[n] + 1; });
    }
  }
  std::vector<bool> nearTo(Index from, double self_m) const {
    using Way = std::pair<double, Index>;
    std::vector<double> way(edges.size(), std::numeric_limits<double>::infinity());
    std::priority_queue<Way, std::vector<Way>, std::greater<>> open;
    open.emplace(way[from] = 0, from);
    while (!open.empty()) {
      const auto [length_m, v] = open.top();
      open.pop();
      for (const auto& [edge_m, w] : edges[v]) {
        if (length_m + edge_m < way[w]) open.emplace(way[w] = length_m + edge_m, w);
      }
    }
    std::vector<bool> is_near;
    for (const double m : way) is_near.push_back(m < self_m);
    return is_near;
  }
  bool areNear(std::uint32_t f, std::uint32_t g) const {
    for (const Index v : tree.features()[f]) {
      for (const Index w : tree.features()[g]) {
        if (near[v][w]) return true;
      }
    }
    return false;
  }
  /// Each feature of the one node and each of the other.
  bool areAllNear(std::uint32_t a, std::uint32_t b) {
    signed char& known = all_near[a][b];
    if (known >= 0) return known != 0;
    bool all = true;
    if (!tree.isLeaf(a)) {
      tree.forChildren(a, [&](std::uint32_t child) { all = all && areAllNear(child, b); });
    } else if (!tree.isLeaf(b)) {
      tree.forChildren(b, [&](std::uint32_t child) { all = all && areAllNear(a, child); });
    } else {
      for (std::uint32_t i = 0; i < tree.count(a); ++i) {
        for (std::uint32_t j = 0; j < tree.count(b); ++j) all = all && areNear(tree.first(a) + i, tree.first(b) + j);
      }
    }
    known = static_cast<signed char>(all);
    return all;
  }

  SceneArrays scene;
  FeatureTree tree;
  SurfaceNeighbours neighbours;
  std::vector<std::vector<std::pair<double, Index>>> edges;
  std::vector<std::vector<bool>> near;
  std::vector<std::vector<signed char>> all_near;
  std::vector<int> depth;
};

TEST(SurfaceNeighbours, NodesAreLeftOutWhereAllTheirFeaturesAreNear) {
  Sheet sheet(25, 7);
  std::size_t whole_above = 0;
  for (std::uint32_t a = 0; a < sheet.tree.nodeCount(); ++a) {
    for (std::uint32_t b = a; b < sheet.tree.nodeCount(); ++b) {
      // Of nodes that are far from each other in size, or of which one holds the other, a search never asks.
      if (std::abs(sheet.depth[a] - sheet.depth[b]) > 1) continue;
      if (a != b && sheet.tree.first(b) < sheet.tree.first(a) + sheet.tree.count(a)) continue;
      const bool left_out = sheet.neighbours.asked(a, b) == 0;
      EXPECT_EQ(left_out, sheet.areAllNear(a, b)) << a << " and " << b;
      whole_above += left_out && !sheet.tree.isLeaf(a) && !sheet.tree.isLeaf(b);
    }
  }
  EXPECT_GT(whole_above, 500u);
}

// Where a table of all neighbours would be too large, what is left out is near; not all that is near is left out.
TEST(SurfaceNeighbours, OfALargeSheetOnlyNearNodesAreLeftOut) {
  Sheet sheet(47, 70);
  std::size_t left_out = 0, above = 0;
  for (std::uint32_t a = 0; a < sheet.tree.nodeCount(); ++a) {
    for (std::uint32_t b = a; b < sheet.tree.nodeCount(); ++b) {
      if (sheet.neighbours.asked(a, b) != 0) continue;
      ++left_out;
      above += sheet.tree.count(a) > 64 && sheet.tree.count(b) > 64;
      EXPECT_TRUE(sheet.areAllNear(a, b)) << a << " and " << b;
    }
  }
  EXPECT_GT(left_out, 10000u);
  EXPECT_GT(above, 100u);
  std::size_t features = 0;
  for (std::uint32_t f = 0; f < sheet.tree.features().size(); f += 97) {
    for (std::uint32_t g = f; g < sheet.tree.features().size(); ++g) {
      EXPECT_EQ(sheet.neighbours.leavesOut(f, g), sheet.areNear(f, g)) << f << " and " << g;
      ++features;
    }
  }
  EXPECT_GT(features, 10000u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
