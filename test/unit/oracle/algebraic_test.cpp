// The oracle's arithmetic on polynomials whose roots are known by construction.
#include "oracle/algebraic.h"

#include <gtest/gtest.h>

#include <limits>

namespace dccd {
namespace test {
namespace {

/// denominator * t - numerator.
Polynomial linear(long numerator, long denominator) { return Polynomial({Integer(-numerator), Integer(denominator)}); }

TEST(Algebraic, FindsDistinctRepeatedAndBorderRoots) {
  const Polynomial p = linear(0, 1) * linear(1, 3) * linear(1, 3) * linear(1, 1) * linear(7, 5);
  std::vector<Root> roots = rootsInUnitInterval(p);
  ASSERT_EQ(roots.size(), 3u);
  EXPECT_EQ(roots[0].compareWith(Dyadic{0, 0}), 0);
  EXPECT_EQ(roots[1].signOf(linear(1, 3)), 0);
  EXPECT_EQ(roots[2].compareWith(Dyadic{1, 0}), 0);
}

TEST(Algebraic, FindsTripleRootAndNoRootWhereThereIsNone) {
  EXPECT_EQ(rootsInUnitInterval(linear(2, 7) * linear(2, 7) * linear(2, 7)).size(), 1u);
  EXPECT_TRUE(rootsInUnitInterval(Polynomial({1, -2, 2})).empty());  // (1-t)^2 + t^2
  EXPECT_TRUE(rootsInUnitInterval(Polynomial({5})).empty());
}

TEST(Algebraic, SignAtIrrationalRootIsExact) {
  std::vector<Root> roots = rootsInUnitInterval(Polynomial({-1, 0, 2}));  // sqrt(1/2)
  ASSERT_EQ(roots.size(), 1u);
  EXPECT_EQ(roots[0].signOf(Polynomial({-1, 0, 2}) * linear(1, 3)), 0);
  EXPECT_EQ(roots[0].signOf(Polynomial({-1, 0, 0, 0, 4})), 0);
  EXPECT_EQ(roots[0].signOf(Polynomial(
                {Integer("-1000000000000000000000000000001"), 0, Integer("2000000000000000000000000000000")})),
            -1);
}

TEST(Algebraic, OrdersNeighboursThatDoublesCannotTell) {
  const Integer big = Integer(1) << 200;
  Root third = rootsInUnitInterval(linear(1, 3))[0];
  Root above = rootsInUnitInterval(Polynomial({-(big + 1), big * 3}))[0];
  EXPECT_EQ(third.compareWith(above), -1);
  EXPECT_EQ(above.compareWith(third), 1);
  Root same = rootsInUnitInterval(linear(1, 3) * linear(3, 4))[0];
  EXPECT_EQ(third.compareWith(same), 0);
  const Dyadic between = strictlyBetween(third, above);
  EXPECT_EQ(third.compareWith(between), -1);
  EXPECT_EQ(above.compareWith(between), 1);
}

TEST(Algebraic, CellsAreFloorsAlsoOnGridPoints) {
  EXPECT_EQ(rootsInUnitInterval(linear(5, 8))[0].cell(3), 5);
  EXPECT_EQ(rootsInUnitInterval(linear(5, 8))[0].cell(52), Integer(5) << 49);
  EXPECT_EQ(rootsInUnitInterval(linear(1, 1))[0].cell(10), 1024);
  EXPECT_EQ(rootsInUnitInterval(linear(1, 3))[0].cell(10), 341);
  const Integer big = Integer(1) << 300;
  EXPECT_EQ(rootsInUnitInterval(Polynomial({-(big - 1), big * 2}))[0].cell(10), 511);  // just below 1/2
}

TEST(Algebraic, DyadicsEqualTheirDoubles) {
  for (double value : {0.0, 1.0, 0.1, std::numeric_limits<double>::denorm_min(), std::numeric_limits<double>::max()}) {
    EXPECT_EQ(Dyadic::fromDouble(value).rational(), Rational(value));
  }
  EXPECT_THROW(Dyadic::fromDouble(-1), std::invalid_argument);
  EXPECT_THROW(Dyadic::fromDouble(std::numeric_limits<double>::infinity()), std::invalid_argument);
}

}  // namespace
}  // namespace test
}  // namespace dccd
