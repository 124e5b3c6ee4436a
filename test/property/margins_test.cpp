// Inputs that lie at the bounds of the margins of tolerances.h: contacts that a smaller margin loses, and pairs apart
// that it invents. `scripts/test --long` cuts one margin after the other to a tenth and shows that inputs of these
// tests go wrong then (test/package/margins_test.py); doc/hard_cases.md has what comes of it.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "dccd/elementary.h"
#include "elementary/exact_tiers.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "simd/float_mode.h"
#include "support/generators.h"
#include "support/margin_checks.h"
#include "support/margin_witnesses.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

double uniform(RandomSource& random) { return 2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1; }

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

TEST(Margins, PlanesAreAnsweredAtTheirBounds) {
  const int pairs = longRun() ? 500000 : 10000;
  RandomSource random(propertySeed());
  AccuracyOptions options;
  int settled = 0;
  for (int n = 0; n < pairs; ++n) {
    const Query query = pairInPlane(random);
    const ElementaryResult result = exact::decideInPlane(query.kind, query.motion, options.toc_bits);
    if (result.verdict == Verdict::UNDECIDED) continue;
    ++settled;
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    ASSERT_EQ(brokenPromise(options, query, toc, result), "")
        << "pair " << n << ", replay: run_queries " << writeReplayFile("margins-plane", query);
  }
  EXPECT_GT(settled, pairs / 100);
}

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
