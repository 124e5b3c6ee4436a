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
    EXPECT_LE(left, settled / 20) << set.family << ", " << toString(set.kind) << ": " << left << " of "
                                  << set.pairs.size() << " pairs need more";
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
    EXPECT_GE(settled, set.pairs.size() * 99 / 100) << set.family << ", " << toString(set.kind);
    EXPECT_GT(contacts, set.pairs.size() / 100) << set.family << ", " << toString(set.kind);
  }
  EXPECT_EQ(sets, 4);
}

/// Points of a lattice that lie in a plane, or on a line, at a time between, with some last bits changed: a vertex
/// comes over an edge or a vertex, edges come to lie on one line, or very nearly so.
PairMotion nearlyMeeting(RandomSource& random) {
  const auto draw = [&](int low, int high) { return std::uniform_int_distribution<int>(low, high)(random); };
  constexpr double BASIS[3][3] = {{3, 1, -2}, {1, -4, 2}, {2, 3, 5}};
  const int after = draw(1, 6), before = 7 - after;
  const bool on_a_line = draw(0, 1) == 0, all_move_alike = draw(0, 2) == 0;
  const double size = std::ldexp(1.0, draw(20, 44));
  double moves[3] = {};
  PairMotion pair;
  for (int i = 0; i < 4; ++i) {
    const double place[3] = {1.0 * draw(-3, 3), on_a_line ? 0.0 : draw(-3, 3), 0};
    const bool other_feature = i == 2;  // of edges; a face's vertices may move as they like
    for (double& x : moves) {
      if (i == 0 || other_feature || !all_move_alike) x = draw(-2, 2);
    }
    for (int k = 0; k < 3; ++k) {
      double at = 0, change = 0;
      for (int b = 0; b < 3; ++b) at += place[b] * BASIS[b][k], change += moves[b] * BASIS[b][k];
      pair.x[0][i][k] = (7 * at - after * change) * size + draw(-1, 1);
      pair.x[1][i][k] = (7 * at + before * change) * size + draw(-1, 1);
    }
  }
  return pair;
}

TEST(ElementaryStructured, WhatNearlyMeetsAnEdgeIsTheIntegers) {
  constexpr int TOC_BITS = 32;
  RandomSource random(20170601);
  for (const PairKind kind : {PairKind::VERTEX_FACE, PairKind::EDGE_EDGE}) {
    const int count = longRun() ? 200000 : 20000;
    int settled = 0, contacts = 0;
    for (int i = 0; i < count; ++i) {
      const PairMotion pair = nearlyMeeting(random);
      const ElementaryResult batch = test::decideByBatch(kind, pair, TOC_BITS);
      if (batch.verdict == Verdict::UNDECIDED) continue;
      ++settled;
      contacts += batch.verdict == Verdict::CONTACT;
      const ElementaryResult exact = exact::decideByBigIntegers(kind, pair, TOC_BITS);
      ASSERT_EQ(batch.verdict, exact.verdict) << toString(kind) << ", pair " << i;
      ASSERT_EQ(batch.toc_lower, exact.toc_lower) << toString(kind) << ", pair " << i;
    }
    EXPECT_GT(settled, count * 7 / 10) << toString(kind);
    EXPECT_GT(contacts, count / 20) << toString(kind);
  }
}

/// All four vertices on one line through the origin at both ends of the step, the last bits of a difference far below
/// those of its terms: nothing of what is 0 is computed as 0.
PairMotion onOneLine(RandomSource& random) {
  std::uniform_real_distribution<double> component(-1, 1);
  std::uniform_int_distribution<int> exponent(0, 70), sign(0, 1);
  const double along[3] = {component(random), component(random), component(random)};
  PairMotion pair;
  for (auto& ends : pair.x) {
    for (auto& vertex : ends) {
      const double times = std::ldexp(sign(random) == 0 ? 1.0 : -1.0, -exponent(random));
      for (int k = 0; k < 3; ++k) vertex[k] = times * along[k];
    }
  }
  return pair;
}

TEST(ElementaryStructured, EdgesOnOneLineAreNotApart) {
  constexpr int TOC_BITS = 32;
  RandomSource random(20261201);
  int contacts = 0;
  for (int i = 0; i < 20000; ++i) {
    const PairMotion pair = onOneLine(random);
    const bool meet = exact::decideByBigIntegers(PairKind::EDGE_EDGE, pair, TOC_BITS).verdict == Verdict::CONTACT;
    contacts += meet;
    const Verdict batch = test::decideByBatch(PairKind::EDGE_EDGE, pair, TOC_BITS).verdict;
    if (batch != Verdict::UNDECIDED) {
      ASSERT_EQ(batch == Verdict::CONTACT, meet) << "pair " << i;
    }
  }
  EXPECT_GT(contacts, 5000);
}

/// In the plane y = 0, b and d at one place when the step begins. What is across the change of B is as short as a's x,
/// a power of two near the least one.
PairMotion meetingAtTheStart(RandomSource& random) {
  const auto draw = [&](int lo, int hi) { return std::uniform_int_distribution<int>(lo, hi)(random); };
  const auto oddOf = [&](int bits, int exponent) {
    const std::uint64_t top = std::uint64_t{1} << (bits - 1);
    const std::uint64_t digits = std::uniform_int_distribution<std::uint64_t>(top, 2 * top - 1)(random) | 1;
    return std::ldexp(static_cast<double>(digits), exponent - bits + 1);
  };
  const int p = draw(46, 149), q = draw(46, p), s = draw(20, 40);
  const double x = oddOf(48, p), z = oddOf(53, q - s), tiny = -std::ldexp(1, std::max(-1074, -985 - (q - s)));
  const double later_z = z - std::ldexp(1, q - s - 7);
  PairMotion pair{};
  for (const int end : {0, 1}) {
    pair.x[end][0][0] = tiny, pair.x[end][0][2] = -std::ldexp(1, q + end);
    pair.x[end][1][0] = pair.x[end][3][0] = x;
    pair.x[end][1][2] = end == 0 ? z : later_z, pair.x[end][3][2] = z;
  }
  return pair;
}

TEST(ElementaryStructured, EdgesThatMeetAtTheStartAreNotApart) {
  RandomSource random(20261202);
  int undecided = 0;
  for (int i = 0; i < 20000; ++i) {
    const PairMotion pair = meetingAtTheStart(random);
    const Verdict batch = test::decideByBatch(PairKind::EDGE_EDGE, pair, 32).verdict;
    ASSERT_NE(batch, Verdict::NO_CONTACT) << "pair " << i;
    undecided += batch == Verdict::UNDECIDED;
  }
  EXPECT_GT(undecided, 0) << "nothing of it was hard";
}

}  // namespace
}  // namespace test
}  // namespace dccd
