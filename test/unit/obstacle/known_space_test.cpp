#include "dccd/known_space.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <stdexcept>

#include "obstacle/voxel_surface_impl.h"
#include "support/said.h"

namespace dccd {
namespace {

constexpr double RESOLUTION = 0.05;

OccupiedLeaf leafAt(int x, int y, int z, std::uint32_t size = 1) {
  return {{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), static_cast<std::uint16_t>(z)}, size};
}

Box box(double x0, double y0, double z0, double x1, double y1, double z1) {
  Box b;
  b.min = Vec3(x0, y0, z0);
  b.max = Vec3(x1, y1, z1);
  return b;
}

/// Known: keys 32768 to 32783 on each axis, less the voxel (32770, 32770, 32770).
std::vector<OccupiedLeaf> blockWithHole() {
  std::vector<OccupiedLeaf> leaves;
  for (int i = 0; i < 512; ++i) {
    const int x = 2 * (i % 8), y = 2 * (i / 8 % 8), z = 2 * (i / 64);
    if (x != 2 || y != 2 || z != 2) {
      leaves.push_back(leafAt(32768 + x, 32768 + y, 32768 + z, 2));
      continue;
    }
    for (int k = 1; k < 8; ++k) leaves.push_back(leafAt(32770 + (k & 1), 32770 + (k >> 1 & 1), 32770 + (k >> 2), 1));
  }
  return leaves;
}

TEST(KnownSpace, ARegionIsKnownWhenEveryClosedVoxelItMeetsIs) {
  const auto space = KnownSpace::build(RESOLUTION, blockWithHole());
  EXPECT_TRUE(space->isKnown(box(0.2, 0.2, 0.2, 0.7, 0.7, 0.7)));
  EXPECT_FALSE(space->isKnown(box(0.12, 0.12, 0.12, 0.7, 0.7, 0.7))) << "holds the hole";
  EXPECT_FALSE(space->isKnown(box(0.2, 0.2, 0.2, 0.81, 0.7, 0.7))) << "reaches beyond";
  EXPECT_FALSE(space->isKnown(box(0, 0.2, 0.2, 0.1, 0.3, 0.3))) << "touches the voxel below zero";
  EXPECT_FALSE(space->isKnown(box(0.15000000000000002, 0.11, 0.11, 0.2, 0.12, 0.12))) << "touches the hole's plane";
  EXPECT_FALSE(space->isKnown(box(0.06, 0.11, 0.11, 0.1, 0.12, 0.12))) << "and from the other side";
  EXPECT_TRUE(space->isKnown(box(0.16, 0.11, 0.11, 0.2, 0.12, 0.12)));
  EXPECT_FALSE(space->isKnown(box(-1e9, 0, 0, 1e9, 1, 1)));
  EXPECT_TRUE(space->isKnown(Box()));
}

TEST(KnownSpace, UnknownLeavesFillTheCropBox) {
  const auto space = KnownSpace::build(RESOLUTION, blockWithHole());
  // Keys 32760 to 32791 on each axis: 32^3 voxels of which 16^3 - 1 are known.
  const double inset = 0.01;
  const Box crop = box(-8 * RESOLUTION + inset, -8 * RESOLUTION + inset, -8 * RESOLUTION + inset,
                       24 * RESOLUTION - inset, 24 * RESOLUTION - inset, 24 * RESOLUTION - inset);
  const std::vector<OccupiedLeaf> unknown = space->unknownLeaves(crop);
  std::uint64_t voxels = 0;
  for (const OccupiedLeaf& leaf : unknown) voxels += std::uint64_t{leaf.size} * leaf.size * leaf.size;
  EXPECT_EQ(voxels, 32u * 32 * 32 - 16 * 16 * 16 + 1);
  EXPECT_LT(unknown.size(), 100u) << "cubes, not voxels";
  // Known and unknown together are a surface without holes: only the crop's own hull is exposed.
  std::vector<OccupiedLeaf> all = blockWithHole();
  all.insert(all.end(), unknown.begin(), unknown.end());
  const auto surface = VoxelSurface::build(RESOLUTION, all);
  int corners = 0;
  for (const FeatureMask mask : VoxelSurface::Impl::of(*surface).features) corners += bitCount(mask & CORNER_MASK);
  EXPECT_EQ(corners, 8);
}

TEST(KnownSpace, UnknownLeavesAreBounded) {
  const auto space = KnownSpace::build(RESOLUTION, blockWithHole());
  EXPECT_THROW(space->unknownLeaves(box(-100.01, -100.01, -100.01, 100.01, 100.01, 100.01), 1000), std::length_error);
  Box infinite = box(0, 0, 0, 1, 1, 1);
  infinite.max[1] = std::numeric_limits<double>::infinity();
  EXPECT_THROW(space->unknownLeaves(infinite), std::invalid_argument);
  EXPECT_TRUE(space->unknownLeaves(Box()).empty());
  EXPECT_TRUE(space->unknownLeaves(box(1e6, 1e6, 1e6, 2e6, 2e6, 2e6)).empty()) << "outside of the map";
}

TEST(KnownSpace, AResolutionThatIsNoneIsNamed) {
  const std::string text = test::said<std::invalid_argument>([&] { KnownSpace::build(-0.5, {}); });
  EXPECT_EQ(text, "resolution_m is -0.5, which is not a length from 1e-290 to 1e290 m");
}

}  // namespace
}  // namespace dccd
