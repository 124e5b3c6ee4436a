// The factory, and the exact rung as a whole on pairs whose answer is known by hand.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/elementary.h"
#include "support/generators.h"
#include "support/said.h"

namespace dccd {
namespace {

std::string refusal(const AccuracyOptions& options) {
  return test::said<std::invalid_argument>([&] { makeRung(options); });
}

TEST(ExactRung, FactoryRefusesOptionsOutOfRangeByNameAndValue) {
  AccuracyOptions options;
  for (const int bits : {-1, 9, 53}) {
    options.toc_bits = bits;
    EXPECT_NE(refusal(options).find("toc_bits"), std::string::npos);
    EXPECT_NE(refusal(options).find(std::to_string(bits)), std::string::npos);
  }
  options = AccuracyOptions();
  for (const double tolerance : {0.0, -1.0, std::numeric_limits<double>::infinity(), std::nan("")}) {
    options.tolerance_m = tolerance;
    EXPECT_NE(refusal(options).find("tolerance_m"), std::string::npos) << tolerance;
  }
  options = AccuracyOptions();
  options.max_subdivisions = 0;
  EXPECT_NE(refusal(options).find("max_subdivisions"), std::string::npos);
  options = AccuracyOptions();
  for (const int none : {0, 1, 4}) {
    options.rung = static_cast<Accuracy>(none);
    EXPECT_NE(refusal(options).find("rung " + std::to_string(none)), std::string::npos);
  }
  for (const int bits : {10, 32, 52}) {
    options = AccuracyOptions();
    options.toc_bits = bits;
    EXPECT_EQ(refusal(options), "");
  }
}

TEST(ExactRung, NamesThereAndBack) {
  for (const Accuracy rung : {Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    EXPECT_EQ(accuracyFromString(toString(rung)), rung);
  }
  EXPECT_THROW(accuracyFromString("EXACT"), std::invalid_argument);
  EXPECT_THROW(accuracyFromString("fast"), std::invalid_argument);
  EXPECT_THROW(accuracyFromString(""), std::invalid_argument);
}

// Between two pairs that are slow to decide lies a look at the clock: with none left, none of them is begun, and what
// the batch knows stands.
TEST(ExactRung, PastTheDeadlineNoSlowTierIsBegun) {
  constexpr std::size_t PAIRS = 600;
  std::vector<VertexMotion> vertices;
  std::vector<Quad> pairs;
  for (std::size_t i = 0; i < PAIRS; ++i) {
    // Everything falls into one point at the end of the step, and every third pair stays far apart.
    for (int v = 0; v < 4; ++v) {
      const double x = 0.1 * v, y = v == 2 ? 0.3 : 0.07 * static_cast<double>(i % 7), z = v == 0 ? 0.2 : 1e-9 * v;
      const double apart = i % 3 == 0 && v == 0 ? 10 : 0;
      vertices.push_back({{x, y, z + apart, 0}, {0.1, 0.2, 0.3 + apart, 0}});
    }
    const auto first = static_cast<Index>(4 * i);
    pairs.push_back({first, first + 1, first + 2, first + 3});
  }
  PairBatch batch;
  batch.vertices = vertices.data();
  batch.pairs = pairs.data();
  batch.count = PAIRS;
  const auto rung = makeRung(AccuracyOptions());
  const auto run = [&](TierCounters& tiers) {
    std::vector<ElementaryResult> results(PAIRS);
    rung->run(batch, results.data(), tiers);
    return results;
  };
  TierCounters all, none;
  const std::vector<ElementaryResult> full = run(all);
  const Deadline over(Deadline::Clock::now());
  batch.deadline = &over;
  const std::vector<ElementaryResult> cut = run(none);
  EXPECT_GT(PAIRS - all.settled[static_cast<std::size_t>(Tier::DOUBLE_BATCH)], PAIRS / 2);
  EXPECT_EQ(none.settled[static_cast<std::size_t>(Tier::DOUBLE_BATCH)], PAIRS);
  for (std::size_t i = 0; i < PAIRS; ++i) {
    if (full[i].tier == Tier::DOUBLE_BATCH && cut[i].verdict == full[i].verdict) continue;
    EXPECT_EQ(cut[i].verdict, Verdict::UNDECIDED);
    EXPECT_EQ(cut[i].toc_lower, 0);
    EXPECT_EQ(cut[i].toc_upper, 1);
  }
  const Deadline later(over.at() + std::chrono::hours(1));
  batch.deadline = &later;
  TierCounters again;
  run(again);
  EXPECT_EQ(again.settled, all.settled);
}

TEST(ExactRung, RefusesAMinimumSeparationAndNamesTheRungThatHasIt) {
  const VertexMotion vertices[4] = {};
  const Quad quad = {0, 1, 2, 3};
  const double separation = 0.001;
  PairBatch batch;
  batch.vertices = vertices;
  batch.pairs = &quad;
  batch.count = 1;
  batch.minimum_separation_m = &separation;
  ElementaryResult result;
  TierCounters counters;
  const std::string text = test::said<std::invalid_argument>([&] { makeRung({})->run(batch, &result, counters); });
  EXPECT_NE(text.find("conservative"), std::string::npos);
}

TEST(ExactRung, ManyPairsAtOnceAreTheSameAsOneByOne) {
  test::RandomSource random(41);
  const auto test = makeRung({});
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    std::vector<VertexMotion> vertices;
    std::vector<Quad> pairs;
    std::vector<ElementaryResult> expected;
    for (Index i = 0; i < 1500; ++i) {
      const Query query = test::hardQuery(random, kind, static_cast<test::Hardness>(i % 13));
      for (int p = 0; p < 4; ++p) {
        VertexMotion vertex{};
        std::memcpy(vertex.t0, query.motion.x[0][p], sizeof query.motion.x[0][p]);
        std::memcpy(vertex.t1, query.motion.x[1][p], sizeof query.motion.x[1][p]);
        vertices.push_back(vertex);
      }
      pairs.push_back({4 * i, 4 * i + 1, 4 * i + 2, 4 * i + 3});
      expected.push_back(testPair(*test, kind, query.motion));
    }
    PairBatch batch;
    batch.kind = kind;
    batch.vertices = vertices.data();
    batch.pairs = pairs.data();
    TierCounters counters;
    std::vector<ElementaryResult> results(pairs.size());
    test->run(batch, results.data(), counters);  // count 0
    batch.count = pairs.size();
    test->run(batch, results.data(), counters);
    std::uint64_t settled = 0;
    for (const std::uint64_t count : counters.settled) settled += count;
    EXPECT_EQ(settled, pairs.size());
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      ASSERT_EQ(results[i].verdict, expected[i].verdict) << i;
      ASSERT_EQ(results[i].toc_lower, expected[i].toc_lower) << i;
      ASSERT_EQ(results[i].toc_upper, expected[i].toc_upper) << i;
    }
  }
}

struct KnownCase {
  const char* name;
  PairKind kind;
  PairMotion motion;
  bool contact;
  double toc_lower, toc_upper;  // of a contact, toc_bits = 32
};

constexpr double CELL = 0x1p-32;

std::vector<KnownCase> knownCases() {
  const auto VF = PairKind::VERTEX_FACE;
  const auto EE = PairKind::EDGE_EDGE;
  const double third = std::floor(0x1p32 / 3) * CELL;
  return {
      {"vertex arrives exactly at t=1",
       VF,
       {{{{0.2, 0.2, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0.2, 0.2, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
       true,
       1,
       1},
      {"vertex leaves at t=0",
       VF,
       {{{{0.2, 0.2, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0.2, 0.2, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
       true,
       0,
       CELL},
      {"through the middle at 1/3",
       VF,
       {{{{0.2, 0.2, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0.2, 0.2, -2}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
       true,
       third,
       third + CELL},
      {"onto a corner at 1/2",
       VF,
       {{{{1, 0, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{1, 0, -1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
       true,
       0.5,
       0.5 + CELL},
      {"one ulp beside the corner",
       VF,
       {{{{1 + 0x1p-52, 0, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}},
         {{1 + 0x1p-52, 0, -1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
       false,
       0,
       0},
      {"in the face's plane, onto an edge at 1/2",
       VF,
       {{{{-1, 0.5, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{1, 0.5, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
       true,
       0.5,
       0.5 + CELL},
      {"in the face's plane, passing by",
       VF,
       {{{{-1, 3, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{1, 3, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}}}},
       false,
       0,
       0},
      {"face shrunk to a segment, met at its end at 1/2",
       VF,
       {{{{2, 0, 1}, {0, 0, 0}, {1, 0, 0}, {2, 0, 0}}, {{2, 0, -1}, {0, 0, 0}, {1, 0, 0}, {2, 0, 0}}}},
       true,
       0.5,
       0.5 + CELL},
      {"all four in one place at rest", VF, {}, true, 0, CELL},
      {"face that is a point, met at 1/4",
       VF,
       {{{{1, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}, {{-3, 0, 0}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}}}},
       true,
       0.25,
       0.25 + CELL},
      {"crossing edges at 1/2",
       EE,
       {{{{-1, 0, 1}, {1, 0, 1}, {0, -1, 0}, {0, 1, 0}}, {{-1, 0, -1}, {1, 0, -1}, {0, -1, 0}, {0, 1, 0}}}},
       true,
       0.5,
       0.5 + CELL},
      {"parallel edges meet along half their length at 1/2",
       EE,
       {{{{0, 0, 1}, {2, 0, 1}, {1, 0, 0}, {3, 0, 0}}, {{0, 0, -1}, {2, 0, -1}, {1, 0, 0}, {3, 0, 0}}}},
       true,
       0.5,
       0.5 + CELL},
      {"collinear edges slide end to end at 1/4",
       EE,
       {{{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {3, 0, 0}}, {{4, 0, 0}, {5, 0, 0}, {2, 0, 0}, {3, 0, 0}}}},
       true,
       0.25,
       0.25 + CELL},
      {"parallel edges pass beside each other",
       EE,
       {{{{0, 0, 1}, {1, 0, 1}, {2, 0, 0}, {3, 0, 0}}, {{0, 0, -1}, {1, 0, -1}, {2, 0, 0}, {3, 0, 0}}}},
       false,
       0,
       0},
      {"zero-length edge through the other's end at 1/2",
       EE,
       {{{{1, 0, 1}, {1, 0, 1}, {0, 0, 0}, {1, 0, 0}}, {{1, 0, -1}, {1, 0, -1}, {0, 0, 0}, {1, 0, 0}}}},
       true,
       0.5,
       0.5 + CELL},
      {"coplanar crossing at t=0 already",
       EE,
       {{{{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}}, {{-1, 0, 0}, {1, 0, 0}, {0, -1, 0}, {0, 1, 0}}}},
       true,
       0,
       CELL},
      {"at rest and apart",
       EE,
       {{{{-1, 0, 1}, {1, 0, 1}, {0, -1, 0}, {0, 1, 0}}, {{-1, 0, 1}, {1, 0, 1}, {0, -1, 0}, {0, 1, 0}}}},
       false,
       0,
       0},
      // The face's plane is z = x (1-2t) / 2, the vertex is at x = 1-2t, so that f is (1-2t)^2 times a constant.
      {"double root at 1/2, inside the face",
       VF,
       {{{{1, 0, 0}, {1, -1, 0.5}, {1, 1, 0.5}, {-1, 0, -0.5}},
         {{-1, 0, 0}, {1, -1, -0.5}, {1, 1, -0.5}, {-1, 0, 0.5}}}},
       true,
       0.5,
       0.5 + CELL},
      {"double root at 1/2, beside the face",
       VF,
       {{{{1, 5, 0}, {1, -1, 0.5}, {1, 1, 0.5}, {-1, 0, -0.5}},
         {{-1, 5, 0}, {1, -1, -0.5}, {1, 1, -0.5}, {-1, 0, 0.5}}}},
       false,
       0,
       0},
      // z = (-3+4t) / 2 + x (1/2+2t) / 2 is the face's plane or the first edge's line, x = 3-4t the vertex or second
      // edge: f is (3-4t)(t-1/4) times a constant, and x = 2 at t = 1/4 lies beside the other feature.
      {"the first root is no contact, the second is (face)",
       VF,
       {{{{3, 0, 0}, {1, -1, -1.25}, {1, 1, -1.25}, {-1, 0, -1.75}},
         {{-1, 0, 0}, {1, -1, 1.75}, {1, 1, 1.75}, {-1, 0, -0.75}}}},
       true,
       0.75,
       0.75 + CELL},
      {"the first root is no contact, the second is (edge)",
       EE,
       {{{{1, 0, -1.25}, {-1, 0, -1.75}, {3, -1, 0}, {3, 1, 0}},
         {{1, 0, 1.75}, {-1, 0, -0.75}, {-1, -1, 0}, {-1, 1, 0}}}},
       true,
       0.75,
       0.75 + CELL},
  };
}

TEST(ExactRung, CasesKnownByHand) {
  const auto test = makeRung({});
  for (const KnownCase& known : knownCases()) {
    const ElementaryResult result = testPair(*test, known.kind, known.motion);
    ASSERT_EQ(result.verdict, known.contact ? Verdict::CONTACT : Verdict::NO_CONTACT) << known.name;
    if (!known.contact) continue;
    EXPECT_EQ(result.toc_lower, known.toc_lower) << known.name;
    EXPECT_EQ(result.toc_upper, known.toc_upper) << known.name;
  }
}

}  // namespace
}  // namespace dccd
