#include "culling/cluster_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <limits>
#include <numeric>
#include <thread>

#include "culling/scene_arrays.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

bool isPermutation(std::vector<Index> order, std::size_t n) {
  std::sort(order.begin(), order.end());
  std::vector<Index> all(n);
  std::iota(all.begin(), all.end(), 0);
  return order == all;
}

TEST(ClusterTree, SpatialOrderIsAPermutationOfAnything) {
  for (int style = 0; style < static_cast<int>(Coordinates::COUNT); ++style) {
    for (const std::size_t n : {0, 1, 15, 16, 17, 255, 256, 257, 300, 5000}) {
      Positions x = randomPositions(drawFrom(1), n, static_cast<Coordinates>(style));
      EXPECT_TRUE(isPermutation(spatialOrder(x), n)) << n << " of style " << style;
      if (n > 20) {
        x[3] = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
        x[7] = Vec3::Constant(std::numeric_limits<double>::infinity());
        EXPECT_TRUE(isPermutation(spatialOrder(x), n)) << n << " of style " << style << " with some not finite";
      }
    }
  }
}

// What the order is for: runs of 16 and of 256 are compact. A line in random order must come back in order.
TEST(ClusterTree, SpatialOrderMakesRunsCompact) {
  const std::size_t n = 4096;
  std::vector<std::size_t> place(n);
  const Draw draw = drawFrom(2);
  for (std::size_t i = 0; i < n; ++i) place[i] = i;
  for (std::size_t i = n; i-- > 1;) std::swap(place[i], place[static_cast<std::size_t>(draw(0, static_cast<int>(i)))]);
  Positions x(n);
  for (std::size_t i = 0; i < n; ++i) x[i] = Vec3(static_cast<double>(place[i]), 0.25, -1);
  const std::vector<Index> order = spatialOrder(x);
  for (const std::size_t run : {16, 256}) {
    for (std::size_t first = 0; first < n; first += run) {
      double lo = HUGE_VAL, hi = -HUGE_VAL;
      for (std::size_t i = first; i < first + run; ++i) {
        lo = std::min(lo, x[order[i]][0]);
        hi = std::max(hi, x[order[i]][0]);
      }
      EXPECT_EQ(hi - lo, static_cast<double>(run - 1));
    }
  }
}

TEST(ClusterTree, HasLevelsForItsFeatures) {
  const struct {
    std::size_t features, height, leaf_groups;
  } CASES[] = {{0, 1, 1},    {1, 1, 1},    {16, 1, 1},     {17, 2, 2},
               {256, 2, 16}, {257, 3, 17}, {4096, 3, 256}, {4097, 4, 257}};
  for (const auto& c : CASES) {
    ClusterTree tree;
    std::vector<Index> features(2 * c.features, 0);
    for (std::size_t i = 0; i < c.features; ++i) features[2 * i + 1] = static_cast<Index>(i + 1);
    tree.build(features, 2);
    EXPECT_EQ(tree.featureCount(), c.features);
    EXPECT_EQ(tree.height(), c.height) << c.features;
    EXPECT_EQ(tree.level(0).groups, c.leaf_groups) << c.features;
    EXPECT_EQ(tree.level(tree.height() - 1).groups, 1u);
    if (c.features > 0) {
      EXPECT_EQ(tree.feature(c.features - 1)[1], c.features);
    }
    tree.raise(5);
    EXPECT_EQ(tree.height(), 5u);
    EXPECT_EQ(tree.level(4).groups, 1u);
  }
}

/// Bounds of a level's group straight from the features below it.
void expectBounds(const SceneArrays& scene, const ClusterTree& tree, const std::vector<std::uint16_t>& records) {
  std::size_t span = simd::GROUP;
  for (std::size_t l = 0; l < tree.height(); ++l, span *= simd::GROUP) {
    for (std::size_t g = 0; g < tree.level(l).groups; ++g) {
      for (std::size_t k = 0; k < simd::RECORD; ++k) {
        std::uint16_t lo = simd::EMPTY, hi = simd::turned(simd::EMPTY);
        for (std::size_t f = g * span; f < std::min((g + 1) * span, tree.featureCount()); ++f) {
          for (std::size_t i = 0; i < tree.arity(); ++i) {
            const std::uint16_t value = records[tree.feature(f)[i] * simd::RECORD + k];
            lo = std::min(lo, value);
            hi = std::max(hi, value);
          }
        }
        const std::uint16_t* aos = tree.level(l).aos.data() + g * simd::AOS_SIZE;
        ASSERT_EQ(aos[k], lo) << "level " << l << ", group " << g << " of " << scene.vertexCount() << " vertices";
        ASSERT_EQ(aos[simd::RECORD + k], simd::turned(hi)) << "level " << l << ", group " << g;
      }
    }
  }
}

TEST(ClusterTree, EveryLevelBoundsWhatIsBelow) {
  const Draw draw = drawFrom(4);
  TestStep step;
  StepBody body;
  body.topology = Topology::grid(21, 23);
  body.t0 = randomPositions(draw, body.topology.vertexCount(), Coordinates::REAL);
  body.t1 = randomMotion(draw, body.t0, Coordinates::REAL);
  step.bodies = {body};
  SceneArrays scene;
  StepStats stats;
  scene.setBodies(step.motion().bodies);
  scene.record(step.motion(), stats);
  scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);

  double low[8], high[8], scale[8];
  std::fill_n(low, 8, HUGE_VAL);
  std::fill_n(high, 8, -HUGE_VAL);
  simd::projectionBounds(scene.vertices()->t0, scene.vertexCount(), low, high);
  for (int d = 0; d < 8; ++d) scale[d] = std::min(simd::RECORD_RANGE / 2 / (high[d] / 2 - low[d] / 2), 1e300);
  std::vector<std::uint16_t> records(scene.vertexCount() * simd::RECORD);
  simd::quantize(scene.vertices()->t0, scene.vertexCount(), low, scale, records.data());
  for (const ClusterTree& tree : scene.bodies()[0].trees) expectBounds(scene, tree, records);
}

TEST(ClusterTree, LeavesThatWaitAreMadeWhenTheyAreNeeded) {
  std::vector<Index> features;
  for (Index i = 0; i + 1 < 600; ++i) features.insert(features.end(), {i, i + 1});
  std::vector<std::uint16_t> records[2];
  for (std::size_t i = 0; i < 600 * simd::RECORD; ++i) {
    records[0].push_back(static_cast<std::uint16_t>(i % 1009));
    records[1].push_back(static_cast<std::uint16_t>(i % 2003));
  }
  ClusterTree tree, before, after;
  for (ClusterTree* t : {&tree, &before, &after}) {
    t->build(features, 2);
    t->refitLeaves(records[t == &after].data(), nullptr, 0, t->level(0).groups);
    t->refitUpper();
  }
  const std::size_t groups = tree.level(0).groups;
  tree.letLeavesWait(true, records[1].data());
  tree.refitGroups(0, groups);
  tree.refitUpper();
  for (std::size_t l = 0; l < tree.height(); ++l) {
    const ClusterTree::Level &level = tree.level(l), &expected = after.level(l);
    EXPECT_TRUE(std::equal(expected.aos.data(), expected.aos.data() + level.groups * simd::AOS_SIZE, level.aos.data()));
    if (l == 0) continue;
    EXPECT_TRUE(std::equal(expected.soa.data(), expected.soa.data() + level.groups * simd::SOA_SIZE, level.soa.data()));
  }
  const auto isThatOf = [&](const ClusterTree& other, std::size_t group) {
    const std::uint16_t* soa = tree.level(0).soa.data() + group * simd::SOA_SIZE;
    return std::equal(soa, soa + simd::SOA_SIZE, other.level(0).soa.data() + group * simd::SOA_SIZE);
  };
  tree.needLeaves(7);
  for (std::size_t g = 0; g < groups; ++g) EXPECT_TRUE(isThatOf(g == 7 ? after : before, g)) << g;
  std::vector<std::thread> threads;
  std::atomic<std::size_t> ready{0};
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&] {
      for (std::size_t g = 0; g < groups; ++g) {
        tree.needLeaves(g);
        ready += isThatOf(after, g);
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(ready, 4 * groups);

  tree.letLeavesWait(false, nullptr);
  tree.refitLeaves(records[0].data(), nullptr, 0, groups);
  tree.needLeaves(0);
  EXPECT_TRUE(isThatOf(before, 0));

  tree.releaseLeaves(records[0].data());
  const std::uint16_t* middle = tree.level(0).soa.data() + 20 * simd::SOA_SIZE;
#ifdef __linux__
  EXPECT_EQ(std::count(middle, middle + simd::SOA_SIZE, 0), simd::SOA_SIZE) << "the system has its page";
#endif
  tree.needLeaves(20);
  EXPECT_TRUE(isThatOf(before, 20));
}

TEST(ClusterTree, MaskedFeaturesAreEmptyAndComeBack) {
  ClusterTree tree;
  std::vector<Index> features;
  for (Index i = 0; i + 1 < 40; ++i) features.insert(features.end(), {i, i + 1});
  tree.build(features, 2);
  std::vector<std::uint16_t> records(40 * simd::RECORD, 5);
  std::vector<std::uint8_t> active(40, 1);
  active[20] = 0;
  const auto isEmpty = [&](std::size_t slot) {
    const std::uint16_t* soa = tree.level(0).soa.data() + slot / simd::GROUP * simd::SOA_SIZE;
    return soa[simd::soaIndex(0, slot % simd::GROUP)] == simd::EMPTY;
  };
  tree.mask(active.data());
  tree.refitLeaves(records.data(), nullptr, 0, tree.level(0).groups);
  for (std::size_t slot = 0; slot < 48; ++slot) {
    EXPECT_EQ(isEmpty(slot), slot == 19 || slot == 20 || slot >= 39) << slot;
  }
  EXPECT_EQ(tree.feature(19)[1], 20u) << "the feature itself stays known";
  tree.mask(nullptr);
  tree.refitLeaves(records.data(), nullptr, 0, tree.level(0).groups);
  for (std::size_t slot = 0; slot < 48; ++slot) EXPECT_EQ(isEmpty(slot), slot >= 39) << slot;
}

}  // namespace
}  // namespace test
}  // namespace dccd
