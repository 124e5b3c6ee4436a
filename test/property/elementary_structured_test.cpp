// The exact rung on ordinary input that is degenerate everywhere (meshes on grids, at rest, in one plane, meeting at
// round times), and on the same input with its last bits changed: the oracle's answers, from tiers that do not cost a
// hundred times more.
#include <gtest/gtest.h>

#include "elementary/exact_tiers.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "support/exact_tier.h"
#include "support/query_property.h"
#include "support/structured_pairs.h"

namespace dccd {
namespace test {
namespace {

std::string described(const ElementaryResult& result) {
  char text[120];
  std::snprintf(text, sizeof text, "verdict %d [%.17g, %.17g] tier %s", static_cast<int>(result.verdict),
                result.toc_lower, result.toc_upper, toString(result.tier));
  return text;
}

void holdAgainstOracle(const StructuredPairs& set, const std::string& which, std::size_t stride) {
  AccuracyOptions options;
  const auto exact = makeRung(options);
  for (std::size_t i = 0; i < set.pairs.size(); i += stride) {
    Query query;
    query.kind = set.kind;
    query.motion = motionOf(set, i);
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    const ElementaryResult result = testQuery(*exact, query);
    const std::string broken = brokenPromise(options, query, toc, result);
    ASSERT_EQ(broken, "") << set.family << which << ", " << toString(set.kind) << ", pair " << i << ": "
                          << described(result);
  }
}

TEST(ElementaryStructured, VerdictAndCellAreTheOracles) {
  const std::size_t stride = longRun() ? 1 : 13;
  std::uint64_t seed = 0;
  for (const StructuredPairs& set : structuredPairs(longRun() ? 20 : 9)) {
    ASSERT_GT(set.pairs.size(), 100u) << set.family;
    holdAgainstOracle(set, "", stride);
    holdAgainstOracle(perturbed(set, ++seed), " perturbed", stride);
    if (HasFatalFailure()) return;
  }
}

// A cliff is a pair that needs integers of any length although a few words would do.
TEST(ElementaryStructured, FewWordsAreEnough) {
  constexpr int TOC_BITS = 32;
  for (const StructuredPairs& set : structuredPairs(9)) {
    std::size_t settled = 0, left = 0;
    for (std::size_t i = 0; i < set.pairs.size(); ++i) {
      const PairMotion pair = motionOf(set, i);
      const bool batch = test::decideByBatch(set.kind, pair, TOC_BITS).verdict != Verdict::UNDECIDED;
      const bool known = batch || exact::decideByCoincidence(set.kind, pair, TOC_BITS).verdict != Verdict::UNDECIDED ||
                         exact::decideInPlane(set.kind, pair, TOC_BITS).verdict != Verdict::UNDECIDED ||
                         exact::decideAtSimpleTime(set.kind, pair, TOC_BITS).verdict != Verdict::UNDECIDED ||
                         exact::decideByDoubleDouble(set.kind, pair, TOC_BITS).verdict != Verdict::UNDECIDED;
      ++(known ? settled : left);
    }
    // Edges that stay parallel but for rounding, and come to lie on one line: where they meet, if at all, only integers
    // tell.
    const bool parallel = set.kind == PairKind::EDGE_EDGE && set.family.find("along no axis") != std::string::npos;
    EXPECT_LE(left, settled / (parallel ? 6 : 20))
        << set.family << ", " << toString(set.kind) << ": " << left << " of " << set.pairs.size() << " pairs need more";
  }
}

// What only rounding takes out of a plane has an f as small as the error of doubles: it is computed anew in pairs of
// these, for many pairs at once, and no later tier is asked.
TEST(ElementaryStructured, TheBatchIsEnoughInAPlaneAlongNoAxis) {
  constexpr int TOC_BITS = 32;
  int sets = 0;
  for (const StructuredPairs& set : structuredPairs(9)) {
    if (set.family.find("in a plane along no axis") == std::string::npos) continue;
    ++sets;
    std::size_t settled = 0, contacts = 0, kept = 0;
    for (std::size_t i = 0; i < set.pairs.size(); ++i) {
      const PairMotion pair = motionOf(set, i);
      const ElementaryResult batch = test::decideByBatch(set.kind, pair, TOC_BITS);
      settled += batch.verdict != Verdict::UNDECIDED;
      contacts += batch.verdict == Verdict::CONTACT;
      if (batch.verdict == Verdict::UNDECIDED || ++kept % 7 != 0) continue;
      const ElementaryResult exact = exact::decideByBigIntegers(set.kind, pair, TOC_BITS);
      ASSERT_EQ(batch.verdict, exact.verdict) << set.family << ", pair " << i;
      ASSERT_EQ(batch.toc_lower, exact.toc_lower) << set.family << ", pair " << i;
    }
    EXPECT_GE(settled, set.pairs.size() * (set.kind == PairKind::EDGE_EDGE ? 85 : 99) / 100)
        << set.family << ", " << toString(set.kind);
    EXPECT_GT(contacts, set.pairs.size() / 100) << set.family << ", " << toString(set.kind);
  }
  EXPECT_EQ(sets, 4);
}

}  // namespace
}  // namespace test
}  // namespace dccd
