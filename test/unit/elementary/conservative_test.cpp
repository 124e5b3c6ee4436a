// The rung `conservative` on pairs whose distances are known by construction. Hard random pairs: test/property.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>
#include <vector>

#include "dccd/elementary.h"
#include "elementary/conservative_advance.h"
#include "oracle/exact_distance.h"
#include "oracle/promises.h"
#include "support/generators.h"
#include "support/pair_list.h"

namespace dccd {
namespace test {
namespace {

AccuracyOptions optionsOf(double tolerance_m, int max_subdivisions = 4096) {
  AccuracyOptions options;
  options.rung = Accuracy::CONSERVATIVE;
  options.tolerance_m = tolerance_m;
  options.max_subdivisions = max_subdivisions;
  return options;
}

ElementaryResult testApart(const AccuracyOptions& options, PairKind kind, const PairMotion& pair, double separation_m) {
  return testQuery(*makeRung(options), {kind, pair, false}, separation_m);
}

/// A vertex that moves from (x, y, z0) to (x, y, z1) over the unit triangle at rest.
PairMotion dropping(double x, double y, double z0, double z1) {
  return {{{{x, y, z0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{x, y, z1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}};
}

// A pair at rest at exactly the minimum separation is in contact; the next larger distance may be; one beyond the
// tolerance is not.
TEST(Conservative, MinimumSeparationIsClosedAndTheToleranceIsKept) {
  constexpr double D = 0.25, TOLERANCE = 1e-6;
  const auto verdict = [](double z) {
    return testApart(optionsOf(TOLERANCE), PairKind::VERTEX_FACE, dropping(0.25, 0.25, z, z), D).verdict;
  };
  EXPECT_EQ(verdict(D), Verdict::CONTACT);
  EXPECT_EQ(verdict(std::nextafter(D, 0)), Verdict::CONTACT);
  EXPECT_EQ(verdict(0), Verdict::CONTACT);
  EXPECT_EQ(verdict(D + 1.001 * TOLERANCE), Verdict::NO_CONTACT);
  EXPECT_EQ(verdict(-D - 1.001 * TOLERANCE), Verdict::NO_CONTACT);
}

// Advancement by speed alone would take (1 / 2e-6) steps here.
TEST(Conservative, SlidingPastAtTwiceTheToleranceTakesFewSteps) {
  constexpr double GAP = 2e-6;
  PairMotion pair = dropping(-40, 0.25, GAP, GAP);
  pair.x[1][0][0] = 40;
  EXPECT_EQ(testApart(optionsOf(1e-6, 20), PairKind::VERTEX_FACE, pair, 1e-12).verdict, Verdict::NO_CONTACT);
}

// An edge that turns right round while it comes closer: no one direction separates the two for the whole step.
TEST(Conservative, TheCapLeavesASafeBound) {
  const PairMotion pair = {{{{-1, 0, 0}, {1, 0, 0}, {-1, 0.3, 0.5}, {1, -0.2, 0.5}},
                            {{-1, 0, 0}, {1, 0, 0}, {0.3, -0.4, -0.2}, {-1, 0.9, -0.1}}}};
  constexpr double TOLERANCE = 1e-9, D = 1e-3;
  const ElementaryResult full = testApart(optionsOf(TOLERANCE), PairKind::EDGE_EDGE, pair, D);
  ASSERT_EQ(full.verdict, Verdict::CONTACT);
  double last = -1;
  int cap = 1;
  for (;; ++cap) {
    const ElementaryResult result = testApart(optionsOf(TOLERANCE, cap), PairKind::EDGE_EDGE, pair, D);
    if (result.verdict == Verdict::CONTACT) break;
    ASSERT_EQ(result.verdict, Verdict::UNDECIDED) << cap;
    EXPECT_LE(result.toc_lower, full.toc_lower);
    EXPECT_GT(result.toc_lower, last) << "every step allowed must bring the bound on";
    EXPECT_EQ(result.toc_upper, 1);
    last = result.toc_lower;
  }
  EXPECT_GT(cap, 2) << "too easy a pair to judge the cap";
  EXPECT_LT(cap, 30) << "convergence like Newton's takes a few steps";
}

// Beyond what doubles can tell apart at this tolerance: never a guess.
TEST(Conservative, BeyondRoundingItIsUndecidedFromTheStart) {
  const PairMotion far = dropping(0.25e300, 0.25e300, 1e300, -1e300);
  const ElementaryResult result = testApart(optionsOf(1e-6), PairKind::VERTEX_FACE, far, 1e-3);
  EXPECT_EQ(result.verdict, Verdict::UNDECIDED);
  EXPECT_EQ(result.toc_lower, 0);
}

TEST(Conservative, ASeparationOfZeroIsNoSeparation) {
  RandomSource random(3);
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    PairList pairs(kind);
    std::vector<double> separations;
    for (int i = 0; i < 1500; ++i) {
      pairs.add(hardQuery(random, kind, i % 3 == 0 ? Hardness::GRAZING : Hardness::GENERAL).motion);
      separations.push_back(i % 2 == 0 ? 0 : 1e-3);
    }
    const auto test = makeRung(optionsOf(1e-6));
    PairBatch batch = batchOf(pairs);
    std::vector<ElementaryResult> plain(pairs.size()), mixed(pairs.size());
    TierCounters plain_counters, mixed_counters;
    test->run(batch, plain.data(), plain_counters);
    batch.minimum_separation_m = separations.data();
    test->run(batch, mixed.data(), mixed_counters);
    std::size_t contacts = 0;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      contacts += plain[i].verdict == Verdict::CONTACT;
      if (separations[i] == 0) {
        ASSERT_EQ(plain[i].verdict, mixed[i].verdict) << i;
        ASSERT_EQ(plain[i].toc_lower, mixed[i].toc_lower) << i;
        ASSERT_EQ(plain[i].toc_upper, mixed[i].toc_upper) << i;
      } else if (plain[i].verdict == Verdict::CONTACT && mixed[i].verdict != Verdict::UNDECIDED) {
        // Nearer than nothing is nearer than a millimetre, and not later.
        ASSERT_EQ(mixed[i].verdict, Verdict::CONTACT) << i;
        ASSERT_LE(mixed[i].toc_lower, plain[i].toc_upper) << i;
      }
    }
    EXPECT_GT(contacts, 300u);
    EXPECT_GT(plain_counters.settled[static_cast<std::size_t>(Tier::DOUBLE_BATCH)], pairs.size() / 2);
  }
}

TEST(Conservative, ClosingSpeedBoundsEveryChangeOfDistance) {
  RandomSource random(11);
  std::uniform_real_distribution<double> time(0, 1);
  for (int i = 0; i < 500; ++i) {
    const Query query = hardQuery(random, i % 2 ? PairKind::EDGE_EDGE : PairKind::VERTEX_FACE, Hardness::GENERAL);
    PairList pair(query.kind);
    pair.add(query.motion);
    const std::vector<VertexMotion>& v = pair.vertices;
    const double speed = conservative::closingSpeed(query.kind, {&v[0], &v[1], &v[2], &v[3]});
    const double a = time(random), b = time(random);
    const double change = std::fabs(approximateDistanceAt(query.kind, query.motion, a) -
                                    approximateDistanceAt(query.kind, query.motion, b));
    ASSERT_LE(change, speed * std::fabs(a - b) * (1 + 1e-9) + 1e-9) << i;
  }
}

TEST(Conservative, RefusesKindsThatItCannotTest) {
  const auto test = makeRung(optionsOf(1e-6));
  EXPECT_THROW(testPair(*test, PairKind::VERTEX_VOXEL_FACE, dropping(0, 0, 1, 2)), std::invalid_argument);
}

}  // namespace
}  // namespace test
}  // namespace dccd
