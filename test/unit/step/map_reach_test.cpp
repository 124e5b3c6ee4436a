// A body whose bounds do not reach the map's is not looked at: none is left out that touches it by a last bit, however
// its map lies, nor one that comes within a separation or an uncertainty.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

struct AtAVoxel : testing::Test {
  std::shared_ptr<const VoxelSurface> map;
  std::mt19937_64 random{11};
  AtAVoxel() {
    OccupiedLeaf leaf;
    leaf.min = {32770, 32771, 32769};
    map = VoxelSurface::build(0.1, {leaf});
  }
  double draw(double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); }

  Eigen::Isometry3d anyPose(double offset_m) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    const Eigen::Quaterniond turn(draw(-1, 1), draw(-1, 1), draw(-1, 1), draw(-1, 1));
    pose.linear() = turn.normalized().toRotationMatrix();
    pose.translation() = Vec3(draw(-1, 1), draw(-1, 1), draw(-1, 1)) * offset_m;
    return pose;
  }
  /// A triangle, in the fixed frame, whose first vertex is placed as near as doubles come to `beside_m` beside the
  /// middle of a face of the voxel, and whose others are farther out; at t0 all of it is.
  std::array<Positions, 2> triangle(const Eigen::Isometry3d& pose, double beside_m) {
    const Vec3 lo = map->bounds().min, hi = map->bounds().max, middle = 0.5 * (lo + hi);
    const int axis = static_cast<int>(random() % 3);
    const double side = random() % 2 ? 1 : -1;
    Vec3 tip = middle;
    tip[axis] = (side > 0 ? hi : lo)[axis] + side * beside_m;
    Vec3 out = Vec3::Zero();
    out[axis] = side;
    const Vec3 across(out[1], out[2], out[0]);
    const Eigen::Isometry3d back = pose.inverse();
    std::array<Positions, 2> at;
    for (int t = 0; t < 2; ++t) {
      const Vec3 away = (t == 0 ? 0.3 : 0.0) * out;
      at[t] = {back * (tip + away), back * (tip + 0.2 * out + 0.1 * across + away),
               back * (tip + 0.2 * out - 0.1 * across + away)};
    }
    return at;
  }
  /// Contacts of the step, which are those of the triangle where its vertices are placed, looked at without bounds.
  std::size_t contacts(const Eigen::Isometry3d& pose, const std::array<Positions, 2>& at, double separation_m,
                       double radius_m) {
    Body body;
    body.name = "triangle";
    body.topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
    body.minimum_separation_m = separation_m;
    const std::vector<double> radii{radius_m, radius_m / 2, 0};
    Step step = stepOf(body, at[0], at[1], radius_m > 0 ? &radii : nullptr);
    step.map.surface = map;
    step.map.map_from_fixed = pose;
    Options options;
    options.check_start_state = false;
    ObstacleOptions direct;
    if (separation_m + radius_m > 0) options.accuracy.rung = Accuracy::CONSERVATIVE;
    direct.accuracy = options.accuracy;
    direct.minimum_separation_m = separation_m;
    History history;
    const Outcome outcome = detect(step, options, history);
    std::array<Positions, 2> placed = at;
    for (Positions& positions : placed) {
      for (Vec3& p : positions) p = Eigen::Matrix3d(pose.linear()) * p + Vec3(pose.translation());
    }
    ObstacleQuery query{*map, *body.topology, placed[0], placed[1]};
    if (radius_m > 0) query.vertex_radius_m = radii.data();
    std::vector<Contact> expected;
    ObstacleStats stats;
    ObstacleCheck(direct).run(query, expected, stats);
    EXPECT_EQ(difference(outcome.contacts, expected), "");
    return outcome.contacts.size();
  }
};

TEST_F(AtAVoxel, WhatTouchesByALastBitIsFound) {
  for (const double offset_m : {0.0, 1.0, 1000.0}) {
    std::size_t touching = 0;
    for (int i = 0; i < 3000 && !HasFailure(); ++i) {
      const Eigen::Isometry3d pose = anyPose(offset_m);
      touching += contacts(pose, triangle(pose, 0), 0, 0) > 0;
    }
    EXPECT_GT(touching, 800u) << "of 3000, with the map up to " << offset_m << " m away";
    EXPECT_LT(touching, 2900u);
  }
}

TEST_F(AtAVoxel, ASeparationAndAnUncertaintyReachFarther) {
  for (const auto& [separation_m, radius_m] : {std::pair{0.01, 0.0}, {0.0, 0.02}, {0.01, 0.02}}) {
    std::size_t touching = 0;
    for (int i = 0; i < 1000 && !HasFailure(); ++i) {
      const Eigen::Isometry3d pose = anyPose(1);
      const double beside_m = (separation_m + radius_m) * (i % 2 ? 1 : draw(0.9, 1.1));
      touching += contacts(pose, triangle(pose, beside_m), separation_m, radius_m) > 0;
    }
    EXPECT_GT(touching, 300u) << separation_m << " m, " << radius_m << " m";
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
