// Inputs that lie at the bounds of the margins of tolerances.h: contacts that a smaller margin loses, and pairs apart
// that it invents. `scripts/test --long` cuts one margin after the other to a tenth and shows that inputs of these
// tests go wrong then (test/package/margins_test.py); the table is in doc/hard_cases.md.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <memory>
#include <random>

#include "dccd/elementary.h"
#include "elementary/exact_tiers.h"
#include "oracle/exact_distance.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "simd/float_mode.h"
#include "support/exact_tier.h"
#include "support/generators.h"
#include "support/margin_checks.h"
#include "support/margin_witnesses.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

double uniform(RandomSource& random) { return 2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1; }

/// Moves the first vertex, or the second edge, until the features are about `distance` apart, inside of both: far less
/// than their extent, of which the errors are made.
void bringTogether(double distance, RandomSource& random, Query& query) {
  auto& x = query.motion.x[0];
  const bool vertex_face = query.kind == PairKind::VERTEX_FACE;
  double u[3], v[3], n[3], length = 0;
  for (int k = 0; k < 3; ++k) {
    u[k] = x[vertex_face ? 2 : 1][k] - x[vertex_face ? 1 : 0][k];
    v[k] = x[3][k] - x[vertex_face ? 1 : 2][k];
  }
  for (int k = 0; k < 3; ++k) {
    n[k] = u[(k + 1) % 3] * v[(k + 2) % 3] - u[(k + 2) % 3] * v[(k + 1) % 3];
    length += n[k] * n[k];
  }
  const double s = 0.5 * std::fabs(uniform(random)), t = 0.5 * std::fabs(uniform(random));
  for (int k = 0; k < 3; ++k) {
    const double above = distance * n[k] / std::sqrt(length);
    if (vertex_face) {
      x[0][k] = x[1][k] + s * u[k] + t * v[k] + above;
    } else {
      const double shift = (x[0][k] + s * u[k]) - (x[2][k] + t * v[k]) + above;
      x[2][k] += shift;
      x[3][k] += shift;
    }
  }
}

/// A pair of extent about 1 that rests, translates or deforms; edges and faces of all shapes, from slivers to long
/// ones.
Query plainPair(RandomSource& random) {
  Query query;
  query.kind = random() % 2 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
  const auto motion = random() % 3;
  const double thin = std::ldexp(1.0, -static_cast<int>(random() % 12));
  double shift[3];
  for (double& x : shift) x = uniform(random);
  for (auto& point : query.motion.x[0]) {
    for (int k = 0; k < 3; ++k) point[k] = uniform(random) * (k == 0 ? 1 : thin);
  }
  if (random() % 2) bringTogether(std::ldexp(1.0, -static_cast<int>(random() % 30)), random, query);
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 3; ++k) {
      const double x = query.motion.x[0][i][k];
      const int first = query.kind == PairKind::VERTEX_FACE ? 1 : 2;
      query.motion.x[1][i][k] = motion == 0 ? x : motion == 1 ? x + (i < first ? shift[k] : 0) : uniform(random);
    }
  }
  return query;
}

/// About the least d that the features are within at t, the exact distance judging; near `guess`.
double leastWithin(const Query& query, double t, double guess) {
  double low = std::max(0.0, guess - 0x1p-48), high = guess + 0x1p-48;
  for (int i = 0; i < 12; ++i) {
    const double middle = 0.5 * (low + high);
    (isWithin(query.kind, query.motion, t, middle) ? high : low) = middle;
  }
  return high;
}

// d is the distance at some time to the last bit: one step further, and the features come within it or they do not.
TEST(Margins, DistancesAreHeldToTheLastBit) {
  AccuracyOptions options;
  options.rung = Accuracy::CONSERVATIVE;
  RandomSource random(propertySeed());
  const int pairs = longRun() ? 300000 : 10000;
  int within = 0;
  for (int n = 0; n < pairs; ++n) {
    const Query query = plainPair(random);
    const double t = std::array<double, 3>{0, 0.5, 1}[random() % 3];
    double d = approximateDistanceAt(query.kind, query.motion, t);
    if (!(d > 1e-9)) continue;
    options.tolerance_m = d * std::ldexp(1.0, -static_cast<int>(random() % 40) - 8);
    d = leastWithin(query, t, d);
    if (random() % 2) d = std::nextafter(d, random() % 2 ? HUGE_VAL : 0);
    const ElementaryResult result = testQuery(*makeRung(options), query, d);
    const std::string where = "pair " + std::to_string(n) + ", replay: run_queries ";
    if (isWithin(query.kind, query.motion, t, d)) {
      ++within;
      ASSERT_NE(result.verdict, Verdict::NO_CONTACT) << where << writeReplayFile("margins-distance", query);
      ASSERT_LE(result.toc_lower, t) << where << writeReplayFile("margins-distance", query);
    }
    const std::string broken = brokenSeparationPromise(options, query, d, result);
    ASSERT_EQ(broken, "") << where << writeReplayFile("margins-distance", query);
  }
  EXPECT_GT(within, pairs / 10);
}

// The tolerance is the distance to the last bit: what is called near must be near, for slivers, too.
TEST(Margins, NearIsNearToTheLastBit) {
  AccuracyOptions options;
  options.rung = Accuracy::CONSERVATIVE;
  RandomSource random(propertySeed() + 1);
  const int pairs = longRun() ? 300000 : 20000;
  int contacts = 0;
  for (int n = 0; n < pairs; ++n) {
    const Query query = plainPair(random);
    const double distance = approximateDistanceAt(query.kind, query.motion, 0);
    if (!(distance > 1e-12)) continue;
    // At most d + tolerance, in units of the last place of the extent, of which the margin is made.
    const double d = distance * 0.5;
    options.tolerance_m = (distance - d) + static_cast<double>(random() % 400) * 0x1p-54;
    const ElementaryResult result = testQuery(*makeRung(options), query, d);
    contacts += result.verdict == Verdict::CONTACT;
    ASSERT_EQ(brokenSeparationPromise(options, query, d, result), "") << "pair " << n;
  }
  EXPECT_GT(contacts, pairs / 100);
}

/// A pair that meets on a border of a feature at some time, or nearly, with f nearly 0 all the while: few bits decide.
Query borderPair(RandomSource& random) {
  const PairKind kind = random() % 2 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
  static constexpr Hardness HARD[] = {Hardness::GRAZING, Hardness::SLIVER, Hardness::TURNING, Hardness::PARALLEL,
                                      Hardness::AT_THE_ENDS};
  Query query = hardQuery(random, kind, HARD[random() % 5]);
  // Approach slowly: the motion is made smaller, so that roots are known less well.
  const int slower = static_cast<int>(random() % 50);
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 3; ++k) {
      double& end = query.motion.x[1][i][k];
      const double start = query.motion.x[0][i][k];
      if (random() % 4) end = start + std::ldexp(end - start, -slower);
    }
  }
  return query;
}

using Decide = std::function<ElementaryResult(PairKind, const PairMotion&, int)>;

void hold(const Decide& decide, int pairs, const std::function<Query(RandomSource&)>& next) {
  RandomSource random(propertySeed() + 2);
  AccuracyOptions options;
  int settled = 0;
  for (int n = 0; n < pairs; ++n) {
    const Query query = next(random);
    const ElementaryResult result = decide(query.kind, query.motion, options.toc_bits);
    if (result.verdict == Verdict::UNDECIDED) continue;
    ++settled;
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    ASSERT_EQ(brokenPromise(options, query, toc, result), "")
        << "pair " << n << ", replay: run_queries " << writeReplayFile("margins-tier", query);
  }
  EXPECT_GT(settled, pairs / 100);
}

void holdTier(Tier tier, int pairs, const std::function<Query(RandomSource&)>& next) {
  hold([tier](PairKind kind, const PairMotion& pair, int bits) { return decideWithTier(tier, kind, pair, bits); },
       pairs, next);
}

TEST(Margins, BatchAnswersAtItsBounds) { holdTier(Tier::DOUBLE_BATCH, longRun() ? 1000000 : 60000, borderPair); }
TEST(Margins, SubdivisionAnswersAtItsBounds) { holdTier(Tier::BERNSTEIN, longRun() ? 1000000 : 60000, borderPair); }
TEST(Margins, DoubleDoubleAnswersAtItsBounds) {
  holdTier(Tier::DOUBLE_DOUBLE, longRun() ? 1000000 : 60000, borderPair);
}

/// Nearly coplanar the whole time: four points of one plane, each moved by a few units in the last place.
Query nearlyCoplanar(RandomSource& random) {
  Query query;
  query.kind = random() % 2 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
  double along[2][3];
  for (auto& direction : along) {
    for (double& x : direction) x = uniform(random);
  }
  for (auto& points : query.motion.x) {
    for (auto& point : points) {
      const double s = uniform(random), t = uniform(random);
      for (int k = 0; k < 3; ++k) {
        point[k] =
            (s * along[0][k] + t * along[1][k]) + 0x1p-53 * static_cast<double>(static_cast<int>(random() % 33) - 16);
      }
    }
  }
  return query;
}

TEST(Margins, BatchAnswersNearlyCoplanarPairs) {
  holdTier(Tier::DOUBLE_BATCH, longRun() ? 1000000 : 60000, nearlyCoplanar);
}

/// In a plane across an axis, on a coarse grid that a step moves or mixes, some coordinates an ulp off: vertices come
/// to edges at their ends, at the ends of the step, and edges to lie on one line.
Query pairInPlane(RandomSource& random) {
  Query query;
  query.kind = random() % 2 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE;
  const auto across = random() % 3;
  const bool moves = random() % 2, on_grid = random() % 4 != 0;
  const int first = query.kind == PairKind::VERTEX_FACE ? 1 : 2;
  for (std::size_t k = 0; k < 3; ++k) {
    const double shift = (static_cast<double>(random() % 5) - 2) / 59;
    for (int i = 0; i < 4; ++i) {
      double place[2];
      for (double& x : place) x = on_grid ? static_cast<double>(random() % 9) / 59 : uniform(random);
      if (moves) place[1] = place[0] + (i < first ? shift : 0);
      for (int time = 0; time < 2; ++time) {
        if (random() % 8 == 0) place[time] = std::nextafter(place[time], uniform(random));
        query.motion.x[time][i][k] = k == across ? 0.1 * time : place[time];
      }
    }
  }
  return query;
}

TEST(Margins, PlanesAreAnsweredAtTheirBounds) { hold(exact::decideInPlane, longRun() ? 500000 : 10000, pairInPlane); }

/// Each margin's own inputs, those that search found included: none goes wrong.
class MarginChecks : public testing::TestWithParam<MarginCheck> {};

TEST_P(MarginChecks, NoInputGoesWrong) {
  const ScopedFloatMode mode;
  const MarginCheck& check = GetParam();
  RandomSource random(propertySeed());
  std::vector<MarginInput> inputs = marginWitnesses(check.margin);
  const int made = check.inputs * (longRun() ? 20 : 1);
  for (int i = 0; i < made; ++i) inputs.push_back(check.make(random));
  for (const MarginInput& input : inputs) ASSERT_FALSE(check.judge(input)()) << witnessLine(check.margin, input);
}

INSTANTIATE_TEST_SUITE_P(Margin, MarginChecks, testing::ValuesIn(marginChecks()),
                         [](const testing::TestParamInfo<MarginCheck>& info) { return info.param.margin; });

}  // namespace
}  // namespace test
}  // namespace dccd
