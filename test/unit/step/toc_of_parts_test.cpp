// Times of a part as times of the whole step: never on the wrong side, against rational arithmetic.
#include <gmpxx.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "step/conclude.h"

namespace dccd {
namespace {

TEST(TocOfParts, BracketsTheTrueTime) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> unit(0, 1);
  double worst = 0;
  for (int k = 0; k < 300000; ++k) {
    const std::size_t n = 2 + random() % 64, i = random() % n;
    double toc = unit(random);
    if (k % 4 == 1) toc = std::ldexp(toc, -static_cast<int>(random() % 40));
    if (k % 4 == 2) toc = std::nextafter(k % 8 == 2 ? 1.0 : 0.5, 0.25);
    if (k % 4 == 3) toc = std::ldexp(std::floor(std::ldexp(toc, 32)), -32);
    const mpq_class exact = (mpq_class(static_cast<unsigned long>(i)) + mpq_class(toc)) / static_cast<unsigned long>(n);
    const double low = scaleDown(toc, i, n), high = scaleUp(toc, i, n);
    ASSERT_TRUE(mpq_class(low) <= exact) << toc << " of part " << i << " of " << n;
    ASSERT_TRUE(mpq_class(high) >= exact) << toc << " of part " << i << " of " << n;
    worst = std::max(worst, (high - low) / std::nextafter(high, 2.0) * 0x1p52);
  }
  EXPECT_LE(worst, 8) << "units in the last place";
  EXPECT_EQ(scaleDown(0.3, 0, 1), 0.3);
  EXPECT_EQ(scaleUp(0.3, 0, 1), 0.3);
  EXPECT_EQ(scaleUp(1, 6, 7), 1);
  EXPECT_EQ(scaleDown(0, 0, 7), 0);
}

}  // namespace
}  // namespace dccd
