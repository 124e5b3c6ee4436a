// The exact rung's integers: all kinds obey the laws of arithmetic and agree with each other.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "elementary/exact_integer.h"

namespace dccd {
namespace {

constexpr int LIMBS = 16;
using Fixed = StackInteger<LIMBS>;

/// The same number in all kinds.
struct Twin {
  Fixed fixed;
  BigInteger big;
};

Twin operator+(const Twin& a, const Twin& b) { return {a.fixed + b.fixed, a.big + b.big}; }
Twin operator-(const Twin& a, const Twin& b) { return {a.fixed - b.fixed, a.big - b.big}; }
Twin operator*(const Twin& a, const Twin& b) { return {a.fixed * b.fixed, a.big * b.big}; }

void expectTwins(const Twin& a) {
  EXPECT_EQ(a.fixed.sign(), a.big.sign());
  const ScaledDouble fixed = a.fixed.approximate(), big = a.big.approximate();
  const double unscaled = std::ldexp(fixed.mantissa, static_cast<int>(fixed.exponent - big.exponent));
  EXPECT_NEAR(unscaled, big.mantissa, 0x1p-51);
  if (a.fixed.sign() != 0) {
    EXPECT_GE(std::fabs(fixed.mantissa), 0.5);
    EXPECT_LT(std::fabs(fixed.mantissa), 1.0);
  }
}

void expectZero(const Twin& a) {
  EXPECT_EQ(a.fixed.sign(), 0);
  EXPECT_EQ(a.big.sign(), 0);
}

/// Numbers with carries and borrows: powers of two, their neighbours, zero, sums of such, any sign.
Twin randomTwin(std::mt19937_64& random, int most_bits) {
  Twin sum{Fixed(0), BigInteger(0)};
  for (int i = static_cast<int>(random() % 4); i >= 0; --i) {
    const auto value = static_cast<std::int64_t>(random()) >> (random() % 64);
    const std::int64_t picked = random() % 3 == 0 ? (random() % 2 == 0 ? 1 : -1) : value;
    const int shift = static_cast<int>(random() % static_cast<unsigned>(most_bits - 64));
    sum = sum + Twin{Fixed::shifted(picked, shift), BigInteger::shifted(picked, shift)};
  }
  return sum;
}

TEST(ExactInteger, LawsOfArithmetic) {
  std::mt19937_64 random(1);
  for (int i = 0; i < 20000; ++i) {
    const Twin a = randomTwin(random, 300), b = randomTwin(random, 300), c = randomTwin(random, 300);
    expectZero((a + b) - b - a);
    expectZero((a - b) + (b - a));
    expectZero((a + b) * (a - b) - (a * a - b * b));
    expectZero(a * (b + c) - (a * b + a * c));
    expectZero((a * b) * c - a * (b * c));
    expectTwins(a * b - c);
    expectTwins(a * b * c);
    if (HasFailure()) return;
  }
}

TEST(ExactInteger, SmallFactorsShiftsAndNegation) {
  std::mt19937_64 random(2);
  for (int i = 0; i < 20000; ++i) {
    const Twin a = randomTwin(random, 400);
    const auto factor = static_cast<std::int64_t>(random()) >> (random() % 64);
    const int shift = static_cast<int>(random() % 300);
    const Twin by_factor{a.fixed * factor, a.big * factor};
    const Twin shifted{a.fixed << shift, a.big << shift};
    expectZero(by_factor - a * Twin{Fixed(factor), BigInteger(factor)});
    expectZero(shifted - a * Twin{Fixed::shifted(1, shift), BigInteger::shifted(1, shift)});
    expectZero(a + Twin{-a.fixed, -a.big});
    if (HasFailure()) return;
  }
}

// Where the leading terms cancel, all but one bit thousands of places below, only exact arithmetic knows the sign.
TEST(ExactInteger, CancellationIsSeenThrough) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 2000; ++i) {
    const auto value = static_cast<std::int64_t>(random() >> 11);
    const int far = static_cast<int>(random() % 4000);
    const BigInteger one(random() % 2 ? 1 : -1), large = BigInteger::shifted(value + 1, far);
    const BigInteger next = large + one;
    EXPECT_EQ((next * next - large * large).sign(), one.sign()) << value << " 2^" << far;
    EXPECT_EQ(((large + next) - next - large).sign(), 0);
    EXPECT_EQ((next - large).approximate().exponent, 1);
  }
}

TEST(ExactInteger, ProductsFillTheCapacity) {
  // 2^x * 2^y with x + y + 1 = CAPACITY_BITS bits, cut everywhere: the factors together have one limb more than that.
  struct Guarded {
    Fixed product;
    std::uint64_t guard = 0x0123456789abcdef;
  };
  for (int x = 0; x < Fixed::CAPACITY_BITS; ++x) {
    const int y = Fixed::CAPACITY_BITS - 1 - x;
    Guarded guarded{Fixed::shifted(1, x) * Fixed::shifted(-1, y)};
    EXPECT_EQ(guarded.guard, 0x0123456789abcdefu);
    EXPECT_EQ(guarded.product.sign(), -1);
    EXPECT_EQ(guarded.product.approximate().exponent, Fixed::CAPACITY_BITS);
    EXPECT_EQ((guarded.product + Fixed::shifted(1, Fixed::CAPACITY_BITS - 1)).sign(), 0);
  }
}

TEST(ExactInteger, ExtremesOfInt64) {
  for (const std::int64_t value : {std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max(),
                                   std::int64_t{0}, std::int64_t{-1}}) {
    const Twin a{Fixed(value), BigInteger(value)};
    expectTwins(a);
    expectTwins(a * a);
    EXPECT_EQ(a.fixed.sign(), (value > 0) - (value < 0));
    EXPECT_EQ(std::ldexp(a.fixed.approximate().mantissa, static_cast<int>(a.fixed.approximate().exponent)),
              static_cast<double>(value));
  }
}

TEST(ExactInteger, CopiesKeepTheirOwnValue) {
  Fixed a(5);
  Fixed b = a;
  a = a * a;
  EXPECT_EQ((b - Fixed(5)).sign(), 0);
  EXPECT_EQ((a - Fixed(25)).sign(), 0);
  BigInteger c(5);
  BigInteger d = c;
  c = c * c;
  d = std::move(c);
  EXPECT_EQ((d - BigInteger(25)).sign(), 0);
}

}  // namespace
}  // namespace dccd
