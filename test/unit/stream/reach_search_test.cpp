// What bodies reach: rigid ones alike in their own frame and in the map's, others against points all over their faces.
#include "stream/reach_search.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <utility>

#include "support/closed_meshes.h"
#include "support/heap.h"
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
      cubes.push_back({leaf, ReachedCube::Why::APPEARED, leafBox(leaf, VOXEL_M)});
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
      EXPECT_EQ(std::vector<std::uint16_t>(direct[i].near.begin(), direct[i].near.end()),
                std::vector<std::uint16_t>(kept[i].near.begin(), kept[i].near.end()))
          << "cube " << i;
      reached += !direct[i].near.empty();
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

/// How far a cube is from a face at most, by points all over the face.
double distanceTo(const LeafBox& box, const std::array<Vec3, 3>& t) {
  constexpr int PARTS = 12;
  const Eigen::Map<const Vec3> lo(box.lo), hi(box.hi);
  double least = std::numeric_limits<double>::infinity();
  for (int i = 0; i <= PARTS; ++i) {
    for (int j = 0; i + j <= PARTS; ++j) {
      const Vec3 p = t[0] + (t[1] - t[0]) * i / PARTS + (t[2] - t[0]) * j / PARTS;
      least = std::min(least, (p.cwiseMax(lo).cwiseMin(hi) - p).norm());
    }
  }
  return least;
}

TEST_F(ReachSearch, OfACloth) {
  const StepBody cloth = sheet(6, 7, {-0.5, -0.5, 0}, 0.15);
  const double reach_m = 0.12, part_m = 0.02;  // of the points on a face, and of the places
  std::size_t reached = 0, not_reached = 0;
  for (int round = 0; round < 12; ++round) {
    const Moved body = moved(0, cloth, reach_m);
    const auto frame = [&](const Eigen::Isometry3d& pose) {
      MeshFrame frame{0, body.topology, body.points, false};
      for (Vec3& p : frame.positions) p = pose * p + vector(0.05);
      return share(std::move(frame));
    };
    const Eigen::Isometry3d from = pose(0.5, 3);
    const BodyWay way{{frame(from), frame(from * pose(0.15, 0.3)), 0, 1}};
    std::vector<ReachedCube> found = cubes(300);
    const bool whole_way = round % 4 == 0;
    searchReach({body.tracked}, {way}, Eigen::Isometry3d::Identity(), VOXEL_M, found, &shapes_, whole_way);
    std::vector<double> least(found.size(), std::numeric_limits<double>::infinity()), most(found.size());
    for (int place = 0; place <= 20; ++place) {
      Positions at = way[0].from->positions;
      for (std::size_t v = 0; v < at.size(); ++v) at[v] += (way[0].to->positions[v] - at[v]) * place / 20;
      for (std::size_t i = 0; i < found.size(); ++i) {
        double here = std::numeric_limits<double>::infinity();
        for (const Face& f : body.topology->faces())
          here = std::min(here, distanceTo(found[i].box, {at[f[0]], at[f[1]], at[f[2]]}));
        least[i] = std::min(least[i], here);
        most[i] = std::max(most[i], here);
      }
    }
    for (std::size_t i = 0; i < found.size(); ++i) {
      const bool is_near = !found[i].near.empty();
      if (least[i] <= reach_m - 0.25 * VOXEL_M) EXPECT_TRUE(is_near) << round << " " << i << ": " << least[i];
      if (least[i] > reach_m + part_m) EXPECT_FALSE(is_near) << round << " " << i << ": " << least[i];
      if (whole_way && most[i] <= reach_m) EXPECT_FALSE(found[i].always.empty()) << round << " " << i;
      if (whole_way && most[i] > reach_m + 0.25 * VOXEL_M + part_m)
        EXPECT_TRUE(found[i].always.empty()) << round << " " << i;
      reached += is_near;
      not_reached += !is_near;
    }
    ASSERT_FALSE(HasFailure());
  }
  EXPECT_GT(reached, 100U);
  EXPECT_GT(not_reached, 1000U);
}

/// Faces of a crumpled sheet as large as all that is asked for: in each of a million cells they were all listed.
TEST_F(ReachSearch, LargeBoxesTakeLittleMemory) {
  std::vector<Eigen::AlignedBox3d> boxes;
  for (int i = 0; i < 2000; ++i) boxes.push_back(Eigen::AlignedBox3d(vector(5)).extend(vector(5)));
  struct Box {
    Vec3 lo, hi;
  };
  BoxGrid grid;
  const std::size_t before = heapInUse();
  grid.build(boxes.size(), VOXEL_M, [&](std::size_t i) { return Box{boxes[i].min(), boxes[i].max()}; });
  EXPECT_LT(heapInUse(), before + (std::size_t{8} << 20));
  for (int round = 0; round < 100; ++round) {
    const Eigen::AlignedBox3d asked = Eigen::AlignedBox3d(vector(6)).extend(vector(6));
    std::vector<bool> seen(boxes.size());
    grid.visit(asked.min().data(), asked.max().data(), [&](std::uint32_t i) { seen[i] = true; });
    for (std::size_t i = 0; i < boxes.size(); ++i) EXPECT_LE(asked.intersects(boxes[i]), seen[i]) << round << " " << i;
  }
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
