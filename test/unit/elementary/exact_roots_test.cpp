// Roots of cubics and signs at them, on polynomials whose roots are known.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <random>
#include <vector>

#include "elementary/exact_integer.h"
#include "elementary/exact_roots.h"

namespace dccd {
namespace exact {
namespace {

template <class Z>
Cubic<Z> cubic(std::int64_t c0, std::int64_t c1, std::int64_t c2, std::int64_t c3) {
  return {{Z(c0), Z(c1), Z(c2), Z(c3)}};
}
template <class Z>
Quadratic<Z> quadratic(std::int64_t c0, std::int64_t c1, std::int64_t c2) {
  return {{Z(c0), Z(c1), Z(c2)}};
}

/// A rational number p / q, q > 0.
struct Fraction {
  std::int64_t p, q;
};

/// (q1 t - p1)(q2 t - p2)(q3 t - p3) times a constant.
template <class Z>
Cubic<Z> withRoots(Fraction a, Fraction b, Fraction c, std::int64_t factor) {
  const std::int64_t c0 = -a.p * b.p * c.p;
  const std::int64_t c1 = a.q * b.p * c.p + a.p * b.q * c.p + a.p * b.p * c.q;
  const std::int64_t c2 = -(a.q * b.q * c.p + a.q * b.p * c.q + a.p * b.q * c.q);
  return cubic<Z>(factor * c0, factor * c1, factor * c2, factor * a.q * b.q * c.q);
}

template <class Z>
class ExactRoots : public testing::Test {};
using Integers = testing::Types<StackInteger<64>, BigInteger>;
TYPED_TEST_SUITE(ExactRoots, Integers);

TYPED_TEST(ExactRoots, RationalRootsOfEveryMultiplicityAndSign) {
  using Z = TypeParam;
  constexpr int BITS = 48;
  std::mt19937 random(3);
  for (int i = 0; i < 3000; ++i) {
    const std::int64_t q = 1 + static_cast<std::int64_t>(random() % 12);
    std::vector<Fraction> roots;  // common denominator: in order when the numerators are; in [0,1] and beyond
    for (int k = 0; k < 3; ++k) roots.push_back({static_cast<std::int64_t>(random() % (3 * q + 1)) - q, q});
    const std::int64_t factor = random() % 2 == 0 ? 7 : -7;
    PolynomialRoots<Z> found(withRoots<Z>(roots[0], roots[1], roots[2], factor), BITS);
    std::vector<std::int64_t> expected;
    for (std::int64_t p = 0; p <= q; ++p) {
      if (roots[0].p == p || roots[1].p == p || roots[2].p == p) expected.push_back(p);
    }
    ASSERT_EQ(static_cast<std::size_t>(found.count()), expected.size());
    for (std::size_t k = 0; k < expected.size(); ++k) {
      const int index = static_cast<int>(k);
      const std::int64_t p = expected[k];
      EXPECT_EQ(found.cell(index), (p << BITS) / q);
      EXPECT_EQ(found.signAt(index, quadratic<Z>(-p, q, 0)), 0);
      EXPECT_EQ(found.signAt(index, quadratic<Z>(-p * p, 0, q * q)), 0);
      EXPECT_EQ(found.signAt(index, quadratic<Z>(p * p, -2 * p * q, q * q)), 0);
      // One part in 2^55 beside the root, where doubles cannot tell.
      const Z tiny = Z::shifted(1, 0), scale = Z::shifted(1, 55);
      EXPECT_EQ(found.signAt(index, Quadratic<Z>{{Z(-p) * scale + tiny, Z(q) * scale, Z(0)}}), 1);
      EXPECT_EQ(found.signAt(index, Quadratic<Z>{{Z(-p) * scale - tiny, Z(q) * scale, Z(0)}}), -1);
      const Quadratic<Z> square = {{Z(p * p) * scale + tiny, Z(-2 * p * q) * scale, Z(q * q) * scale}};
      EXPECT_EQ(found.signAt(index, square), 1);
    }
    if (this->HasFailure()) return;
  }
}

TYPED_TEST(ExactRoots, LowerDegrees) {
  using Z = TypeParam;
  EXPECT_EQ(PolynomialRoots<Z>(cubic<Z>(5, 0, 0, 0), 40).count(), 0);
  PolynomialRoots<Z> line(cubic<Z>(1, -3, 0, 0), 40);
  ASSERT_EQ(line.count(), 1);
  EXPECT_EQ(line.cell(0), (std::int64_t{1} << 40) / 3);
  EXPECT_EQ(line.signAt(0, quadratic<Z>(-1, 0, 9)), 0);
  EXPECT_EQ(PolynomialRoots<Z>(cubic<Z>(1, 0, 4, 0), 40).count(), 0);
  PolynomialRoots<Z> twice(cubic<Z>(-1, 4, -4, 0), 40);
  ASSERT_EQ(twice.count(), 1);
  EXPECT_EQ(twice.cell(0), std::int64_t{1} << 39);
  EXPECT_EQ(twice.signAt(0, quadratic<Z>(-1, 2, 0)), 0);
  PolynomialRoots<Z> two(cubic<Z>(1, -8, 8, 0), 40);  // 1/2 -+ sqrt(1/8)
  ASSERT_EQ(two.count(), 2);
  EXPECT_EQ(two.cell(0), static_cast<std::int64_t>(std::floor((0.5 - std::sqrt(0.125)) * 0x1p40)));
  EXPECT_EQ(two.cell(1), static_cast<std::int64_t>(std::floor((0.5 + std::sqrt(0.125)) * 0x1p40)));
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(two.signAt(i, quadratic<Z>(1, -8, 8)), 0);
    EXPECT_EQ(two.signAt(i, quadratic<Z>(-3, 24, -24)), 0);
    EXPECT_EQ(two.signAt(i, quadratic<Z>(0, 0, 0)), 0);
    EXPECT_EQ(two.signAt(i, quadratic<Z>(-2, 0, 0)), -1);
    EXPECT_EQ(two.signAt(i, quadratic<Z>(-1, 2, 0)), i == 0 ? -1 : 1);
  }
}

TYPED_TEST(ExactRoots, CubicRootSharedWithAQuadratic) {
  using Z = TypeParam;
  // (2 t^2 - 1)(t + 1) and (2 t^2 - 1)(t - 3): the root sqrt(1/2) rises first, falls, or rises last.
  for (const Cubic<Z>& f : {cubic<Z>(-1, -1, 2, 2), cubic<Z>(1, 1, -2, -2), cubic<Z>(3, -1, -6, 2)}) {
    PolynomialRoots<Z> roots(f, 40);
    ASSERT_EQ(roots.count(), 1);
    EXPECT_EQ(roots.cell(0), static_cast<std::int64_t>(std::floor(std::sqrt(0.5) * 0x1p40)));
    EXPECT_EQ(roots.signAt(0, quadratic<Z>(-1, 0, 2)), 0);
    const Z scale = Z::shifted(1, 70);
    for (const int side : {-1, 1}) {
      EXPECT_EQ(roots.signAt(0, Quadratic<Z>{{Z(-1) * scale + Z(side), Z(0), Z(2) * scale}}), side);
      EXPECT_EQ(roots.signAt(0, Quadratic<Z>{{Z(1) * scale + Z(side), Z(0), Z(-2) * scale}}), side);
    }
  }
}

TYPED_TEST(ExactRoots, AQuadraticThatChangesItsSignTwiceInTheRootsCell) {
  using Z = TypeParam;
  // Sixteen cells; the root 18/64 is in the fourth, [16/64, 20/64), between and beside the quadratic's 17/64 and 19/64.
  for (const Cubic<Z>& f : {cubic<Z>(-18, 64, 0, 0), cubic<Z>(-18, 64, -18, 64)}) {
    PolynomialRoots<Z> roots(f, 4);
    ASSERT_EQ(roots.count(), 1);
    ASSERT_EQ(roots.cell(0), 4);
    EXPECT_EQ(roots.signAt(0, quadratic<Z>(17 * 19, -64 * 36, 64 * 64)), -1);
    EXPECT_EQ(roots.signAt(0, quadratic<Z>(-17 * 19, 64 * 36, -64 * 64)), 1);
    EXPECT_EQ(roots.signAt(0, quadratic<Z>(19 * 19, -64 * 38, 64 * 64)), 1);
    EXPECT_EQ(roots.signAt(0, quadratic<Z>(17 * 17, -64 * 34, 64 * 64)), 1);
    EXPECT_EQ(roots.signAt(0, quadratic<Z>(-17 * 15, 64 * 32, -64 * 64)), -1);
  }
}

TYPED_TEST(ExactRoots, RootsTooCloseForDoubles) {
  using Z = TypeParam;
  // (t - 1/2)((t - 1/2)^2 - e^2), e = 2^-100, times 2^203: three roots in one cell, told apart by the sign of t - 1/2.
  const Z one(1);
  const Z e2 = one;  // e^2 2^200
  const auto s = [](int bits) { return Z::shifted(1, bits); };
  // t^3 - 3/2 t^2 + (3/4 - e^2) t - (1/8 - e^2 / 2)
  const Cubic<Z> f = {{(e2 << 2) - s(200), (s(201) * 3) - (e2 << 3), Z(0) - (s(202) * 3), s(203)}};
  PolynomialRoots<Z> roots(f, 52);
  ASSERT_EQ(roots.count(), 3);
  EXPECT_EQ(roots.cell(0), (std::int64_t{1} << 51) - 1);
  EXPECT_EQ(roots.cell(1), std::int64_t{1} << 51);
  EXPECT_EQ(roots.cell(2), std::int64_t{1} << 51);
  for (int i = 0; i < 3; ++i) EXPECT_EQ(roots.signAt(i, quadratic<Z>(-1, 2, 0)), i - 1);
  // (t - 1/2)^2 + e^2 has a complex pair at the same distance: one root.
  const Cubic<Z> g = {{Z(0) - (e2 << 2) - s(200), (s(201) * 3) + (e2 << 3), Z(0) - (s(202) * 3), s(203)}};
  EXPECT_EQ(PolynomialRoots<Z>(g, 52).count(), 1);
}

}  // namespace
}  // namespace exact
}  // namespace dccd
