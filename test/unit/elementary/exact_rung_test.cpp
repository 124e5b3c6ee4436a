// The factory of the rungs, and what the exact one promises of a deadline.
#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/elementary.h"
#include "oracle/promises.h"
#include "support/pair_list.h"
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
  test::PairList pairs;
  for (std::size_t i = 0; i < PAIRS; ++i) {
    // Everything falls into one point at the end of the step, and every third pair stays far apart.
    PairMotion pair;
    for (int v = 0; v < 4; ++v) {
      const double x = 0.1 * v, y = v == 2 ? 0.3 : 0.07 * static_cast<double>(i % 7), z = v == 0 ? 0.2 : 1e-9 * v;
      const double apart = i % 3 == 0 && v == 0 ? 10 : 0;
      std::copy_n(Vec3(x, y, z + apart).data(), 3, pair.x[0][v]);
      std::copy_n(Vec3(0.1, 0.2, 0.3 + apart).data(), 3, pair.x[1][v]);
    }
    pairs.add(pair);
  }
  PairBatch batch = batchOf(pairs);
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
  const std::string text = test::said<std::invalid_argument>([] { test::testQuery(*makeRung({}), {}, 0.001); });
  EXPECT_NE(text.find("conservative"), std::string::npos);
}

}  // namespace
}  // namespace dccd
