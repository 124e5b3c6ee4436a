// Clouds to one map: held against liboctomap's own insertion, and against rays that can be counted by hand.
#include "dccd/cloud_map.h"
#include "support/said.h"

#include <gtest/gtest.h>
#include <octomap/OcTree.h>

#include <random>
#include <sstream>

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

bool same(const std::vector<OccupiedLeaf>& a, const std::vector<OccupiedLeaf>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](const OccupiedLeaf& x, const OccupiedLeaf& y) {
    return !(x.min < y.min) && !(y.min < x.min) && x.size == y.size;
  });
}

DecodedOctomap decoded(octomap::OcTree& tree) {
  std::ostringstream stream;
  tree.writeData(stream);
  const std::string bytes = stream.str();
  OctomapFields fields;
  fields.id = "OcTree";
  fields.resolution = tree.getResolution();
  fields.binary = false;
  fields.data = bytes.data();
  fields.size = bytes.size();
  return decodeOctomap(fields);
}

TEST(CloudMap, IsWhatLiboctomapMakesOfTheSameClouds) {
  std::mt19937 random(7);
  for (const double range_m : {0.0, 1.7}) {
    CloudMapOptions options;
    options.resolution_m = 0.04;
    options.max_range_m = range_m;
    CloudMap map(options);
    octomap::OcTree tree(options.resolution_m);
    tree.setProbHit(0.7);
    tree.setProbMiss(0.4);
    tree.setClampingThresMin(0.12);
    tree.setClampingThresMax(0.97);
    for (int i = 0; i < 6; ++i) {
      const Vec3 sensor(0.01 * i, 0.3, 1 - 0.03 * i);
      const Positions points = someCloud(random, sensor);
      octomap::Pointcloud cloud;
      for (const Vec3& p : points) {
        cloud.push_back(static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z()));
      }
      const octomap::point3d origin(static_cast<float>(sensor.x()), static_cast<float>(sensor.y()),
                                    static_cast<float>(sensor.z()));
      tree.insertPointCloud(cloud, origin, range_m > 0 ? range_m : -1);
      insert(map, sensor, points);
      const DecodedOctomap expected = decoded(tree), found = map.leaves();
      ASSERT_TRUE(same(found.occupied, expected.occupied)) << "cloud " << i << ", range " << range_m;
      ASSERT_TRUE(same(found.free, expected.free)) << "cloud " << i << ", range " << range_m;
      ASSERT_GT(found.occupied.size(), 100u);
      ASSERT_GE(map.memoryBytes(), tree.memoryUsage());
      for (const bool binary : {true, false}) {
        std::ostringstream stream;
        ASSERT_TRUE(static_cast<bool>(binary ? tree.writeBinaryData(stream) : tree.writeData(stream)));
        const std::vector<std::int8_t> bytes = map.serialized(binary);
        ASSERT_EQ(std::string(bytes.begin(), bytes.end()), stream.str()) << "cloud " << i << ", range " << range_m;
      }
    }
  }
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
  insert(map, {0.05, 0.05, 0.05}, {{0.95, 0.05, 0.05}});
  const DecodedOctomap found = map.leaves();
  EXPECT_TRUE(found.occupied.empty());
  ASSERT_EQ(found.free.size(), 5u);
  EXPECT_EQ(found.free.back().min.x, 32768 + 4);
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

TEST(CloudMap, WhatNoMapCanSpanIsLeftOutOrRefused) {
  CloudMap map(tenCentimetres());  // +- 3276.8 m
  testing::internal::CaptureStderr();
  insert(map, {3276, 0, 0}, {{3277, 0, 0}, {3276, 1e30, 0}, {-1e300, 0, 0}, {3276.55, 0, 0}});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "OctoMap complains on the console";
  EXPECT_EQ(map.leaves().occupied.size(), 1u);
  EXPECT_THROW(insert(map, {3277, 0, 0}, {{3276, 0, 0}}), OctomapError);
  EXPECT_THROW(insert(map, {1e300, 0, 0}, {{3276, 0, 0}}), OctomapError);
}

TEST(CloudMap, NeedsNoMoreThanItMay) {
  std::mt19937 random(7);
  CloudMapOptions options;
  options.resolution_m = 0.005;
  CloudMap map(options);
  const std::size_t limit = std::size_t{2} << 20;
  const Positions points = someCloud(random, Vec3::Zero());
  const std::string text = test::said<OctomapError>([&] { insert(map, Vec3::Zero(), points, limit); });
  EXPECT_EQ(text, "the octree of all clouds needs more than the 2 MB that it may take");
  EXPECT_LE(map.memoryBytes(), limit);
}

}  // namespace
}  // namespace dccd
