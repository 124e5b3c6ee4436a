// Octomaps built of known shapes and of clouds, read back by OctoMap itself.
#include "octomap/map_builder.h"

#include <limits>
#include <memory>
#include <sstream>
#include <stdexcept>
#include <string>

#include <gtest/gtest.h>
#include <octomap/OcTree.h>

namespace dccd {
namespace {

constexpr double RESOLUTION_M = 0.1;

Box unitBox() {
  Box box;
  box.min = Vec3(0.0, 0.0, 0.0);
  box.max = Vec3(0.8, 0.4, 0.4);
  return box;
}

bool insideUnitBox(const Vec3& p) {
  return (p.array() > unitBox().min.array()).all() && (p.array() < unitBox().max.array()).all();
}

std::size_t occupiedVoxels(const std::vector<std::int8_t>& bytes, bool binary) {
  std::istringstream stream(std::string(bytes.begin(), bytes.end()));
  octomap::OcTree tree(RESOLUTION_M);
  if (binary) {
    tree.readBinaryData(stream);
  } else {
    tree.readData(stream);
  }
  tree.expand();
  std::size_t count = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) {
    if (!tree.isNodeOccupied(*leaf)) continue;
    ++count;
    EXPECT_TRUE(insideUnitBox(Vec3(leaf.getX(), leaf.getY(), leaf.getZ())));
  }
  return count;
}

TEST(MapBuilder, EveryVoxelInTheShapeAndNoOther) {
  EXPECT_EQ(occupiedVoxels(buildOctomap(RESOLUTION_M, unitBox(), insideUnitBox, true), true), 8u * 4 * 4);
  EXPECT_EQ(occupiedVoxels(buildOctomap(RESOLUTION_M, unitBox(), insideUnitBox, false), false), 8u * 4 * 4);
}

TEST(MapBuilder, NoShapeIsAnEmptyMap) {
  const auto nothing = [](const Vec3&) { return false; };
  // A tree without nodes is written as no bytes at all (and OctoMap's own reader does not survive reading them back).
  EXPECT_TRUE(buildOctomap(RESOLUTION_M, unitBox(), nothing, false).empty());
  EXPECT_TRUE(buildOctomap(RESOLUTION_M, Box{}, insideUnitBox, false).empty());
}

TEST(MapBuilder, AShapeBeyondTheKeysIsRefused) {
  Box far = unitBox();
  far.max[0] = 1e9;
  EXPECT_THROW(buildOctomap(RESOLUTION_M, far, insideUnitBox, true), std::invalid_argument);
}

std::size_t occupiedIn(const std::vector<std::int8_t>& binary) {
  std::istringstream stream(std::string(binary.begin(), binary.end()));
  octomap::OcTree tree(RESOLUTION_M);
  tree.readBinaryData(stream);
  std::size_t count = 0;
  for (auto leaf = tree.begin_leafs(); leaf != tree.end_leafs(); ++leaf) count += tree.isNodeOccupied(*leaf);
  return count;
}

/// The voxel of a point is occupied, free or unknown after some clouds of one point each.
std::string stateOf(const MapOfClouds& map, const octomap::point3d& point) {
  const std::vector<std::int8_t> bytes = map.serialized(false);
  std::istringstream stream(std::string(bytes.begin(), bytes.end()));
  octomap::OcTree tree(RESOLUTION_M);
  tree.readData(stream);
  const octomap::OcTreeNode* node = tree.search(point);
  return node == nullptr ? "unknown" : tree.isNodeOccupied(*node) ? "occupied" : "free";
}

TEST(MapOfClouds, HitsAndMissesWeighAsInOctomapServer) {
  const octomap::point3d near(1.05f, 0.05f, 0.05f), far(2.05f, 0.05f, 0.05f);
  const std::vector<Eigen::Vector3f> near_cloud{{1.05f, 0.05f, 0.05f}}, far_cloud{{2.05f, 0.05f, 0.05f}};
  const Vec3 camera(0.05, 0.05, 0.05);
  // ln(0.7 / 0.3) = 0.847 a hit, ln(0.4 / 0.6) = -0.405 a miss, at most ln(0.97 / 0.03) = 3.476 and at least
  // ln(0.12 / 0.88) = -1.992: one hit outlasts two misses, any number of hits eight, any number of misses two hits.
  MapOfClouds once(RESOLUTION_M), often(RESOLUTION_M);
  once.insert(camera, near_cloud);
  EXPECT_EQ(stateOf(once, near), "occupied");
  EXPECT_EQ(stateOf(once, far), "unknown");
  for (int hit = 0; hit < 50; ++hit) often.insert(camera, near_cloud);
  for (int miss = 1; miss <= 50; ++miss) {
    once.insert(camera, far_cloud);
    often.insert(camera, far_cloud);
    EXPECT_EQ(stateOf(once, near), miss <= 2 ? "occupied" : "free") << miss;
    EXPECT_EQ(stateOf(often, near), miss <= 8 ? "occupied" : "free") << miss;
    EXPECT_EQ(stateOf(once, far), "occupied");
  }
  for (int hit = 1; hit <= 5; ++hit) {
    once.insert(camera, near_cloud);
    EXPECT_EQ(stateOf(once, near), hit <= 2 ? "free" : "occupied") << hit;
  }
}

TEST(MapOfClouds, OfOneCloudNoRayClearsWhatAnotherHits) {
  const Eigen::Vector3f near(1.05f, 0.05f, 0.05f), far(2.05f, 0.05f, 0.05f);
  MapOfClouds map(RESOLUTION_M);
  map.insert(Vec3(0.05, 0.05, 0.05), {far, near, far, far, far});
  EXPECT_EQ(stateOf(map, {1.05f, 0.05f, 0.05f}), "occupied");
  EXPECT_EQ(stateOf(map, {1.55f, 0.05f, 0.05f}), "free");
}

TEST(MapOfClouds, WhatIsNotFiniteOrBeyondTheMapIsLeftOut) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  MapOfClouds map(RESOLUTION_M);
  testing::internal::CaptureStderr();
  map.insert(Vec3(0.05, 0.05, 0.05), {{nan, 0, 0}, {0, inf, 0}, {0, 0, -inf}});
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "") << "OctoMap was not asked";
  map.insert(Vec3(0.05, 0.05, 0.05), {{1e6f, 0, 0}});
  EXPECT_TRUE(map.serialized(true).empty());
  map.insert(Vec3(0.05, 0.05, 0.05), {{nan, nan, nan}, {1.05f, 0.05f, 0.05f}});
  EXPECT_EQ(stateOf(map, {1.05f, 0.05f, 0.05f}), "occupied");
  EXPECT_EQ(occupiedIn(map.serialized(true)), 1u);
}

}  // namespace
}  // namespace dccd
