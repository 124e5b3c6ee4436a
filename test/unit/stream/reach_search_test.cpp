// What rigid bodies reach is the same whether each face asks for cubes, or each cube, in the body's frame, for faces.
#include "stream/reach_search.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <utility>

#include "support/closed_meshes.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

constexpr double VOXEL_M = 0.1;

class ReachSearch : public ::testing::Test {
 protected:
  std::mt19937 random_{7};
  RigidShapes shapes_;

  double between(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  Vec3 vector(double size) { return {between(-size, size), between(-size, size), between(-size, size)}; }
  Eigen::Isometry3d pose(double size_m, double turn) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    pose.linear() = Eigen::AngleAxisd(between(-turn, turn), vector(1).normalized()).toRotationMatrix();
    pose.translation() = vector(size_m);
    return pose;
  }

  std::vector<ReachedCube> cubes(std::size_t count) {
    std::vector<ReachedCube> cubes;
    for (std::size_t i = 0; i < count; ++i) {
      const int size = i % 5 == 0 ? 4 : 1;
      const auto key = [&] { return size * static_cast<int>(std::floor(between(-14, 14) / size)); };
      const OccupiedLeaf leaf = voxelAt(key(), key(), key(), static_cast<std::uint32_t>(size));
      cubes.push_back({leaf, ReachedCube::Why::APPEARED, leafBox(leaf, VOXEL_M), -1});
    }
    return cubes;
  }

  /// A body on a way of two frames.
  struct Moved {
    std::shared_ptr<const Topology> topology;
    Positions points;
    TrackedBody tracked;
  };
  Moved moved(std::uint16_t number, const StepBody& body, double reach_m, bool shell = false) {
    return {share(Topology(body.topology)), body.t0, {number, "one", reach_m, nullptr, false, shell}};
  }
  static std::shared_ptr<const MeshFrame> frameAt(const Moved& body, const Eigen::Isometry3d& pose) {
    MeshFrame frame{0, body.topology, body.points, true, pose};
    for (Vec3& p : frame.positions) p = pose * p;
    return share(std::move(frame));
  }

  /// The number of cubes that some body reaches, where both ways say the same.
  std::size_t compare(const std::vector<Moved>& bodies, const std::vector<BodyWay>& ways) {
    std::vector<TrackedBody> tracked;
    for (const Moved& body : bodies) tracked.push_back(body.tracked);
    const Eigen::Isometry3d map_from_fixed = pose(0.3, 3);
    std::vector<ReachedCube> direct = cubes(800), kept = direct;
    searchReach(tracked, ways, map_from_fixed, VOXEL_M, direct, nullptr);
    searchReach(tracked, ways, map_from_fixed, VOXEL_M, kept, &shapes_);
    std::size_t reached = 0;
    for (std::size_t i = 0; i < direct.size(); ++i) {
      EXPECT_EQ(direct[i].body, kept[i].body) << "cube " << i;
      reached += direct[i].body >= 0;
    }
    return reached;
  }
  BodyWay wayOf(const Moved& body, const Eigen::Isometry3d& from, const Eigen::Isometry3d& to) {
    return {{frameAt(body, from), frameAt(body, to), between(0, 0.4), 1}};
  }
};

TEST_F(ReachSearch, IsTheSameInTheBodysFrame) {
  const StepBody shells = together(ball(Vec3::Zero(), 0.7, 3), ball({0.1, 0, 0}, 0.3, 2));
  const StepBody parts = together(box({-0.9, -0.2, -0.1}, {0.6, 0.15, 0.12}), sheet(4, 5, {-0.4, 0.3, 0.2}, 0.2));
  std::vector<Moved> bodies{moved(0, ball({0.2, 0.1, 0}, 0.6, 3), 0.1), moved(1, shells, 0.05),
                            moved(2, shells, 0.1, true), moved(3, parts, 0.15)};
  std::size_t reached = 0;
  for (int round = 0; round < 40; ++round) {
    std::vector<BodyWay> ways;
    for (const Moved& body : bodies) {
      const Eigen::Isometry3d from = pose(0.6, 3);
      ways.push_back(wayOf(body, from, round % 3 == 0 ? from : from * pose(0.2, 0.4)));
    }
    reached += compare(bodies, ways);
    ASSERT_FALSE(HasFailure()) << "round " << round;
    // Another body under the same number: what was kept of the one before is not for it.
    if (round % 10 == 4) {
      for (Vec3& p : bodies[0].points) p *= 1.1;
    }
  }
  EXPECT_GT(reached, 2000U);
}

TEST_F(ReachSearch, ABodyThatIsNowhereReachesNothing) {
  const Moved body = moved(0, ball(Vec3::Zero(), 0.6, 3), 0.1);
  EXPECT_GT(compare({body}, {wayOf(body, pose(0.1, 1), pose(0.1, 1))}), 0U);
  MeshFrame lost = *frameAt(body, pose(0.1, 1));
  for (Vec3& p : lost.positions) p.setConstant(std::numeric_limits<double>::quiet_NaN());
  const auto frame = share(std::move(lost));
  EXPECT_EQ(compare({body}, {{{frame, frame, 0, 1}}}), 0U);
  EXPECT_GT(compare({body}, {wayOf(body, pose(0.1, 1), pose(0.1, 1))}), 0U);
}

/// Where a map's coordinates are so large that no face says what it reaches, none is reached either way.
TEST_F(ReachSearch, AReachBelowRoundingReachesNothing) {
  const Moved body = moved(0, ball({0.01, 0, 0}, 0.6, 3), 1e-15);
  EXPECT_GT(compare({body}, {wayOf(body, pose(0.1, 1), pose(0.1, 1))}), 0U) << "but for what is inside";
}

}  // namespace
}  // namespace test
}  // namespace dccd
