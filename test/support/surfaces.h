// Surfaces that fold in one part of them only, or are no disk.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "dccd/topology.h"

namespace dccd {
namespace test {

/// A grid whose columns go round and meet again.
inline Topology tube(std::size_t rings, std::size_t around) {
  std::vector<Face> faces;
  for (std::size_t r = 0; r + 1 < rings; ++r) {
    for (std::size_t k = 0; k < around; ++k) {
      const Index a = static_cast<Index>(r * around + k), b = static_cast<Index>(r * around + (k + 1) % around);
      const Index c = static_cast<Index>(a + around), d = static_cast<Index>(b + around);
      faces.push_back({a, c, b});
      faces.push_back({b, c, d});
    }
  }
  return Topology::fromTriangles(rings * around, faces);
}

inline Positions tubeAt(std::size_t rings, std::size_t around, double bend) {
  Positions x;
  for (std::size_t r = 0; r < rings; ++r) {
    for (std::size_t k = 0; k < around; ++k) {
      const double along = 4.0 * static_cast<double>(r) / static_cast<double>(rings);
      const double angle = 2 * M_PI * static_cast<double>(k) / static_cast<double>(around);
      const double far = 1 / bend - std::cos(angle);
      x.emplace_back(1 / bend - far * std::cos(along * bend), std::sin(angle), far * std::sin(along * bend));
    }
  }
  return x;
}

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
