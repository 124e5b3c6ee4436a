#include "report/flat_layout.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>
#include <Eigen/Geometry>

namespace dccd {
namespace {

/// 3 x 4 points, 0.1 m apart, somewhere and somehow in space.
Positions tiltedGrid() {
  const Eigen::Quaterniond turn = Eigen::Quaterniond(0.3, -0.5, 0.8, 0.2).normalized();
  Positions positions;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c) positions.push_back(turn * Vec3(0.1 * c, 0.1 * r, 0) + Vec3(5, -3, 1));
  }
  return positions;
}

double distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1]);
}

TEST(FlatLayout, KeepsDistancesAndLiesAlongThePage) {
  const Positions positions = tiltedGrid();
  const auto flat = flatLayout(positions);
  ASSERT_EQ(flat.size(), positions.size());
  double low = 0, high = 0;
  for (std::size_t i = 0; i < flat.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      EXPECT_NEAR(distance(flat[i], flat[j]), (positions[i] - positions[j]).norm(), 1e-5);
    }
    low = std::min(low, flat[i][1]);
    high = std::max(high, flat[i][1]);
  }
  EXPECT_NEAR(high - low, 0.2, 2e-3) << "the short side is upright, within a degree";
}

TEST(FlatLayout, IsNotMirroredSeenFromAbove) {
  Positions positions = tiltedGrid();
  const Vec3 up = (positions[1] - positions[0]).cross(positions[4] - positions[0]).normalized();
  positions.push_back(positions[5] + 0.03 * up);
  const auto flat = flatLayout(positions);
  const auto at = [&](std::size_t i) { return Vec3(flat[i][0], flat[i][1], flat[i][2]); };
  for (std::size_t i = 0; i < flat.size(); ++i) {
    EXPECT_NEAR((at(i) - at(0)).norm(), (positions[i] - positions[0]).norm(), 1e-5)
        << "with heights it is the same body";
  }
  EXPECT_GT((at(1) - at(0)).cross(at(4) - at(0)).dot(at(12) - at(5)), 0) << "and no mirror image of it";
}

TEST(FlatLayout, WhatIsNotFiniteIsNoPlace) {
  Positions positions = tiltedGrid();
  positions[5].y() = std::numeric_limits<double>::quiet_NaN();
  for (const auto& point : flatLayout(positions)) {
    EXPECT_TRUE(std::isfinite(point[0]) && std::isfinite(point[1]) && std::isfinite(point[2]));
  }
  EXPECT_TRUE(flatLayout({}).empty());
}

}  // namespace
}  // namespace dccd
