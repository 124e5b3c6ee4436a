// Half-spaces of ~limits: between what stands so simply that they can be worked out.
#include "dccd/approach_limits.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "support/closed_meshes.h"
#include "support/said.h"

namespace dccd {
namespace test {
namespace {

constexpr double CELL_M = 0.05, NEAR_M = 0.4, LIMITS_S = 0.2;

/// A tool whose lower side is 0.1 m above a table of voxels, and a pad 0.2 m to its right.
struct ToolOverTable {
  Step step;
  Options options;
  std::vector<SpeedBound> bounds{{1}, {0.3}};
  ToolOverTable() {
    TestStep scene;
    scene.bodies = {box({0, 0, 0.1}, {0.1, 0.1, 0.2}), box({0.3, 0, 0.1}, {0.4, 0.1, 0.2})};
    step = scene.motion();
    step.bodies[0].name = "tool";
    step.bodies[1].name = "pad";
    step.bodies[0].rigid = true;
    std::vector<OccupiedLeaf> leaves;
    const auto key = [](int k) { return static_cast<std::uint16_t>(32768 + k); };
    for (int x = -9; x < 9; ++x)
      for (int y = -9; y < 9; ++y) leaves.push_back({{key(x), key(y), key(-1)}, 1});
    step.map.surface = VoxelSurface::build(CELL_M, leaves);
    options.clearance.wanted = true;
  }
  ApproachLimits run(double max_m = NEAR_M) {
    History history;
    ApproachSearch search;
    return search.run(detect(step, options, history), options, bounds, max_m, LIMITS_S);
  }
};

TEST(ApproachLimits, LeaveWhatIsBetweenLessThePartnersBound) {
  const ApproachLimits limits = ToolOverTable().run();
  EXPECT_TRUE(limits.unknown.empty());
  EXPECT_EQ(limits.bodies, std::vector<std::uint16_t>{0});
  EXPECT_NEAR(limits.most_speed_m_s, NEAR_M / LIMITS_S - 0.3, 1e-6);
  ASSERT_EQ(limits.of.size(), 2u);
  for (const ApproachLimit& limit : limits.of) {
    const bool down = limit.partner == OBSTACLE_BODY;
    EXPECT_TRUE(limit.normal.isApprox(down ? Vec3(-Vec3::UnitZ()) : Vec3(Vec3::UnitX()), 1e-6)) << limit.normal;
    EXPECT_NEAR(limit.speed_m_s, down ? 0.1 / LIMITS_S : 0.2 / LIMITS_S - 0.3, 1e-6);
    EXPECT_LE(limit.speed_m_s, down ? 0.1 / LIMITS_S : 0.2 / LIMITS_S - 0.3);
    Eigen::AlignedBox3d all;
    for (const Vec3& corner : limit.corner) all.extend(corner);
    EXPECT_TRUE(all.isApprox({Vec3(0, 0, 0.1), Vec3(0.1, 0.1, 0.2)}, 1e-9));
  }
  EXPECT_EQ(ToolOverTable().run(0.15).of.size(), 1u) << "what is beyond max_m the fastest speed keeps away";
}

TEST(ApproachLimits, CountWhatASensorSawTooSeldom) {
  ToolOverTable over;
  over.step.map.own.seen = share(std::vector<OccupiedLeaf>{{{32769, 32769, 32768}, 1}});  // 0.05 m below the tool
  const ApproachLimits limits = over.run();
  double slowest_m_s = NEAR_M;
  for (const ApproachLimit& limit : limits.of)
    if (limit.partner == OBSTACLE_BODY) slowest_m_s = std::min(slowest_m_s, limit.speed_m_s);
  EXPECT_LE(slowest_m_s, 0.05 / LIMITS_S);
  EXPECT_NEAR(slowest_m_s, 0.05 / LIMITS_S, 1e-6);
}

TEST(ApproachLimits, HoldInTheFixedFrameWhereTheMapIsTurned) {
  ToolOverTable turned;
  const Eigen::Isometry3d moved(Eigen::Translation3d(1, 2, 3) * Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()));
  turned.step.map.map_from_fixed = moved.inverse();
  for (Body& body : turned.step.bodies) {
    Positions at = *body.t1;
    for (Vec3& p : at) p = moved * p;
    body.t0 = body.t1 = share(at);
    body.pose_t0 = body.pose_t1 = moved;
  }
  const ApproachLimits limits = turned.run();
  ASSERT_GE(limits.of.size(), 2u);
  for (const ApproachLimit& limit : limits.of) {
    if (limit.partner != OBSTACLE_BODY) continue;
    EXPECT_TRUE(limit.normal.isApprox(moved.linear() * -Vec3::UnitZ(), 1e-6));
    EXPECT_NEAR(limit.speed_m_s, 0.1 / LIMITS_S, 1e-6);
  }
}

TEST(ApproachLimits, OfWhatNobodyKnowsTheySaySo) {
  ToolOverTable none;
  none.bounds[1].max_m_s = SpeedBound::NONE;
  EXPECT_EQ(none.run().unknown, std::vector<std::string>{"no speed bound is known of body 'pad'"});
  ToolOverTable touches;
  for (Body& body : touches.step.bodies) {
    Positions at = *body.t1;
    for (Vec3& p : at) p.z() -= 0.1;
    body.t0 = body.t1 = share(at);
    body.against_obstacle = body.name == "tool";
  }
  ASSERT_EQ(touches.run().unknown.size(), 1u);
  EXPECT_TRUE(mentions(touches.run().unknown[0], "'tool' and octomap"));
  ToolOverTable fast;
  fast.bounds[1].max_m_s = 3;
  EXPECT_TRUE(mentions(fast.run().unknown.at(0), "may come from beyond limits/max_m"));
  ToolOverTable unproved;
  unproved.step.bodies[1].dropped_faces = 1;
  EXPECT_FALSE(unproved.run().unknown.empty());
  EXPECT_TRUE(unproved.run().of.empty());
}

}  // namespace
}  // namespace test
}  // namespace dccd
