// The map of a monitor: missed where one is expected, too old, in a frame of its own, with voxels that are excluded.
#include <gtest/gtest.h>

#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

TEST_F(OneBody, MapIsMissedOnlyWhenExpected) {
  feed(pair(0, 1));
  EXPECT_EQ(feed(pair(10 * MS, 0.9)).status, StepStatus::OK);
  MonitorOptions options = loose();
  options.detector.obstacle_expected = true;
  monitor.setOptions(options);
  const Outcome none = feed(pair(20 * MS, 0.8));
  EXPECT_EQ(none.status, StepStatus::NO_MAP);
  EXPECT_FALSE(assuranceOf(none).clear());
  monitor.setMap({VoxelSurface::build(0.1, {}), 0, Eigen::Isometry3d::Identity(), {}});
  EXPECT_EQ(feed(pair(30 * MS, 0.7)).status, StepStatus::OK) << "an empty map is a map";
}

// What the meshes are to each other does not change with the map.
TEST_F(OneBody, AMapThatComesStartsNoSearchOfTheMeshes) {
  // Folded, and turned so that the bounds of the two layers overlap.
  const auto topology = std::make_shared<const Topology>(Topology::grid(12, 12));
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  StampNs stamp_ns = 0;
  const auto searched = [&] {
    MeshFrame frame{stamp_ns += 100 * MS, topology, {}, false, Eigen::Isometry3d::Identity()};
    for (int i = 0; i < 144; ++i) {
      const int y = i / 12;
      const Vec3 folded = y < 6 ? Vec3(i % 12, y, 0) : Vec3(i % 12, 11 - y, 0.05);
      frame.positions.push_back(turn * folded + Vec3(0, 0, static_cast<double>(stamp_ns) * 1e-9));
    }
    return feed(std::move(frame)).stats[Stage::START_STATE].in;
  };
  searched();
  EXPECT_GT(searched(), 0u);
  EXPECT_EQ(searched(), 0u);
  for (int i = 0; i < 3; ++i) {
    monitor.setMap({VoxelSurface::build(0.1, {}), stamp_ns, Eigen::Isometry3d::Identity(), {}});
    EXPECT_EQ(searched(), 0u);
  }
  monitor.reset(StepStatus::RESET);
  searched();
  EXPECT_GT(searched(), 0u);
}

TEST_F(OneBody, OldMapIsNoMap) {
  MonitorOptions options = loose();
  options.detector.obstacle_expected = true;
  options.octomap_timeout_s = 1;
  monitor.setOptions(options);
  monitor.setMap({VoxelSurface::build(0.1, {}), 1000 * MS, Eigen::Isometry3d::Identity(), {}});
  feed(pair(1900 * MS, 1));
  EXPECT_EQ(feed(pair(1950 * MS, 1)).status, StepStatus::OK);
  EXPECT_EQ(feed(pair(2001 * MS, 1)).status, StepStatus::NO_MAP);
  // One from the future would be fresh for ever; a little ahead is as good as a little behind.
  monitor.setMap({VoxelSurface::build(0.1, {}), 3150 * MS, Eigen::Isometry3d::Identity(), {}});
  const Outcome ahead = feed(pair(2100 * MS, 1));
  EXPECT_EQ(ahead.status, StepStatus::NO_MAP);
  EXPECT_NE(ahead.reason.find("after the end of the step, more than octomap_timeout_s"), std::string::npos)
      << ahead.reason;
  EXPECT_EQ(feed(pair(2200 * MS, 1)).status, StepStatus::OK);
}

/// A triangle over the map's first voxel, its lowest corner at the height z.
MeshFrame overTheVoxel(StampNs stamp_ns, double z) {
  return {stamp_ns, oneTriangle(), {{0.5, 0.5, z}, {0.6, 0.5, z + 1}, {0.5, 0.6, z + 1}}};
}

TEST_F(OneBody, VoxelContactInTheMapsFrame) {
  // The map's frame stands 10 m above the fixed frame's: voxel [0, 1]^3 there is [0, 1]^2 x [10, 11] here.
  ObstacleMap map{VoxelSurface::build(1.0, {{{32768, 32768, 32768}, 1}}), 0, Eigen::Isometry3d::Identity(), {}};
  map.map_from_fixed.translation() = Vec3(0, 0, -10);
  monitor.setMap(map);
  feed(overTheVoxel(0, 12));
  const Outcome outcome = feed(overTheVoxel(100 * MS, 10));
  ASSERT_FALSE(outcome.contacts.empty());
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-9);
  const Contact& contact = outcome.contacts.front();
  EXPECT_EQ(contact.body[1], OBSTACLE_BODY);
  const ContactGeometry geometry = contactGeometry(outcome, contact);
  EXPECT_NEAR(geometry.point.z(), 11, 1e-6);
  EXPECT_NEAR(geometry.normal.z(), 1, 1e-9);
  EXPECT_NEAR(geometry.approach_speed, 2, 1e-9);

  MonitorOptions options = loose();
  options.detector.exclude_boxes = {{{0, 0, 10}, {1, 1, 11}}};
  monitor.setOptions(options);
  feed(overTheVoxel(200 * MS, 12));
  const Outcome excluded = feed(overTheVoxel(300 * MS, 10));
  EXPECT_TRUE(excluded.contacts.empty());
  EXPECT_EQ(excluded.excluded_voxels, 1u);
  EXPECT_TRUE(assuranceOf(excluded).clear()) << "what is excluded is not looked at";
  map.map_from_fixed.setIdentity();
  monitor.setMap(map);
  feed(overTheVoxel(400 * MS, 2));
  EXPECT_NEAR(feed(overTheVoxel(500 * MS, 0)).earliest_toc, 0.5, 1e-9) << "the same map, moved out of the box";
}

// An excluded voxel is free space, so what lies behind it is exposed.
TEST_F(OneBody, WhatLiesBehindAnExcludedVoxelIsTouched) {
  MonitorOptions options = loose();
  options.detector.exclude_boxes = {{{0, 0, 1}, {2, 2, 2}}};
  monitor.setOptions(options);
  monitor.setMap({VoxelSurface::build(1.0, {{{32768, 32768, 32768}, 2}}), 0, Eigen::Isometry3d::Identity(), {}});
  feed(overTheVoxel(0, 3));
  const Outcome outcome = feed(overTheVoxel(100 * MS, 0.5));
  EXPECT_EQ(outcome.excluded_voxels, 4u);
  ASSERT_FALSE(outcome.contacts.empty());
  EXPECT_NEAR(outcome.earliest_toc, 0.8, 1e-9) << "from 3 m to the upper face of what is left, at 1 m";
  monitor.setOptions(loose());
  feed(overTheVoxel(200 * MS, 3));
  EXPECT_NEAR(feed(overTheVoxel(300 * MS, 0.5)).earliest_toc, 0.4, 1e-9) << "nothing is excluded any more";
}

}  // namespace
}  // namespace test
}  // namespace dccd
