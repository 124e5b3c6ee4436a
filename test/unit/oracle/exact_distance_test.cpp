#include "oracle/exact_distance.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <random>

namespace dccd {
namespace test {
namespace {

PairMotion atRest(const double (&points)[4][3]) {
  PairMotion pair;
  for (auto& time : pair.x) std::copy(&points[0][0], &points[0][0] + 12, &time[0][0]);
  return pair;
}

TEST(ExactDistance, KnownConfigurations) {
  using Kind = PairKind;
  const double above[4][3] = {{0.25, 0.25, 3}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(squaredDistanceAt(Kind::VERTEX_FACE, atRest(above), 0.5), 9);
  const double beside[4][3] = {{2, 2, 0}, {0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  EXPECT_EQ(squaredDistanceAt(Kind::VERTEX_FACE, atRest(beside), 0), Rational(9, 2));
  const double point_triangle[4][3] = {{0, 3, 4}, {0, 0, 0}, {0, 0, 0}, {0, 0, 0}};
  EXPECT_EQ(squaredDistanceAt(Kind::VERTEX_FACE, atRest(point_triangle), 1), 25);
  const double crossing[4][3] = {{-1, 0, 0}, {1, 0, 0}, {0, -1, 2}, {0, 1, 2}};
  EXPECT_EQ(squaredDistanceAt(Kind::EDGE_EDGE, atRest(crossing), 0), 4);
  const double parallel[4][3] = {{0, 0, 0}, {1, 0, 0}, {3, 0, 0}, {2, 0, 0}};
  EXPECT_EQ(squaredDistanceAt(Kind::EDGE_EDGE, atRest(parallel), 0), 1);
  const double apart[4][3] = {{0, 0, 0}, {1, 0, 0}, {2, 1, 0}, {2, -1, 1}};
  EXPECT_EQ(squaredDistanceAt(Kind::EDGE_EDGE, atRest(apart), 0), Rational(6, 5));
}

TEST(ExactDistance, FollowsTheMotionExactly) {
  PairMotion pair{};
  pair.x[0][0][2] = 1;  // from 1 above to 2 below a triangle of no size at the origin
  pair.x[1][0][2] = -2;
  EXPECT_EQ(squaredDistanceAt(PairKind::VERTEX_FACE, pair, 0.25), Rational(1, 16));
  EXPECT_TRUE(isWithin(PairKind::VERTEX_FACE, pair, 0.25, 0.25));
  EXPECT_FALSE(isWithin(PairKind::VERTEX_FACE, pair, std::nextafter(0.25, 0.0), 0.25));
}

// No sampled pair of points is closer, and a fine sample comes near: an upper and a lower bound that share nothing.
TEST(ExactDistance, AgreesWithSampling) {
  std::mt19937 random(3);
  std::uniform_int_distribution<int> coordinate(-4, 4);
  constexpr int STEPS = 40;
  for (int round = 0; round < 60; ++round) {
    double points[4][3];
    for (auto& point : points) {
      for (double& value : point) value = coordinate(random);
    }
    const Eigen::Map<const Eigen::Vector3d> p0(points[0]), p1(points[1]), p2(points[2]), p3(points[3]);
    double vertex_face = 1e9, edge_edge = 1e9;
    for (int i = 0; i <= STEPS; ++i) {
      for (int j = 0; j <= STEPS; ++j) {
        const double s = double(i) / STEPS, r = double(j) / STEPS;
        edge_edge = std::min(edge_edge, (p0 + s * (p1 - p0) - p2 - r * (p3 - p2)).norm());
        if (s + r <= 1) vertex_face = std::min(vertex_face, (p1 + s * (p2 - p1) + r * (p3 - p1) - p0).norm());
      }
    }
    const double slack = 8 * std::sqrt(3.0) * 2 / STEPS;
    const auto exact = [&](PairKind kind) {
      return std::sqrt(static_cast<double>(squaredDistanceAt(kind, atRest(points), 0)));
    };
    EXPECT_LE(exact(PairKind::VERTEX_FACE), vertex_face + 1e-9);
    EXPECT_GE(exact(PairKind::VERTEX_FACE), vertex_face - slack);
    EXPECT_LE(exact(PairKind::EDGE_EDGE), edge_edge + 1e-9);
    EXPECT_GE(exact(PairKind::EDGE_EDGE), edge_edge - slack);
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
