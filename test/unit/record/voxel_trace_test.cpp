// What is said of a feature and a leaf is what the flow does with them, in scenes of all kinds: each feature, each
// leaf.
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <utility>

#include "record/explain.h"
#include "support/detector.h"

namespace dccd {
namespace test {
namespace {

std::vector<Index> sorted(const Index* first, std::size_t count) {
  std::vector<Index> vertices(first, first + count);
  std::sort(vertices.begin(), vertices.end());
  return vertices;
}

/// The contact of a feature with a leaf; null: there is none.
const Contact* contactOf(const Outcome& outcome, PairKind kind, const std::vector<Index>& vertices,
                         const VoxelKey& leaf) {
  const std::vector<Index> feature = sorted(vertices.data(), vertices.size());
  for (const Contact& c : outcome.contacts) {
    if (c.kind == kind && c.voxel == leaf && sorted(c.vertex.data(), vertices.size()) == feature) return &c;
  }
  return nullptr;
}

/// A small sheet or rope among leaves of two sizes; parts of it rest, and some of it lies on the voxels' planes.
Step randomScene(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto any = [&](int low, int high) {
    return low + static_cast<int>(random() % static_cast<std::uint64_t>(high - low + 1));
  };
  std::vector<OccupiedLeaf> leaves = {{{32770, 32768, 32768}, 2}};
  for (int z = 0; z < 2; ++z) {
    for (int x = 0; x < 2; ++x) {
      for (int y = 0; y < 3; ++y) {
        if (any(0, 2) == 0) continue;
        leaves.push_back({{static_cast<std::uint16_t>(32768 + x), static_cast<std::uint16_t>(32768 + y),
                           static_cast<std::uint16_t>(32768 + z)},
                          1});
      }
    }
  }
  const bool rope = seed % 4 == 3;
  const std::size_t side = 3, count = rope ? 5 : side * side;
  Positions t0(count), t1(count);
  const double reach = seed % 2 ? 0.3 : 1;
  for (std::size_t v = 0; v < count; ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      t0[v][axis] = 0.25 * any(-4, 16) + (any(0, 1) ? 0 : 0.01 * any(-9, 9));
      t1[v][axis] = t0[v][axis] + (any(0, 2) ? reach * 0.1 * any(-15, 15) : 0);
    }
  }
  Step step;
  step.bodies.resize(1);
  Body& body = step.bodies[0];
  body.name = rope ? "rope" : "sheet";
  body.topology = share(rope ? Topology::polyline(count) : Topology::grid(side, side));
  body.t0 = share(t0);
  body.t1 = share(t1);
  if (seed % 5 == 4) body.vertex_mask = {1};
  step.start_ns = 0;
  step.stamp_ns = 1;
  step.map = {VoxelSurface::build(1, leaves), 1, Eigen::Isometry3d::Identity(), {}};
  return step;
}

TEST(VoxelTrace, SaysOfEachFeatureAndLeafWhatTheFlowDoes) {
  std::size_t kept = 0, rejected = 0, contacts = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const Step step = randomScene(seed);
    Options options;
    if (seed % 3 == 0) options.accuracy.rung = Accuracy::CONSERVATIVE;
    const Outcome outcome = Detector(options).run(step);
    std::vector<Outcome> of_leaf;  // as if it were alone, so that no neighbour covers it
    for (const OccupiedLeaf& leaf : step.map.surface->leaves()) {
      Step alone = step;
      alone.map.surface = VoxelSurface::build(1, {leaf});
      of_leaf.push_back(Detector(options).run(alone));
    }
    const Topology& topology = *step.bodies[0].topology;
    std::vector<std::pair<PairKind, std::vector<Index>>> features;
    for (const Index v : topology.usedVertices()) features.push_back({PairKind::VERTEX_VOXEL_FACE, {v}});
    for (const Edge& e : topology.edges()) features.push_back({PairKind::EDGE_VOXEL_EDGE, {e[0], e[1]}});
    for (const Face& f : topology.faces()) features.push_back({PairKind::FACE_VOXEL_CORNER, {f[0], f[1], f[2]}});
    for (const auto& [kind, vertices] : features) {
      for (std::size_t i = 0; i < of_leaf.size(); ++i) {
        const VoxelKey leaf = step.map.surface->leaves()[i].min;
        const std::vector<TraceLine> lines = explain(step, options, PairQuestion{kind, {0, 0}, vertices, leaf});
        const Contact* contact = contactOf(outcome, kind, vertices, leaf);
        if (lines.front().stage == "rules") {
          EXPECT_EQ(contact, nullptr);
          continue;
        }
        ASSERT_EQ(lines.size(), 2u);
        ASSERT_EQ(lines[0].stage, "bounds");
        const bool is_kept = lines[0].says == TraceLine::Says::KEPT;
        ++(is_kept ? kept : rejected);
        EXPECT_TRUE(is_kept || !contactOf(of_leaf[i], kind, vertices, leaf))
            << "seed " << seed << ", " << toString(kind) << ' ' << vertices[0] << ", leaf " << leaf.x << ' ' << leaf.y
            << ' ' << leaf.z;
        EXPECT_EQ(lines[1].says, !contact                                   ? TraceLine::Says::REJECTED
                                 : contact->certainty == Certainty::CERTAIN ? TraceLine::Says::CONTACT
                                                                            : TraceLine::Says::UNDECIDED);
        contacts += contact != nullptr;
      }
    }
  }
  EXPECT_GT(kept, 300u);
  EXPECT_GT(rejected, 300u);
  EXPECT_GT(contacts, 100u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
