// A step's positions in the scene's arrays: bodies of several pieces and many small ones, in whatever order the pieces
// are copied, against what a reader of the positions says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <limits>
#include <random>
#include <set>

#include "culling/scene_arrays.h"
#include "simd/cluster_bounds.h"
#include "support/detector.h"

namespace dccd {
namespace test {
namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

/// A body with five pieces, nine with one, and one of which nothing is active.
struct Bodies {
  std::vector<Body> setups;
  std::vector<Positions> t0, t1;
  std::vector<std::set<Index>> lost;  ///< by body; not finite

  explicit Bodies(std::uint64_t seed) {
    std::mt19937_64 random(seed);
    std::uniform_real_distribution<double> place(-3, 5);
    for (std::size_t b = 0; b < 11; ++b) {
      Body body;
      body.name = "body " + std::to_string(b);
      body.topology = std::make_shared<const Topology>(b == 4 ? Topology::grid(90, 95) : Topology::grid(4, 5));
      const std::size_t n = body.topology->vertexCount();
      t0.emplace_back(n);
      t1.emplace_back(n);
      for (std::size_t i = 0; i < n; ++i) {
        for (int axis = 0; axis < 3; ++axis) {
          t0[b][i][axis] = place(random);
          t1[b][i][axis] = place(random);
        }
      }
      lost.emplace_back();
      if (b == 9) {  // far from everything, but of it nothing counts
        for (Index i = 0; i < n; ++i) body.vertex_mask.push_back(i);
        for (Vec3& x : t0[b]) x *= 1000;
      }
      setups.push_back(body);
    }
  }
  void lose(std::size_t b, Index v) {
    t0[b][v].x() = 1000;  // were it taken for a position, it would be seen
    t1[b][v].y() = NOT_A_NUMBER;
    lost[b].insert(v);
  }
  Step step() const {
    Step step;
    for (std::size_t b = 0; b < setups.size(); ++b) step.bodies.push_back(moving(setups[b], t0[b], t1[b]));
    return step;
  }
  bool isActive(std::size_t b, Index v) const {
    const auto& mask = setups[b].vertex_mask;
    return lost[b].count(v) == 0 && std::find(mask.begin(), mask.end(), v) == mask.end();
  }
};

/// As threads may do it: some other order, pieces of any size.
struct Shuffled {
  std::uint64_t seed;
  template <class F>
  void operator()(std::size_t n, std::size_t, const F& f) const {
    std::mt19937_64 random(seed);
    std::vector<std::size_t> ends{0, n};
    for (int cut = 0; cut < 4; ++cut) ends.push_back(random() % (n + 1));
    std::sort(ends.begin(), ends.end());
    std::vector<std::size_t> order(ends.size() - 1);
    for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
    std::shuffle(order.begin(), order.end(), random);
    for (const std::size_t i : order) f(ends[i], ends[i + 1]);
  }
};

void expectTruth(const Bodies& truth, const SceneArrays& scene, const StepStats& stats, std::size_t kept) {
  std::size_t unchecked = 0;
  for (std::size_t b = 0; b < truth.setups.size(); ++b) {
    const SceneBody& body = scene.bodies()[b];
    ASSERT_EQ(body.usedCount(), truth.t0[b].size());
    unchecked += truth.lost[b].size();
    double low[8], high[8];
    std::fill_n(low, 8, std::numeric_limits<double>::infinity());
    std::fill_n(high, 8, -std::numeric_limits<double>::infinity());
    bool masked = false;
    for (std::size_t i = 0; i < body.usedCount(); ++i) {
      const Index v = body.slot_vertex[i];
      const bool active = truth.isActive(b, v);
      EXPECT_EQ(body.active[i] != 0, active) << "body " << b << ", vertex " << v;
      masked |= !active;
      if (!active) continue;
      const Vec3 &p = truth.t0[b][v], &q = truth.t1[b][v];
      const VertexMotion expected{{p[0], p[1], p[2], 0}, {q[0], q[1], q[2], 0}};
      EXPECT_EQ(std::memcmp(&scene.vertices()[body.internal_begin + i], &expected, sizeof expected), 0);
      simd::projectionBounds(expected.t0, 1, low, high);
    }
    EXPECT_EQ(body.masked, masked) << b;
    for (int d = 0; d < 8; ++d) {
      EXPECT_EQ(body.bounds_min[d], low[d]) << "body " << b << ", direction " << d;
      EXPECT_EQ(body.bounds_max[d], high[d]) << "body " << b << ", direction " << d;
    }
  }
  EXPECT_EQ(stats.unchecked_vertices, unchecked);
  EXPECT_EQ(std::count_if(scene.bodies().begin(), scene.bodies().end(), [](const SceneBody& b) { return b.kept; }),
            static_cast<std::ptrdiff_t>(kept));
}

TEST(SceneRecords, AreThoseOfThePositionsInWhateverOrderPiecesAreCopied) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Bodies truth(seed);
    SceneArrays scene;
    scene.setBodies(truth.step().bodies);
    const Shuffled pieces{seed};
    const auto record = [&](std::size_t kept) {
      StepStats stats;
      scene.record(truth.step(), stats, pieces);
      expectTruth(truth, scene, stats, kept);
      scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
    };
    record(0);
    record(0);   // chooses a range that can be kept
    record(10);  // all but the one with a mask
    // One vertex, wherever it is.
    truth.t1[4][seed * 401 % 8550].x() += 0.125;
    record(9);
    record(10);
    // The first active vertex stands for what is lost: here pieces without any come before it.
    for (std::size_t i = 0; i < 8550; ++i) {
      if (i < 7000 || i % 3 == seed % 3) truth.lose(4, scene.bodies()[4].slot_vertex[i]);
    }
    truth.lose(2, 3);
    record(8);
    record(8);
  }
}

TEST(SceneRecords, ABodyWithoutAnythingActiveSpansNothing) {
  Bodies truth(3);
  for (Index v = 0; v < 8550; ++v) truth.lose(4, v);
  SceneArrays scene;
  scene.setBodies(truth.step().bodies);
  StepStats stats;
  scene.record(truth.step(), stats, Shuffled{3});
  expectTruth(truth, scene, stats, 0);
  scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
  std::uint16_t lowest = simd::EMPTY, highest = 0;
  for (const Index internal : {scene.bodies()[0].internal_begin, scene.bodies()[1].internal_begin}) {
    for (Index i = 0; i < 20; ++i) {
      lowest = std::min(lowest, scene.record(internal + i)[0]);
      highest = std::max(highest, scene.record(internal + i)[0]);
    }
  }
  EXPECT_GT(highest - lowest, 32764)
      << "the records span what is active: its own positions are hundreds of metres away";
}

TEST(SceneRecords, FarFromAMetreVerticesAreScaledWhereThatRoundsNothing) {
  const Bodies at_a_metre(5);
  const auto recordOf = [](const Bodies& truth, SceneArrays& scene, bool may_scale) {
    StepStats stats;
    scene.record(truth.step(), stats, Shuffled{5}, false, may_scale);
    scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
  };
  // Of the first body, all of which is active.
  const auto expectTimes = [](const SceneArrays& scene, const Bodies& truth, int exponent) {
    const SceneBody& body = scene.bodies()[0];
    for (std::size_t i = 0; i < body.usedCount(); ++i) {
      const VertexMotion& vertex = scene.vertices()[body.internal_begin + i];
      for (int k = 0; k < 3; ++k) {
        EXPECT_EQ(vertex.t0[k], std::ldexp(truth.t0[0][body.slot_vertex[i]][k], exponent));
        EXPECT_EQ(vertex.t1[k], std::ldexp(truth.t1[0][body.slot_vertex[i]][k], exponent));
      }
    }
  };
  SceneArrays plain;
  plain.setBodies(at_a_metre.step().bodies);
  recordOf(at_a_metre, plain, true);
  expectTimes(plain, at_a_metre, 0);
  for (const int exponent : {160, -160, -1000}) {
    Bodies truth = at_a_metre;
    for (auto* positions : {&truth.t0, &truth.t1}) {
      for (Positions& of : *positions) {
        for (Vec3& p : of) {
          for (int k = 0; k < 3; ++k) p[k] = std::ldexp(p[k], exponent);
        }
      }
    }
    SceneArrays scene;
    scene.setBodies(at_a_metre.step().bodies);  // the same order of features
    for (int times = 0; times < 2; ++times) {   // nothing is kept
      recordOf(truth, scene, true);
      expectTimes(scene, truth, -exponent - 2);  // the largest coordinate is 4 to 5 m
      for (const SceneBody& body : scene.bodies()) EXPECT_FALSE(body.kept);
      for (Index v = 0; v < scene.vertexCount(); ++v)
        ASSERT_EQ(std::memcmp(scene.record(v), plain.record(v), simd::RECORD * sizeof(std::uint16_t)), 0) << v;
    }
    recordOf(truth, scene, false);
    expectTimes(scene, truth, 0);
    if (exponent < 0) continue;
    truth.t1[0][7].y() = 1 / 3.0 * 0x1p-1000;  // would become denormal
    recordOf(truth, scene, true);
    expectTimes(scene, truth, 0);
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
