// Times of a step as stamps: whole nanoseconds, and never on the wrong side of the time that they stand for.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "dccd/outcome.h"
#include "oracle/algebraic.h"

namespace dccd {
namespace test {
namespace {

constexpr StampNs START_NS = 1'600'000'000'123'456'789;

Outcome lasting(StampNs duration_ns) {
  Outcome outcome;
  outcome.start_ns = START_NS;
  outcome.stamp_ns = START_NS + duration_ns;
  return outcome;
}

void holds(StampNs duration_ns, double toc) {
  const Outcome outcome = lasting(duration_ns);
  const Rational exact_ns = Rational(toc) * Rational(duration_ns);
  const Rational before_ns(outcome.stampBefore(toc) - START_NS), after_ns(outcome.stampAfter(toc) - START_NS);
  EXPECT_LE(before_ns, exact_ns) << toc << " of " << duration_ns << " ns";
  EXPECT_GT(before_ns + 1, exact_ns) << "the last such nanosecond; " << toc << " of " << duration_ns << " ns";
  EXPECT_GE(after_ns, exact_ns) << toc << " of " << duration_ns << " ns";
  EXPECT_LE(outcome.stampAfter(toc), outcome.stamp_ns);
}

TEST(Stamps, AreOnTheirSideOfTheTime) {
  for (const StampNs duration_ns : {1LL, 3LL, 1000LL, 16'666'667LL, 33'333'333LL, 100'000'000LL, 500'000'000LL}) {
    for (const double toc : {0.0, 0x1p-52, 0.5, 1 - 0x1p-53, 1.0}) holds(duration_ns, toc);
  }
}

/// The double next to a whole nanosecond: a product that is rounded to nearest comes out as that nanosecond.
TEST(Stamps, AreOnTheirSideNextToAWholeNanosecond) {
  std::mt19937_64 random(3);
  for (const StampNs duration_ns : {16'666'667LL, 30'000'000LL, 33'333'333LL, 100'000'000LL, 500'000'000LL}) {
    for (int i = 0; i < 2000; ++i) {
      const auto ns = static_cast<double>(random() % static_cast<std::uint64_t>(duration_ns));
      const double toc = ns / static_cast<double>(duration_ns);
      for (const double near : {std::nextafter(toc, 0), toc, std::nextafter(toc, 1)}) holds(duration_ns, near);
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
