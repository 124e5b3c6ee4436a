// The stream of pairs against all pairs: what is missing must be apart, shown exactly.
#include "culling/cluster_pairs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <set>

#include "culling/scene_arrays.h"
#include "support/step_support.h"
#include "support/step_truth.h"

namespace dccd {
namespace test {
namespace {

using SlotPair = std::pair<std::uint32_t, std::uint32_t>;

struct Scene {
  TestStep step;
  SceneArrays arrays;
  explicit Scene(TestStep s) : step(std::move(s)) {
    StepStats stats;
    arrays.setBodies(step.motion().bodies);
    arrays.record(step.motion(), stats);
    arrays.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
  }
};

std::vector<SlotPair> streamed(const TreePair& trees) {
  std::vector<std::uint32_t> groups, scratch;
  superclusterPairs(trees, groups, scratch);
  std::vector<SlotPair> pairs;
  ClusterPairStream stream;
  stream.run(trees, groups.data(), groups.size() / 2, [&](const std::uint32_t* slots, std::size_t n) {
    EXPECT_LE(n, ClusterPairStream::CHUNK);
    for (std::size_t i = 0; i < n; ++i) pairs.push_back({slots[2 * i], slots[2 * i + 1]});
    return true;
  });
  return pairs;
}

/// Sign of (a + s b) - (c + s d), exact: the rounding errors of the sums are doubles, too (Knuth's TwoSum), and the
/// sums' order decides unless they are equal.
int compareSums(double a, double b, double c, double d) {
  const auto twoSum = [](double x, double y, double& error) {
    const double sum = x + y, part = sum - x;
    error = (x - (sum - part)) + (y - part);
    return sum;
  };
  double error_ab, error_cd;
  const double ab = twoSum(a, b, error_ab), cd = twoSum(c, d, error_cd);
  if (ab != cd) return ab > cd ? 1 : -1;
  return error_ab > error_cd ? 1 : error_ab < error_cd ? -1 : 0;
}

int compareProjections(const double* x, const double* y, int d) {
  static const int FIRST[8] = {0, 1, 2, 0, 0, 1, 0, 1}, SECOND[8] = {-1, -1, -1, 1, 2, 2, 1, 2};
  if (SECOND[d] < 0) return (x[d] > y[d]) - (x[d] < y[d]);
  const double s = d < 6 ? 1 : -1;
  return compareSums(x[FIRST[d]], s * x[SECOND[d]], y[FIRST[d]], s * y[SECOND[d]]);
}

/// Exactly: in some direction and on one side at both ends (or at t0 alone), so that the features never meet.
/// Coordinates must be such that sums do not overflow.
bool provedApart(const VertexMotion* x, const Index* a, std::size_t na, const Index* b, std::size_t nb, bool t0_only) {
  for (int d = 0; d < 8; ++d) {
    bool above = true, below = true;
    for (std::size_t i = 0; i < na; ++i) {
      for (std::size_t j = 0; j < nb; ++j) {
        const int at0 = compareProjections(x[a[i]].t0, x[b[j]].t0, d);
        const int at1 = t0_only ? at0 : compareProjections(x[a[i]].t1, x[b[j]].t1, d);
        above &= at0 > 0 && at1 > 0;
        below &= at0 < 0 && at1 < 0;
      }
    }
    if (above || below) return true;
  }
  return false;
}

struct Count {
  std::size_t all = 0, kept = 0;
};

/// Every pair that is not streamed must be proved apart, and none may come twice.
Count expectComplete(const Scene& scene, FeatureKind kind_a, std::size_t body_a, FeatureKind kind_b, std::size_t body_b,
                     bool t0_only, const std::string& what) {
  const SceneBody &a = scene.arrays.bodies()[body_a], &b = scene.arrays.bodies()[body_b];
  TreePair trees;
  trees.a = &a.tree(kind_a);
  trees.b = &b.tree(kind_b);
  trees.self = trees.a == trees.b;
  trees.span.times = t0_only ? Times::T0 : Times::BOTH;
  const std::vector<SlotPair> pairs = streamed(trees);
  std::set<SlotPair> unique;
  for (const SlotPair& p : pairs) {
    const bool swap = trees.self && p.first > p.second;
    unique.insert(swap ? SlotPair(p.second, p.first) : p);
  }
  EXPECT_EQ(unique.size(), pairs.size()) << what << ": a pair came twice";
  Count count;
  for (std::uint32_t i = 0; i < trees.a->featureCount(); ++i) {
    for (std::uint32_t j = trees.self ? i + 1 : 0; j < trees.b->featureCount(); ++j) {
      ++count.all;
      const bool wanted = a.holds(kind_a, i) && b.holds(kind_b, j);
      const bool kept = unique.erase({i, j}) > 0;
      count.kept += kept;
      if (!wanted) {
        EXPECT_FALSE(kept) << what << ": a pair with an inactive feature";
      } else if (!kept) {
        EXPECT_TRUE(provedApart(scene.arrays.vertices(), trees.a->feature(i), trees.a->arity(), trees.b->feature(j),
                                trees.b->arity(), t0_only))
            << what << ": lost a pair that is not proved apart";
      }
    }
  }
  EXPECT_TRUE(unique.empty()) << what << ": pairs of slots that do not exist";
  return count;
}

Count expectAllComplete(const Scene& scene, const std::string& what) {
  Count sum;
  const std::size_t n = scene.arrays.bodies().size();
  for (std::size_t a = 0; a < n; ++a) {
    for (std::size_t b = 0; b < n; ++b) {
      const auto add = [&](const Count& c) {
        sum.all += c.all;
        sum.kept += c.kept;
      };
      add(expectComplete(scene, FeatureKind::VERTEX, a, FeatureKind::FACE, b, false, what + " VF"));
      add(expectComplete(scene, FeatureKind::EDGE, a, FeatureKind::FACE, b, true, what + " EF at t0"));
      if (a <= b) add(expectComplete(scene, FeatureKind::EDGE, a, FeatureKind::EDGE, b, false, what + " EE"));
    }
  }
  return sum;
}

TEST(ClusterPairs, NothingThatIsNotApartIsLost) {
  for (int style = 0; style < static_cast<int>(Coordinates::EXTREME); ++style) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
      const Draw draw = drawFrom(1000 + seed);
      const Scene scene(randomStep(draw, draw(1, 60), static_cast<Coordinates>(style)));
      expectAllComplete(scene, "style " + std::to_string(style) + ", seed " + std::to_string(seed));
    }
  }
}

// Deep trees: a wavy cloth of a few thousand features, so that whole branches are left out.
TEST(ClusterPairs, NothingIsLostInDeepTrees) {
  TestStep step;
  for (int b = 0; b < 2; ++b) {
    StepBody body;
    const std::size_t n = b == 0 ? 21 : 9;
    body.topology = Topology::grid(n, n);
    const Draw draw = drawFrom(77 + static_cast<std::uint64_t>(b));
    for (std::size_t i = 0; i < n * n; ++i) {
      const double x = static_cast<double>(i % n), y = static_cast<double>(i / n);
      body.t0.push_back(Vec3(x + draw(-9, 9) / 30.0, y + 3 * b, 2 * std::sin(x) * std::cos(y) + b));
      body.t1.push_back(body.t0.back() + Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9)) / 20.0);
    }
    step.bodies.push_back(body);
  }
  const Scene scene(step);
  const Count count = expectAllComplete(scene, "cloth");
  EXPECT_LT(count.kept * 10, count.all) << "the hierarchy leaves out too little";
  EXPECT_GT(count.kept, 1000u);
}

TEST(ClusterPairs, EveryTargetStreamsTheSameInTheSameOrder) {
  const Draw draw = drawFrom(5);
  const Scene scene(randomStep(draw, 60, Coordinates::REAL));
  const ClusterTree& edges = scene.arrays.bodies()[0].tree(FeatureKind::EDGE);
  TreePair trees;
  trees.a = trees.b = &edges;
  trees.self = true;
  const auto expected = streamed(trees);
  ASSERT_FALSE(expected.empty());
  forEachSimdTarget([&](const std::string& target) { EXPECT_EQ(streamed(trees), expected) << target; });
}

// What is kept of a search that is cut are the first pairs of the whole list, and nothing else touches before the
// bound.
TEST(ClusterPairs, ASearchThatIsCutKeepsTheFirstAndBoundsTheRest) {
  const Scene scene(crumpled(4, 1, 450));
  const ClusterTree& edges = scene.arrays.bodies()[0].tree(FeatureKind::EDGE);
  TreePair trees;
  trees.a = trees.b = &edges;
  trees.self = true;
  ASSERT_GT(edges.height(), 2u);
  std::vector<std::uint32_t> all, scratch;
  const double none_left = superclusterPairs(trees, all, scratch).toc;
  EXPECT_EQ(none_left, std::numeric_limits<double>::infinity());
  const std::size_t count = all.size() / 2;
  ASSERT_GT(count, 200u);
  const auto expectBounded = [&](const std::vector<std::uint32_t>& kept, double bound, const std::string& what) {
    ASSERT_LE(kept.size(), all.size()) << what;
    EXPECT_TRUE(std::equal(kept.begin(), kept.end(), all.begin())) << what;
    EXPECT_EQ(kept.size() == all.size(), bound == none_left) << what;
    for (std::size_t p = kept.size() / 2; p < count; ++p) {
      ASSERT_LE(bound, superclusterTocBound(trees, all[2 * p], all[2 * p + 1])) << what << ", pair " << p;
    }
  };
  std::vector<std::uint32_t> kept;
  std::size_t positive = 0;
  for (const std::size_t most : {std::size_t{0}, std::size_t{1}, std::size_t{17}, count / 2, count - 1, count}) {
    const double bound = superclusterPairs(trees, kept, scratch, most).toc;
    EXPECT_LE(kept.size(), 2 * most);
    expectBounded(kept, bound, "at most " + std::to_string(most));
    positive += most > 0 && !kept.empty();
  }
  EXPECT_EQ(positive, 5u);
  EXPECT_EQ(kept, all);
  // Time that is up ends it as well, at any look at the clock.
  constexpr std::int64_t ENOUGH = 1000000;
  std::atomic<std::int64_t> left{ENOUGH};
  EXPECT_FALSE(superclusterPairs(trees, kept, scratch, count, Deadline::afterLooks(left)).late);
  EXPECT_EQ(kept, all);
  const std::int64_t looks = ENOUGH - left;
  ASSERT_GE(looks, 2) << "the scene is too small for a look between two pieces";
  for (std::int64_t last = 1; last <= looks; ++last) {
    left = last - 1;
    const SearchRest rest = superclusterPairs(trees, kept, scratch, count, Deadline::afterLooks(left));
    EXPECT_TRUE(rest.late);
    EXPECT_EQ(left, -1) << "once it was over it was asked again";
    expectBounded(kept, rest.toc, "cut at look " + std::to_string(last));
  }
}

// superclusterTocBound: never after the first contact of any pair of features in the groups.
TEST(ClusterPairs, BoundsOfGroupsAreNeverLate) {
  std::size_t contacts = 0, positive = 0, shortened_positive = 0;
  for (std::uint64_t seed = 0; seed < 24; ++seed) {
    const Draw draw = drawFrom(9000 + seed);
    TestStep step = randomStep(draw, 8, seed % 4 == 0 ? Coordinates::REAL : Coordinates::SMALL_INTEGERS);
    // Bodies that start apart, so that bounds are not all 0.
    for (std::size_t b = 0; b < step.bodies.size(); ++b) {
      for (Vec3& x : step.bodies[b].t0) x += Vec3(20.0 * static_cast<double>(b), 0, draw(0, 1));
    }
    const Scene scene(step);
    Scene shortened(step);  // whose bounds end before most contacts
    const Span span = shortened.arrays.shorten([](std::size_t n, const auto& f) { f(0, n); }, seed % 2 ? 0.5 : 0.05);
    for (const TrueContact& truth : trueContacts(step)) {
      const bool vf = truth.contact.kind == PairKind::VERTEX_FACE;
      const SceneBody &a = scene.arrays.bodies()[truth.contact.body[0]],
                      &b = scene.arrays.bodies()[truth.contact.body[1]];
      TreePair trees;
      trees.a = &a.tree(vf ? FeatureKind::VERTEX : FeatureKind::EDGE);
      trees.b = &b.tree(vf ? FeatureKind::FACE : FeatureKind::EDGE);
      ASSERT_EQ(trees.a->level(1).groups, 1u) << "small enough for the pair to be in group 0 of level 1";
      ASSERT_EQ(trees.b->level(1).groups, 1u);
      const double bound = superclusterTocBound(trees, 0, 0);
      TreePair until = trees;
      until.a = &shortened.arrays.bodies()[truth.contact.body[0]].tree(vf ? FeatureKind::VERTEX : FeatureKind::EDGE);
      until.b = &shortened.arrays.bodies()[truth.contact.body[1]].tree(vf ? FeatureKind::FACE : FeatureKind::EDGE);
      until.span = span;
      ASSERT_GE(bound, 0);
      ASSERT_LE(bound, 1);
      Root toc = truth.toc;
      EXPECT_GE(tocError(toc, bound), 0) << "seed " << seed << ": bound " << bound;
      const double earlier = superclusterTocBound(until, 0, 0);
      EXPECT_GE(tocError(toc, earlier), 0)
          << "seed " << seed << ": bound " << earlier << " of bounds until " << span.end;
      shortened_positive += earlier > 0;
      ++contacts;
      positive += bound > 0;
    }
  }
  EXPECT_GT(contacts, 200u);
  EXPECT_GT(positive, 20u) << "bounds of 0 show nothing";
  EXPECT_GT(shortened_positive, 20u);
}

// Where faces that are parallel meet, the bound is sharp but for what records are truncated by.
TEST(ClusterPairs, BoundsOfParallelFacesAreSharpAndNeverLate) {
  const Draw draw = drawFrom(77);
  const Topology triangle = Topology::fromTriangles(3, {{0, 1, 2}});
  for (int i = 0; i < 200; ++i) {
    const double above = draw(1, 1000) / 700.0, below = draw(1, 1000) / 900.0;
    TestStep step;
    step.bodies = {
        {triangle, {{0, 0, above}, {1, 0, above}, {0, 1, above}}, {{0, 0, -below}, {1, 0, -below}, {0, 1, -below}}},
        {triangle, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}};
    const Scene scene(step);
    TreePair trees;
    trees.a = &scene.arrays.bodies()[0].tree(FeatureKind::VERTEX);
    trees.b = &scene.arrays.bodies()[1].tree(FeatureKind::FACE);
    const double bound = superclusterTocBound(trees, 0, 0), toc = above / (above + below);
    EXPECT_LE(bound, toc) << above << ", " << below;
    EXPECT_GT(bound, toc - 1e-3) << above << ", " << below;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
