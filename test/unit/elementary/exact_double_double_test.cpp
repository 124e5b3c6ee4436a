// The double-double tier's certified signs and cells against exact arithmetic.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "elementary/exact_double_double.h"
#include "elementary/exact_tiers.h"
#include "support/exact_tier.h"

namespace dccd {
namespace {

double gridTime(std::mt19937_64& random, int bits) {
  return std::ldexp(static_cast<double>(random() & ((std::uint64_t{1} << bits) - 1)), -bits);
}

TEST(ExactDoubleDouble, RangeOfTheBound) {
  PairMotion pair{};
  const double corners[4][3] = {{0.2, 0.3, 1}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  for (const double scale : {0x1p-310, 0x1p-299, 1.0, 0x1p299, 0x1p310}) {
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 3; ++k) pair.x[0][i][k] = pair.x[1][i][k] = scale * corners[i][k];
    }
    const exact::CoplanarityCubic f(PairKind::VERTEX_FACE, pair);
    const bool in_range = scale > 0x1p-300 && scale < 0x1p300;
    EXPECT_EQ(std::isfinite(f.error()), in_range) << scale;
    EXPECT_EQ(f.signAt(0.5), in_range ? 1 : 0) << scale;
  }
}

/// A vertex that falls through the middle of a face at rest, f linear or cubic, its only root at about t.
PairMotion falling(double t, bool turning) {
  PairMotion pair{};
  const double face[3][3] = {{-1, -1, 0}, {2, -1, 0}, {-1, 2, 0}};
  for (int time = 0; time < 2; ++time) {
    for (int i = 0; i < 3; ++i) {
      for (int k = 0; k < 3; ++k) pair.x[time][i + 1][k] = face[i][k] * (turning && time == 1 ? 1.25 : 1.0);
    }
    pair.x[time][0][0] = pair.x[time][0][1] = 0.01;
    pair.x[time][0][2] = time == 0 ? t : t - 1;
  }
  return pair;
}

TEST(ExactDoubleDouble, CellsFromTheWholeStepAreThoseOfTheIntegers) {
  std::mt19937_64 random(37);
  int found = 0;
  for (int i = 0; i < 2000; ++i) {
    const double t = 0.001 + 0.998 * gridTime(random, 52);
    const PairMotion pair = falling(t, i % 2 == 0);
    for (const int bits : {10, 32, 52}) {
      const std::int64_t cell = exact::cellOfRoot(exact::CoplanarityCubic(PairKind::VERTEX_FACE, pair), 0, 1, bits);
      if (cell < 0) continue;  // exactly on a grid point
      ++found;
      const ElementaryResult truth = test::decideWithTier(Tier::FIXED_INTEGER, PairKind::VERTEX_FACE, pair, bits);
      ASSERT_EQ(truth.verdict, Verdict::CONTACT);
      ASSERT_EQ(std::ldexp(static_cast<double>(cell), -bits), truth.toc_lower) << t << " " << bits;
    }
  }
  EXPECT_GT(found, 3 * 2000 / 2);
}

/// The face is not quite flat, by as little as pairs of doubles cannot hold beside 1: on which side of 0.5 the root is.
TEST(ExactDoubleDouble, TermsOfAllSizesHaveExactSigns) {
  std::mt19937_64 random(41);
  int decided = 0;
  for (int i = 0; i < 1000; ++i) {
    PairMotion pair = falling(0.5, i % 2 == 0);
    const auto tiny = [&] {
      return std::ldexp(random() % 2 == 0 ? 1.5 : -1.0, -900 - static_cast<int>(random() % 100));
    };
    const bool everywhere = i % 5 == 0;  // then products of three are smaller than doubles can be
    for (auto& time : pair.x) {
      for (int corner = 1; corner < 4; ++corner) time[corner][2] = tiny();
      for (int k = 0; k < 2 && everywhere; ++k) time[0][k] = tiny();
    }
    const exact::CoplanarityCubic f(PairKind::VERTEX_FACE, pair);
    const std::int64_t cell = exact::cellOfRoot(f, 0.25, 0.75, 32);
    EXPECT_EQ(cell < 0, everywhere) << i;
    if (cell < 0) continue;
    ++decided;
    const ElementaryResult truth = test::decideWithTier(Tier::BIG_INTEGER, PairKind::VERTEX_FACE, pair, 32);
    ASSERT_EQ(truth.verdict, Verdict::CONTACT);
    ASSERT_EQ(std::ldexp(static_cast<double>(cell), -32), truth.toc_lower) << i;
    EXPECT_EQ(f.signAt(0.5), truth.toc_lower < 0.5 ? -f.signAt(0) : f.signAt(0)) << i;
  }
  EXPECT_GT(decided, 700);
}

TEST(ExactDoubleDouble, GridPointItselfIsLeftToTheIntegers) {
  const PairMotion pair = falling(0.5, false);
  const exact::CoplanarityCubic f(PairKind::VERTEX_FACE, pair);
  EXPECT_EQ(f.signAt(0.5), 0);
  EXPECT_EQ(exact::cellOfRoot(f, 0.25, 0.75, 32), -1);
  EXPECT_EQ(exact::cellOfRoot(f, 0.5 - 0x1p-40, 0.5 + 0x1p-40, 10), -1);
  const ElementaryResult result = testPair(*makeRung({}), PairKind::VERTEX_FACE, pair);
  EXPECT_EQ(result.verdict, Verdict::CONTACT);
  EXPECT_EQ(result.toc_lower, 0.5);
  EXPECT_EQ(result.toc_upper, 0.5 + 0x1p-32);
}

}  // namespace
}  // namespace dccd
