// What sensors see, to one map: views whose rays can be counted by hand. cloud_map_rays_test.cpp has the others.
#include "base/cloud_map.h"
#include "support/said.h"
#include "support/seen_scene.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace dccd {
namespace {

constexpr std::size_t PLENTY = std::size_t{1} << 30;

/// Key of the voxel of 0.1 m in which a coordinate lies.
int keyOf(double x) { return 32768 + static_cast<int>(std::floor(x / 0.1)); }

CloudMapOptions tenCentimetres() {
  CloudMapOptions options;
  options.resolution_m = 0.1;
  return options;
}

/// Points in the map's frame that a sensor saw there.
SeenCounts insert(CloudMap& map, const Vec3& sensor, const Positions& points, std::size_t max_bytes = PLENTY) {
  std::vector<float> xyz;
  for (const Vec3& p : points) {
    for (int axis = 0; axis < 3; ++axis) xyz.push_back(static_cast<float>(p[axis] - sensor[axis]));
  }
  SensorView view;
  view.map_from_sensor.translation() = sensor;
  view.width = points.size();
  view.xyz = xyz.data();
  return map.insert(view, max_bytes);
}

/// A sensor in the middle of a room with a floor and some boxes, to which depth adds noise.
Positions someCloud(std::mt19937& random, const Vec3& sensor) {
  std::uniform_real_distribution<double> unit(0, 1), angle(-3, 3);
  Positions points;
  for (int i = 0; i < 1500; ++i) {
    const double a = angle(random), b = 0.5 * angle(random),
                 depth = 1 + 2 * std::abs(std::sin(2 * a)) + 0.05 * unit(random);
    points.push_back(sensor + depth * Vec3(std::cos(a) * std::cos(b), std::sin(a) * std::cos(b), std::sin(b)));
  }
  return points;
}

TEST(CloudMap, ARayClearsUpToThePointThatItFills) {
  CloudMap map(tenCentimetres());
  insert(map, {0.05, 0.05, 0.05}, {{0.95, 0.05, 0.05}});
  const DecodedOctomap found = map.leaves();
  ASSERT_EQ(found.occupied.size(), 1u);
  EXPECT_EQ(found.occupied[0].min.x, keyOf(0.95));
  EXPECT_EQ(found.occupied[0].min.y, keyOf(0.05));
  ASSERT_EQ(found.free.size(), 9u);
  for (int i = 0; i < 9; ++i) EXPECT_EQ(found.free[static_cast<std::size_t>(i)].min.x, 32768 + i);
}

TEST(CloudMap, WhatLiesBeyondTheRangeOnlyClears) {
  CloudMapOptions options = tenCentimetres();
  options.max_range_m = 0.5;
  CloudMap map(options);
  EXPECT_EQ(insert(map, {0.05, 0.05, 0.05}, {{0.95, 0.05, 0.05}}).far, 1u);
  const DecodedOctomap found = map.leaves();
  EXPECT_TRUE(found.occupied.empty());
  ASSERT_EQ(found.free.size(), 6u);  // with the voxel in which it is clipped
  EXPECT_EQ(found.free.back().min.x, 32768 + 5);
}

TEST(CloudMap, AVoxelIsClearedAsSoonAsTheModelSaysSo) {
  // ln(0.7 / 0.3) = 0.847 for the hit, ln(0.4 / 0.6) = -0.405 for each miss: three misses are more than one hit.
  CloudMap map(tenCentimetres());
  const auto isOccupied = [&] {
    for (const OccupiedLeaf& leaf : map.leaves().occupied) {
      if (leaf.min.x == keyOf(0.45)) return true;
    }
    return false;
  };
  insert(map, {0.05, 0.05, 0.05}, {{0.45, 0.05, 0.05}});
  for (int misses = 0; misses < 3; ++misses) {
    EXPECT_TRUE(isOccupied()) << misses;
    insert(map, {0.05, 0.05, 0.05}, {{0.95, 0.05, 0.05}});
  }
  EXPECT_FALSE(isOccupied());
}

TEST(CloudMap, APointWinsOverTheRaysOfTheSameCloud) {
  CloudMap map(tenCentimetres());
  insert(map, {0.05, 0.05, 0.05}, {{0.45, 0.05, 0.05}, {0.95, 0.05, 0.05}, {0.95, 0.051, 0.05}});
  // Had the rays counted, too, two misses would be enough.
  for (int i = 0; i < 2; ++i) insert(map, {0.05, 0.05, 0.05}, {{0.75, 0.05, 0.05}});
  EXPECT_EQ(map.leaves().occupied.size(), 3u);
}

bool isOccupied(const CloudMap& map, const Vec3& at) {
  const std::vector<OccupiedLeaf> occupied = map.leaves().occupied;
  return std::any_of(occupied.begin(), occupied.end(), [&](const OccupiedLeaf& leaf) {
    return leaf.min.x == keyOf(at.x()) && leaf.min.y == keyOf(at.y()) && leaf.min.z == keyOf(at.z());
  });
}

TEST(CloudMap, AVoxelAtTheRangeIsClearedByThreeLooksThroughIt) {
  // A wall at 1.999 m of 2 m, which goes away: the clipped ends of the rays behind it lie in its voxels.
  CloudMapOptions options;
  options.resolution_m = 0.02;
  options.max_range_m = 2;
  CloudMap map(options);
  constexpr std::size_t WIDTH = 64, HEIGHT = 48;
  const Pinhole lens{60, 60, 31.5, 23.5};
  std::vector<float> depths;
  const auto look = [&](double away_m) {
    depths.clear();
    for (std::size_t v = 0; v < HEIGHT; ++v) {
      for (std::size_t u = 0; u < WIDTH; ++u) {
        const Vec3 way((double(u) - lens.cx) / lens.fx, (double(v) - lens.cy) / lens.fy, 1);
        depths.push_back(static_cast<float>(away_m / way.norm()));
      }
    }
    return map.insert(test::viewOf(Eigen::Isometry3d::Identity(), depths, lens, WIDTH), PLENTY);
  };
  EXPECT_EQ(look(1.999).filled, WIDTH * HEIGHT);
  EXPECT_GT(map.leaves().occupied.size(), 2000u);
  for (int looks = 0; looks < 3; ++looks) {
    EXPECT_FALSE(map.leaves().occupied.empty());
    EXPECT_EQ(look(4).far, WIDTH * HEIGHT);
  }
  EXPECT_TRUE(map.leaves().occupied.empty());
  EXPECT_TRUE(map.doubtful().empty());
}

TEST(CloudMap, APointThatIsNoMeasurementFillsAndClearsNothing) {
  CloudMapOptions options = tenCentimetres();
  options.min_range_m = 0.3;
  CloudMap map(options);
  const Vec3 sensor(0.05, 0.05, 0.05);
  const SeenCounts counts = insert(map, sensor, {sensor, {0.25, 0.05, 0.05}, {0.05, 0.95, 0.05}});
  EXPECT_EQ(counts.near, 2u);
  EXPECT_EQ(counts.filled, 1u);
  EXPECT_EQ(map.leaves().occupied.size(), 1u);
  EXPECT_EQ(map.leaves().free.size(), 9u);
  const std::vector<float> depths{0, -1, 0.2f, 0.9f};
  EXPECT_EQ(map.insert(test::viewOf(Eigen::Isometry3d::Identity(), depths, {1, 1, 0, 0}, 2), PLENTY).near, 3u);
}

TEST(CloudMap, NoReturnClearsUpToTheRangeIfAsked) {
  const std::vector<float> depths(64 * 48, std::numeric_limits<float>::infinity());
  for (const bool clears : {false, true}) {
    CloudMapOptions options = tenCentimetres();
    options.max_range_m = 1;
    options.no_return_clears = clears;
    CloudMap map(options);
    insert(map, Vec3::Zero(), {{0.05, 0.05, 0.75}});
    for (int looks = 0; looks < 3; ++looks) {
      const SeenCounts counts =
          map.insert(test::viewOf(Eigen::Isometry3d::Identity(), depths, {60, 60, 31, 23}, 64), PLENTY);
      EXPECT_EQ(counts.no_return, depths.size());
      EXPECT_EQ(counts.no_return_cleared, clears);
    }
    EXPECT_EQ(map.leaves().occupied.empty(), clears);
  }
}

TEST(CloudMap, APointInFreeSpaceIsDoubtfulUntilItIsOccupiedOrSeenThrough) {
  CloudMap map(tenCentimetres());
  const Vec3 sensor(0.05, 0.05, 0.05), far(0.95, 0.05, 0.05), near(0.45, 0.05, 0.05);
  for (int looks = 0; looks < 6; ++looks) insert(map, sensor, {far});
  for (int looks = 0; looks < 3; ++looks) {  // of something that stays
    insert(map, sensor, {near});
    EXPECT_EQ(isOccupied(map, near), looks == 2) << looks;
    ASSERT_EQ(map.doubtful().size(), looks == 2 ? 0u : 1u) << looks;
    if (looks < 2) {
      EXPECT_EQ(map.doubtful()[0].min.x, keyOf(near.x()));
    }
  }
  for (int looks = 0; looks < 6; ++looks) insert(map, sensor, {far});
  insert(map, sensor, {near});
  EXPECT_EQ(map.doubtful().size(), 1u);
  insert(map, sensor, {{0.05, 0.95, 0.05}});  // says nothing of it
  EXPECT_EQ(map.doubtful().size(), 1u);
  insert(map, sensor, {far});
  EXPECT_TRUE(map.doubtful().empty());
}

TEST(CloudMap, WhatIsOutsideOfTheBoxStaysUnknown) {
  CloudMapOptions options = tenCentimetres();
  options.box = Box{Vec3(0.3, -1, -1), Vec3(0.6, 1, 1)};
  CloudMap map(options);
  const SeenCounts counts =
      insert(map, {0.05, 0.05, 0.05}, {{0.95, 0.05, 0.05}, {0.05, 0.45, 0.05}, {0.45, 0.25, 0.05}});
  EXPECT_EQ(counts.outside, 2u);
  EXPECT_EQ(counts.filled, 1u);
  for (const OccupiedLeaf& leaf : map.leaves().free) {
    EXPECT_GE(leaf.min.x, 32768 + 3);
    EXPECT_LE(leaf.min.x, 32768 + 5);
  }
  EXPECT_EQ(map.leaves().free.size(), 5u);
  EXPECT_EQ(map.leaves().occupied.size(), 1u);
}

TEST(CloudMap, WhatDoesNotClearFillsAllTheSame) {
  CloudMap map(tenCentimetres());
  const std::vector<float> xyz{0, 0, 0.55f};
  SensorView view = test::viewOf(Eigen::Isometry3d::Identity(), xyz);
  view.clears = false;
  EXPECT_FALSE(map.insert(view, PLENTY).cleared);
  EXPECT_TRUE(map.leaves().free.empty());
  EXPECT_EQ(map.leaves().occupied.size(), 1u);
}

TEST(CloudMap, WhatNoMapCanSpanIsRefusedByName) {
  CloudMap map(tenCentimetres());  // +- 3276.8 m
  testing::internal::CaptureStderr();
  EXPECT_EQ(test::said<OctomapError>([&] {
              insert(map, {3276, 0, 0}, {{3276.55, 0, 0}, {3277, 0, 0}});
            }),
            "a point lies at (3277 0 0) m, beyond the 65536 voxels of 0.1 m that a map can span");
  EXPECT_EQ(test::said<OctomapError>([&] {
              insert(map, {0, -500000, 0}, {{3276, 0, 0}});
            }),
            "the sensor is at (0 -500000 0) m, beyond the 65536 voxels of 0.1 m that a map can span");
  EXPECT_THROW(insert(map, {0, 0, 0}, {{3276, 1e30, 0}}), OctomapError);
  EXPECT_TRUE(map.leaves().occupied.empty());
  EXPECT_TRUE(map.leaves().free.empty());
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "OctoMap complains on the console";
  CloudMapOptions options = tenCentimetres();
  options.max_range_m = 10;
  CloudMap near(options);
  EXPECT_EQ(insert(near, {3276, 0, 0}, {{3297, 0, 0}}).far, 1u);
}

TEST(CloudMap, NeedsNoMoreThanItMay) {
  std::mt19937 random(7);
  CloudMapOptions options;
  options.resolution_m = 0.005;
  const Positions points = someCloud(random, Vec3::Zero());
  std::vector<float> depths(64 * 48, 1.2f);
  for (float& depth : depths) depth += 0.2f * static_cast<float>(random() % 3);
  for (const bool is_picture : {false, true}) {
    CloudMap map(options);
    const std::size_t limit = std::size_t{4} << 20;
    const std::string text = test::said<OctomapError>([&] {
      if (is_picture) {
        map.insert(test::viewOf(Eigen::Isometry3d::Identity(), depths, {60, 60, 31, 23}, 64), limit);
      } else {
        insert(map, Vec3::Zero(), points, limit);
      }
    });
    EXPECT_EQ(text, "the octree of all clouds needs more than the 4 MB that it may take");
    EXPECT_LE(map.memoryBytes(), limit);
    // What is in it is listed.
    const std::vector<std::int8_t> bytes = map.serialized(false);
    const DecodedOctomap leaves = map.leaves();
    const DecodedOctomap decoded = decodeOctomap({"OcTree", options.resolution_m, false, bytes.data(), bytes.size()});
    EXPECT_EQ(decoded.occupied.size(), leaves.occupied.size());
    EXPECT_EQ(decoded.free.size(), leaves.free.size());
    EXPECT_EQ(leaves.free.empty(), !is_picture) << "before the octree is changed, or in the middle";
  }
}

}  // namespace
}  // namespace dccd
