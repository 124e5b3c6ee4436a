// Octomaps built of known shapes, read back by OctoMap itself.
#include "octomap/map_builder.h"

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

}  // namespace
}  // namespace dccd
