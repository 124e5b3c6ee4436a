// Surfaces that fold in one part of them only.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "dccd/types.h"

namespace dccd {
namespace test {

/// A sheet of which the last part, a share of it, is rolled back over the rest by `turn`, around a cylinder.
inline Positions rolled(std::size_t side, double turn, double radius = 0.02, double share = 0.2) {
  Positions x;
  for (std::size_t r = 0; r < side; ++r) {
    for (std::size_t k = 0; k < side; ++k) {
      const double s = static_cast<double>(k) / static_cast<double>(side - 1), beyond = std::max(0.0, s - (1 - share));
      const double angle = std::min(beyond / radius, turn), left = beyond - angle * radius;
      x.emplace_back(s - beyond + radius * std::sin(angle) + left * std::cos(angle),
                     static_cast<double>(r) / static_cast<double>(side - 1),
                     radius * (1 - std::cos(angle)) + left * std::sin(angle));
    }
  }
  return x;
}

}  // namespace test
}  // namespace dccd
