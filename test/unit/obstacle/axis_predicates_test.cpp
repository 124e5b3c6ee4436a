// Exact signs and times of the axis-aligned obstacle against rational arithmetic, on values made to tie.
#include "obstacle/axis_predicates.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "oracle/algebraic.h"

namespace dccd {
namespace {

using test::Rational;

Rational exactTime(const CrossingTime& time) {
  return (Rational(time.plane) - Rational(time.from)) / (Rational(time.to) - Rational(time.from));
}

int signOf(const Rational& value) { return (value > 0) - (value < 0); }

/// Coordinates that tie often: multiples of a voxel, neighbours of those, a few powers far apart.
class Coordinates {
 public:
  explicit Coordinates(unsigned seed) : random_(seed) {}

  double next() {
    double value = std::uniform_int_distribution<int>(-6, 6)(random_) * (coin(2) ? 0.02 : 0.25);
    if (coin(3)) value = std::nextafter(value, coin(2) ? 1e9 : -1e9);
    if (coin(9)) value *= std::ldexp(1.0, std::uniform_int_distribution<int>(-600, 400)(random_));
    if (coin(50))
      value = std::numeric_limits<double>::denorm_min() * std::uniform_int_distribution<int>(-3, 3)(random_);
    return value;
  }

  /// A crossing at a time from 0 to 1.
  CrossingTime crossing() {
    for (;;) {
      const double plane = next(), from = next(), to = next();
      if (from != to && (from <= to ? from <= plane && plane <= to : to <= plane && plane <= from)) {
        return CrossingTime(plane, from, to);
      }
    }
  }

 private:
  bool coin(int sides) { return std::uniform_int_distribution<int>(1, sides)(random_) == 1; }
  std::mt19937 random_;
};

TEST(CrossingTime, ComparesLikeRationals) {
  Coordinates coordinates(1);
  int ties = 0;
  for (int i = 0; i < 20000; ++i) {
    const CrossingTime a = coordinates.crossing();
    // Every fourth is the same time in other units.
    const CrossingTime b = i % 4 ? coordinates.crossing() : CrossingTime(-4 * a.plane, -4 * a.from, -4 * a.to);
    const int expected = signOf(exactTime(a) - exactTime(b));
    ASSERT_EQ(compare(a, b), expected) << i;
    ASSERT_EQ(compare(b, a), -expected) << i;
    ties += expected == 0;
  }
  EXPECT_GT(ties, 1000);
}

TEST(CrossingTime, CellsHoldTheTime) {
  Coordinates coordinates(2);
  for (int i = 0; i < 20000; ++i) {
    const CrossingTime time = coordinates.crossing();
    for (const int bits : {10, 32, 52}) {
      const Rational cell(std::ldexp(1.0, -bits));
      const Rational k(static_cast<double>(timeCell(time, bits)));
      ASSERT_LE(k * cell, exactTime(time)) << i;
      ASSERT_GT((k + 1) * cell, exactTime(time)) << i;
    }
  }
}

}  // namespace
}  // namespace dccd
