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

/// Two layers of cloth in the outline of a palm and four fingers, sewn together around it but for the wrist, and
/// filled.
struct Glove {
  Topology topology;
  Positions positions;

  explicit Glove(std::size_t side) {
    const std::size_t palm = side / 2, finger = side / 4, gap = std::max<std::size_t>(side / 16, 2);
    const auto isCloth = [&](std::size_t r, std::size_t k) {
      return r < side && k < side && (r < palm || k % finger + gap < finger);
    };
    const auto isQuad = [&](std::size_t r, std::size_t k) {
      return isCloth(r, k) && isCloth(r + 1, k) && isCloth(r, k + 1) && isCloth(r + 1, k + 1);
    };
    std::vector<Index> front(side * side, 0), back(side * side, 0);
    std::vector<Vec3> seam;
    const auto isSeam = [&](std::size_t r, std::size_t k) {
      const bool wrist = r == 0, left = k == 0, below = !wrist && isQuad(r - 1, k), above = isQuad(r, k);
      const bool below_left = !wrist && !left && isQuad(r - 1, k - 1), above_left = !left && isQuad(r, k - 1);
      return !above || !above_left || (!wrist && (!below || !below_left));
    };
    for (std::size_t v = 0; v < side * side; ++v) {
      if (isCloth(v / side, v % side) && isSeam(v / side, v % side)) {
        seam.emplace_back(static_cast<double>(v % side), static_cast<double>(v / side), 0);
      }
    }
    const double thick = static_cast<double>(finger - gap) / 2;
    for (std::size_t v = 0; v < side * side; ++v) {
      if (!isCloth(v / side, v % side)) continue;
      const Vec3 at(static_cast<double>(v % side), static_cast<double>(v / side), 0);
      double from_seam = thick;
      for (const Vec3& s : seam) from_seam = std::min(from_seam, (at - s).norm());
      const double height = 0.7 * std::sqrt(from_seam * (2 * thick - from_seam));
      front[v] = back[v] = static_cast<Index>(positions.size());
      positions.push_back((at + Vec3(0, 0, height)) / static_cast<double>(side));
      if (isSeam(v / side, v % side)) continue;
      back[v] = static_cast<Index>(positions.size());
      positions.push_back((at - Vec3(0, 0, height)) / static_cast<double>(side));
    }
    std::vector<Face> faces;
    for (std::size_t v = 0; v < side * side; ++v) {
      if (!isQuad(v / side, v % side)) continue;
      const std::size_t right = v + 1, up = v + side, across = up + 1;
      faces.push_back({front[v], front[right], front[up]});
      faces.push_back({front[up], front[right], front[across]});
      faces.push_back({back[v], back[up], back[right]});
      faces.push_back({back[up], back[across], back[right]});
    }
    topology = Topology::fromTriangles(positions.size(), faces);
  }
  /// Its fingers curl by so many radians.
  Positions curled(double turn) const {
    Positions x = positions;
    for (Vec3& p : x) {
      const double angle = turn * p.y(), radius = turn == 0 ? 0 : 1 / turn;
      if (turn != 0) p = {p.x(), (radius - p.z()) * std::sin(angle), radius - (radius - p.z()) * std::cos(angle)};
    }
    return x;
  }
};

}  // namespace test
}  // namespace dccd
