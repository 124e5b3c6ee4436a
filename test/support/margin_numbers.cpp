#include "support/margin_numbers.h"

#include <cmath>

namespace dccd {
namespace test {
namespace margins {

double uniform(RandomSource& random) { return 2 * (static_cast<double>(random() >> 11) * 0x1p-53) - 1; }
double share(RandomSource& random) { return static_cast<double>(random() >> 11) * 0x1p-53; }
double power(RandomSource& random, int from, int to) {
  return std::ldexp(1 + share(random), from + static_cast<int>(random() % static_cast<unsigned>(to - from + 1)));
}
double heavy(RandomSource& random) { return (random() % 2 ? 1 : -1) * (1 + 0.125 * share(random)); }

V3 heavyVector(RandomSource& random) { return {heavy(random), heavy(random), heavy(random)}; }
V3 anyVector(RandomSource& random) { return {uniform(random), uniform(random), uniform(random)}; }
V3 originOf(RandomSource& random, const V3& meeting_place) {
  return random() % 4 ? V3(-meeting_place) : V3(anyVector(random));
}

void changeOne(MarginInput& input, RandomSource& random) {
  double& x = input.x[random() % input.x.size()];
  const int scale = static_cast<int>(random() % 6);
  if (scale == 5) {
    x += uniform(random) * std::ldexp(1.0, -static_cast<int>(random() % 80));
  } else if (scale < 3) {
    const int steps = 1 + static_cast<int>(random() % (scale == 0 ? 1 : scale == 1 ? 8 : 1000));
    const double to = random() % 2 ? HUGE_VAL : -HUGE_VAL;
    for (int i = 0; i < steps; ++i) x = std::nextafter(x, to);
  } else {
    x += uniform(random) * std::ldexp(std::fabs(x), -static_cast<int>(random() % 48));
  }
}

Rational exact(double x) { return Rational(x); }
int signOf(const Rational& x) { return x.sign(); }

Rational determinant(const std::array<std::array<Rational, 3>, 3>& x) {
  const auto minor = [&](int i, int j) { return x[0][i] * x[1][j] - x[0][j] * x[1][i]; };
  return minor(1, 2) * x[2][0] + minor(2, 0) * x[2][1] + minor(0, 1) * x[2][2];
}

}  // namespace margins
}  // namespace test
}  // namespace dccd
