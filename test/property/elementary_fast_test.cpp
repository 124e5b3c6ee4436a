// The fast rung promises no more than finite times within the step; and that it answers at all on hard pairs.
#include <gtest/gtest.h>

#include <iostream>

#include "dccd/elementary.h"
#include "oracle/promises.h"
#include "support/generators.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

AccuracyOptions fastOptions() {
  AccuracyOptions options;
  options.rung = Accuracy::FAST;
  return options;
}

TEST(ElementaryFast, TimesAreFiniteAndWithinTheStep) {
  const auto test = makeRung(fastOptions());
  checkHardQueries("fast-range", longRun() ? 1000000 : 20000, [&](const Query& query) -> std::string {
    std::optional<Root> unused;
    return brokenPromise(fastOptions(), query, unused, testQuery(*test, query));
  });
}

// Useful all the same: on pairs of ordinary size it is nearly always right.
TEST(ElementaryFast, NearlyAlwaysRightOnOrdinaryPairs) {
  const auto test = makeRung(fastOptions());
  RandomSource random(5);
  const int pairs = longRun() ? 100000 : 4000;
  int wrong = 0;
  for (int i = 0; i < pairs; ++i) {
    const Query query = hardQuery(random, i % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE, Hardness::GENERAL);
    const bool contact = testQuery(*test, query).verdict == Verdict::CONTACT;
    wrong += contact != firstContact(query.kind, query.motion).has_value();
  }
  std::cout << "fast: " << wrong << " of " << pairs << " ordinary pairs wrong\n";
  EXPECT_LE(wrong, pairs / 1000);
}

}  // namespace
}  // namespace test
}  // namespace dccd
