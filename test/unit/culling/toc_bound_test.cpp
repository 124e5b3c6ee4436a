// The linear filter's bound on the time of contact: never late, and not 0 without need.
#include "culling/toc_bound.h"

#include <gtest/gtest.h>

#include <cmath>

#include "oracle/oracle.h"
#include "support/generators.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

PairMotion above(double h0, double h1) {
  PairMotion pair = {{{{1, 1, h0}, {0, 0, 0}, {4, 0, 0}, {0, 4, 0}}, {{1, 1, h1}, {0, 0, 0}, {4, 0, 0}, {0, 4, 0}}}};
  return pair;
}

double boundOf(PairKind kind, const PairMotion& pair, double minimum_separation_m) {
  VertexMotion vertices[4] = {};
  for (int k = 0; k < 4; ++k) {
    std::copy_n(pair.x[0][3 - k], 3, vertices[k].t0);
    std::copy_n(pair.x[1][3 - k], 3, vertices[k].t1);
  }
  return linearTocBound(kind, vertices, {3, 2, 1, 0}, minimum_separation_m);
}

TEST(TocBound, SimpleCases) {
  EXPECT_NEAR(boundOf(PairKind::VERTEX_FACE, above(1, -1), 0), 0.5, 1e-14);
  EXPECT_LE(boundOf(PairKind::VERTEX_FACE, above(1, -1), 0), 0.5);
  EXPECT_NEAR(boundOf(PairKind::VERTEX_FACE, above(1, 0), 0), 1, 1e-14);
  EXPECT_LE(boundOf(PairKind::VERTEX_FACE, above(1, 0), 0), 1);
  EXPECT_EQ(boundOf(PairKind::VERTEX_FACE, above(1, 0.5), 0), 2) << "never";
  EXPECT_EQ(boundOf(PairKind::VERTEX_FACE, above(0, 1), 0), 0);
  EXPECT_NEAR(boundOf(PairKind::VERTEX_FACE, above(1, -1), 0.5), 0.25, 1e-14);
  EXPECT_LE(boundOf(PairKind::VERTEX_FACE, above(1, -1), 0.5), 0.25);
  EXPECT_EQ(boundOf(PairKind::VERTEX_FACE, above(1, 0.25), 0.125), 2) << "never that close";
}

TEST(TocBound, NeverAfterTheTrueTime) {
  RandomSource random(7);
  std::size_t contacts = 0, positive = 0;
  for (int i = 0; i < 6000; ++i) {
    const PairKind kind = i % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE;
    const Hardness hardness = static_cast<Hardness>(i / 2 % (static_cast<int>(Hardness::COUNT) - 2));
    const Query query = hardQuery(random, kind, hardness);
    const double bound = boundOf(kind, query.motion, 0);
    ASSERT_TRUE(bound == 2 || (bound >= 0 && bound <= 1)) << bound;
    if (bound == 0) continue;
    auto toc = firstContact(kind, query.motion);
    if (!toc) continue;
    ++contacts;
    positive += bound > 0;
    EXPECT_GE(tocError(*toc, bound), 0) << toString(hardness) << ' ' << toString(kind) << ": bound " << bound;
  }
  EXPECT_GT(positive, 100u) << contacts << " contacts";
}

// 0 exactly where all eight projections overlap at t=0, up to what rounding leaves: few-bit coordinates are exact.
TEST(TocBound, ZeroOnlyWhereAllProjectionsOverlap) {
  const Draw draw = drawFrom(11);
  static const int FIRST[8] = {0, 1, 2, 0, 0, 1, 0, 1}, SECOND[8] = {-1, -1, -1, 1, 2, 2, 1, 2};
  std::size_t zero = 0, positive = 0;
  for (int i = 0; i < 20000; ++i) {
    const PairKind kind = i % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE;
    PairMotion pair;
    for (auto& points : pair.x) {
      for (auto& point : points) {
        for (double& x : point) x = draw(-20, 20);
      }
    }
    bool apart = false;
    const int first = kind == PairKind::VERTEX_FACE ? 1 : 2;
    for (int d = 0; d < 8; ++d) {
      double lo[2] = {HUGE_VAL, HUGE_VAL}, hi[2] = {-HUGE_VAL, -HUGE_VAL};
      for (int p = 0; p < 4; ++p) {
        const double* x = pair.x[0][p];
        const double value = x[FIRST[d]] + (SECOND[d] < 0 ? 0 : d < 6 ? x[SECOND[d]] : -x[SECOND[d]]);
        lo[p >= first] = std::min(lo[p >= first], value);
        hi[p >= first] = std::max(hi[p >= first], value);
      }
      apart |= lo[0] > hi[1] || lo[1] > hi[0];
    }
    const double bound = boundOf(kind, pair, 0);
    ASSERT_EQ(bound > 0, apart) << i;
    (apart ? positive : zero) += 1;
  }
  EXPECT_GT(zero, 1000u);
  EXPECT_GT(positive, 1000u);
}

TEST(TocBound, OverflowIsNoEvidence) {
  const double big = 1.7e308;
  const PairMotion pair = {{{{big, big, 0}, {-big, -big, 0}, {-big, big, 0}, {big, -big, 0}},
                            {{-big, -big, 0}, {big, big, 0}, {big, -big, 0}, {-big, big, 0}}}};
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const double bound = boundOf(kind, pair, 0);
    EXPECT_TRUE(bound >= 0 && bound <= 2);
    auto toc = firstContact(kind, pair);
    ASSERT_TRUE(toc);
    EXPECT_GE(tocError(*toc, bound), 0) << bound;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
