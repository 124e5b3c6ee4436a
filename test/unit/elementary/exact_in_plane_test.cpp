// Pairs in a plane across an axis, with answers that can be worked out by hand: in each of the three planes, and while
// that moves.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "elementary/exact_tiers.h"
#include "oracle/oracle.h"

namespace dccd {
namespace {

constexpr int TOC_BITS = 32;
constexpr auto VF = PairKind::VERTEX_FACE, EE = PairKind::EDGE_EDGE;
constexpr double NO = -1, OPEN = -2;  ///< no contact; left to the tiers behind
constexpr double ULP = 0x1p-52;       ///< of 1

struct Case {
  const char* name;
  PairKind kind;
  double start[4][2], end[4][2];
  double toc;
};

const std::vector<Case> CASES = {
    {"edges cross", EE, {{0, 1}, {2, 1}, {1, 0}, {1, 2}}, {{0, 5}, {2, 5}, {1, 0}, {1, 2}}, 0},
    {"an edge ends on another", EE, {{0, 1}, {1, 1}, {1, 0}, {1, 2}}, {{0, 5}, {1, 5}, {1, 0}, {1, 2}}, 0},
    {"… but for an ulp", EE, {{0, 1}, {1 - ULP, 1}, {1, 0}, {1, 2}}, {{0, 1}, {1 - ULP, 1}, {1, 0}, {1, 2}}, NO},
    {"edges on one line", EE, {{0, 1}, {2, 1}, {1, 1}, {3, 1}}, {{0, 5}, {2, 5}, {1, 1}, {3, 1}}, 0},
    {"edges of no length in one place", EE, {{1, 1}, {1, 1}, {1, 1}, {1, 1}}, {{0, 5}, {2, 5}, {1, 1}, {3, 1}}, 0},
    {"edges on one line, apart, part", EE, {{0, 1}, {1, 1}, {2, 1}, {3, 1}}, {{0, 2}, {1, 2}, {2, 1}, {3, 1}}, NO},
    {"an end comes to an edge", EE, {{3, 1}, {4, 1}, {1, 0}, {1, 2}}, {{0, 1}, {1, 1}, {1, 0}, {1, 2}}, 2.0 / 3},
    {"… beside its end", EE, {{3, 3}, {4, 3}, {1, 0}, {1, 2}}, {{0, 3}, {1, 3}, {1, 0}, {1, 2}}, NO},
    {"… to its very end", EE, {{3, 2}, {4, 2}, {1, 0}, {1, 2}}, {{0, 2}, {1, 2}, {1, 0}, {1, 2}}, OPEN},
    {"… when the step ends", EE, {{3, 1}, {4, 1}, {1, 0}, {1, 2}}, {{1, 1}, {2, 1}, {1, 0}, {1, 2}}, 1},
    {"… beside its end then", EE, {{3, 3}, {4, 3}, {1, 0}, {1, 2}}, {{1, 3}, {2, 3}, {1, 0}, {1, 2}}, NO},
    {"… an ulp too late", EE, {{3, 1}, {4, 1}, {1, 0}, {1, 2}}, {{1 + ULP, 1}, {2, 1}, {1, 0}, {1, 2}}, NO},
    {"… an ulp before", EE, {{3, 1}, {4, 1}, {1, 0}, {1, 2}}, {{1 - ULP, 1}, {2, 1}, {1, 0}, {1, 2}}, 1 - 0x1p-53},
    {"an edge turns onto an end", EE, {{3, 1}, {3.5, 1}, {0, 0}, {5, 5}}, {{3, 1}, {3.5, 1}, {0, 0}, {5, 1}}, 5.0 / 6},
    {"an edge turns past and back", EE, {{3, 1}, {4, 1}, {0, 0}, {4, 8}}, {{3, 1}, {4, 1}, {1, 2}, {-4, 0}}, OPEN},
    {"a vertex in a face", VF, {{1, 1}, {0, 0}, {3, 0}, {0, 3}}, {{1, 1}, {9, 9}, {12, 9}, {9, 12}}, 0},
    {"… on its edge, the face turned over", VF, {{1, 0}, {0, 3}, {3, 0}, {0, 0}}, {{9, 9}, {0, 3}, {3, 0}, {0, 0}}, 0},
    {"… beside it at rest", VF, {{1, -ULP}, {0, 0}, {3, 0}, {0, 3}}, {{1, -ULP}, {0, 0}, {3, 0}, {0, 3}}, NO},
    {"a vertex on a face's line parts", VF, {{4, 0}, {0, 0}, {3, 0}, {0, 3}}, {{5, -1}, {0, 0}, {3, 0}, {0, 3}}, NO},
    {"a vertex in a flat face", VF, {{1, 0}, {0, 0}, {3, 0}, {2, 0}}, {{1, 5}, {0, 0}, {3, 0}, {2, 0}}, 0},
    {"a vertex passes a face", VF, {{-1, 1}, {0, 0}, {3, 0}, {0, 3}}, {{4, 1}, {0, 0}, {3, 0}, {0, 3}}, 0.2},
};

std::string textOf(const ElementaryResult& r) {
  return r.verdict == Verdict::UNDECIDED    ? "open"
         : r.verdict == Verdict::NO_CONTACT ? "no contact"
                                            : "cell " + std::to_string(std::ldexp(r.toc_lower, TOC_BITS));
}

TEST(ExactInPlane, AnswersAsWorkedOutByHand) {
  for (const Case& one : CASES) {
    const ElementaryResult expected =
        one.toc == OPEN ? exact::undecided(Tier::DOUBLE_DOUBLE)
        : one.toc == NO ? exact::noContact(Tier::DOUBLE_DOUBLE)
                        : exact::contactInCell(static_cast<std::int64_t>(std::floor(std::ldexp(one.toc, TOC_BITS))),
                                               TOC_BITS, Tier::DOUBLE_DOUBLE);
    for (int axis = 0; axis < 3; ++axis) {
      PairMotion pair;
      for (int time = 0; time < 2; ++time) {
        for (int i = 0; i < 4; ++i) {
          const double* at = time == 0 ? one.start[i] : one.end[i];
          pair.x[time][i][axis] = 0.1 + 0.2 * time;
          pair.x[time][i][(axis + 1) % 3] = at[0];
          pair.x[time][i][(axis + 2) % 3] = at[1];
        }
      }
      const ElementaryResult found = exact::decideInPlane(one.kind, pair, TOC_BITS);
      EXPECT_EQ(textOf(found), textOf(expected)) << one.name << ", across axis " << axis;
      if (one.toc != OPEN) {
        EXPECT_EQ(test::firstContact(one.kind, pair).has_value(), one.toc != NO) << one.name;
      }
    }
  }
}

TEST(ExactInPlane, WhatLeavesThePlaneIsAnsweredAtTheStartAlone) {
  PairMotion pair = {{{{0, 1, 0}, {2, 1, 0}, {1, 0, 0}, {1, 2, 0}}, {{0, 1, 1}, {2, 1, 0}, {1, 0, 0}, {1, 2, 0}}}};
  EXPECT_EQ(textOf(exact::decideInPlane(EE, pair, TOC_BITS)), "cell 0.000000");
  for (auto& time : pair.x) time[1][0] = 0.5;
  EXPECT_EQ(textOf(exact::decideInPlane(EE, pair, TOC_BITS)), "open");
  pair.x[0][3][2] = 1e-300;
  EXPECT_EQ(textOf(exact::decideInPlane(EE, pair, TOC_BITS)), "open");
}

}  // namespace
}  // namespace dccd
