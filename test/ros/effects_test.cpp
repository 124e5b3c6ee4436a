// Effects through the live node: separations of bodies and of pairs, and distances.
#include <deformable_ccd/ClearanceArray.h>
#include <deformable_ccd/ContactArray.h>
#include <deformable_ccd/State.h>

#include <cmath>

#include <gtest/gtest.h>
#include <ros/ros.h>

#include "ros/support/effects.h"
#include "ros/support/live_tests.h"
#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {
namespace {

// --- separations -----------------------------------------------------------------------------------------------------

struct Felt : MonitorTest {
  Felt() : MonitorTest("/felt") {}
  ros::Publisher felt = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/felt/felt");
  ros::Publisher tip = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/felt/tip");

  deformable_ccd::ContactArray sendBoth(double tip_z, double stamp_s) {
    const std::size_t seen = contacts.count();
    const Mesh mesh{{{0.2, 0.2, tip_z}, {0.7, 0.2, tip_z + 1}, {-0.3, 0.2, tip_z + 1}}, {{0, 1, 2}}};
    tip.publish(meshStamped(mesh, stamp_s));
    felt.publish(cloud(gridAt(4, 4, 0), stamp_s));
    return contacts.after(seen);
  }
};

// The first case of this monitor: it has not had any frame yet.
TEST_F(Felt, APlanIsThereBeforeTheFirstFrameAndStaysWhileNothingChanges) {
  Probe<diagnostic_msgs::DiagnosticArray> effects(node, "/felt/effects");
  ASSERT_TRUE(waitUntil([&] { return effects.count() > 0; })) << "before any frame";
  const std::size_t before = effects.count();
  EXPECT_EQ(effectIn(effects.last(), "minimum_separation").reason, "contacts are reported from 0.12 m");
  sendBoth(1, 10);
  sendBoth(0.9, 10.1);
  for (int i = 0; i < 5; ++i) sendBoth(0.9, 10.2 + 0.1 * i);
  ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(10.6); }));
  EXPECT_EQ(effects.count(), before) << "frames alone change nothing";
}

TEST_F(Felt, WhatIsLeftOutIsCounted) {
  sendBoth(1, 10);
  sendBoth(0.9, 10.1);
  ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(10.1); }));
  EXPECT_GT(stats.last().left_out_met, 0u);
}

// --- distances -------------------------------------------------------------------------------------------------------

struct Apart : MonitorTest {
  Apart() : MonitorTest("/apart") {}
  ros::Publisher mesh = advertiseAndWait<sensor_msgs::PointCloud2>(node, "/apart/mesh");
  ros::Publisher map = advertiseAndWait<octomap_msgs::Octomap>(node, "/apart/octomap", true);
  Probe<diagnostic_msgs::DiagnosticArray> effects{node, "/apart/effects"};
  Probe<deformable_ccd::State> state{node, "/apart/state"};

  bool running() { return effectIn(effects.last(), "clearance").running; }
  std::uint64_t clearancesAsked() {
    for (const deformable_ccd::StageStats& row : stats.last().stages) {
      if (row.name == "clearance") return row.count_in;
    }
    return 0;
  }
  /// The state after a step between two heights above the map.
  deformable_ccd::State fall(double from_z, double to_z, double end_s) {
    map.publish(blockBelowZero(true));
    double stamp_s = end_s - 40;
    EXPECT_TRUE(waitUntil([&] {
      const deformable_ccd::ContactArray outcome = send(mesh, cloud(gridAt(3, 4, from_z), stamp_s += 0.1));
      return outcome.answered && outcome.status != deformable_ccd::ContactArray::NO_MAP;
    }));
    send(mesh, cloud(gridAt(3, 4, from_z), end_s - 0.25));
    send(mesh, cloud(gridAt(3, 4, to_z), end_s));
    EXPECT_TRUE(waitUntil([&] { return state.last().holds_until == ros::Time(end_s); }));
    return state.last();
  }
};

/// The row of the cloth and the map.
deformable_ccd::Clearance withMap(const deformable_ccd::ClearanceArray& distances) {
  for (const deformable_ccd::Clearance& pair : distances.pairs) {
    if (pair.bodies[1] == "octomap") return pair;
  }
  ADD_FAILURE() << "no row of the map";
  return {};
}

TEST_F(Apart, DistancesAreMeasuredWhileSomebodyListens) {
  EXPECT_FALSE(running());
  EXPECT_TRUE(std::isnan(fall(1, 0.75, 50).clearance_lower));
  EXPECT_EQ(clearancesAsked(), 0u);
  {
    Probe<deformable_ccd::ClearanceArray> distances(node, "/apart/clearance");
    ASSERT_TRUE(waitUntil([&] { return running(); }));
    const deformable_ccd::State said = fall(0.75, 0.5, 100);
    EXPECT_EQ(said.clearance_between, "mesh and octomap");
    EXPECT_LE(said.clearance_lower, 0.5);
    EXPECT_GE(said.clearance_upper, 0.5);
    ASSERT_TRUE(waitUntil([&] { return distances.last().header.stamp == ros::Time(100); }));
    const deformable_ccd::Clearance pair = withMap(distances.last());
    EXPECT_EQ(pair.bodies[0], "mesh");
    EXPECT_EQ(pair.at_end.status, deformable_ccd::ClearanceDistance::MEASURED);
    EXPECT_LE(pair.at_end.lower, 0.5);
    EXPECT_GE(pair.at_end.upper, 0.5);
    EXPECT_NEAR(pair.closing_speed, 1, 1e-6) << "0.25 m in 0.25 s";
    ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(100); }));
    EXPECT_GE(clearancesAsked(), 1u);
  }
  EXPECT_TRUE(waitUntil([&] { return !running(); })) << "the subscriber has gone";
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "effects_test"); }
