// The double-double tier's certified signs and cells against exact arithmetic.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "elementary/exact_double_double.h"
#include "elementary/exact_tiers.h"
#include "oracle/algebraic.h"
#include "support/exact_tier.h"
#include "support/generators.h"

namespace dccd {
namespace {

using test::Hardness;
using test::Rational;

/// f(t) = ((b-a) x (c-a)) . (p-a) or ((b-a) x (d-c)) . (c-a), exactly.
Rational exactValue(PairKind kind, const PairMotion& pair, double t) {
  Rational x[4][3];
  for (int i = 0; i < 4; ++i) {
    for (int k = 0; k < 3; ++k) {
      x[i][k] = Rational(pair.x[0][i][k]) * (1 - Rational(t)) + Rational(pair.x[1][i][k]) * Rational(t);
    }
  }
  const int ends[2][3][2] = {{{1, 2}, {1, 3}, {1, 0}}, {{0, 1}, {2, 3}, {0, 2}}};
  Rational d[3][3];
  for (int i = 0; i < 3; ++i) {
    const int* end = ends[kind == PairKind::VERTEX_FACE ? 0 : 1][i];
    for (int k = 0; k < 3; ++k) d[i][k] = x[end[1]][k] - x[end[0]][k];
  }
  Rational sum = 0;
  for (int k = 0; k < 3; ++k) {
    const int i = (k + 1) % 3, j = (k + 2) % 3;
    sum += (d[0][i] * d[1][j] - d[0][j] * d[1][i]) * d[2][k];
  }
  return sum;
}

double gridTime(std::mt19937_64& random, int bits) {
  return std::ldexp(static_cast<double>(random() & ((std::uint64_t{1} << bits) - 1)), -bits);
}

TEST(ExactDoubleDouble, ErrorsStayWithinTheBound) {
  test::RandomSource random(31);
  int certain = 0, total = 0;
  double worst = 0;
  for (int i = 0; i < 4000; ++i) {
    const auto hardness = static_cast<Hardness>(i % static_cast<int>(Hardness::COUNT));
    const Query query = test::hardQuery(random, i % 2 == 0 ? PairKind::VERTEX_FACE : PairKind::EDGE_EDGE, hardness);
    const exact::CoplanarityCubic f(query.kind, query.motion);
    for (const double t : {0.0, 1.0, gridTime(random, 52), gridTime(random, 10)}) {
      const Rational value = exactValue(query.kind, query.motion, t);
      const int sign = value > 0 ? 1 : value < 0 ? -1 : 0;
      const int found = f.signAt(t);
      ++total;
      if (found != 0) {
        ++certain;
        ASSERT_EQ(found, sign) << test::toString(hardness) << " " << i << " at " << t;
      }
      if (!std::isfinite(f.error())) continue;
      const Rational error = abs(Rational(f.valueAt(t)) - value);
      // The value is rounded to double once more than the bound accounts for.
      const Rational bound = Rational(f.error()) + abs(value) * Rational(0x1p-53);
      ASSERT_LE(error, bound) << test::toString(hardness) << " " << i << " at " << t;
      worst = std::max(worst, static_cast<double>(Rational(error / bound)));
    }
  }
  EXPECT_GT(certain, total / 2);
  EXPECT_GT(worst, 1e-3);  // the bound is of use
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
