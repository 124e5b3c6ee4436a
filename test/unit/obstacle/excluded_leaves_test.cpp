#include "obstacle/excluded_leaves.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <set>
#include <tuple>

namespace dccd {
namespace {

using Key = std::tuple<int, int, int>;

std::set<Key> voxelsOf(const std::vector<OccupiedLeaf>& leaves) {
  std::set<Key> keys;
  for (const OccupiedLeaf& leaf : leaves) {
    for (std::uint32_t i = 0; i < leaf.size * leaf.size * leaf.size; ++i) {
      const bool fresh = keys.emplace(leaf.min.x + i % leaf.size, leaf.min.y + i / leaf.size % leaf.size,
                                      leaf.min.z + i / leaf.size / leaf.size)
                             .second;
      EXPECT_TRUE(fresh);
    }
  }
  return keys;
}

// Against the definition, voxel by voxel, for boxes and maps that are turned against each other.
TEST(ExcludedLeaves, ExactlyTheVoxelsWhoseCentreIsInABox) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-0.4, 0.8), size(0.05, 0.6), angle(-3, 3);
  const double resolution = 0.05;
  const std::vector<OccupiedLeaf> leaves = {
      {{32768, 32768, 32768}, 8}, {{32776, 32768, 32768}, 4}, {{32780, 32768, 32768}, 1}, {{32768, 32776, 32768}, 2}};
  int split = 0;
  for (int i = 0; i < 300; ++i) {
    Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
    if (i % 2)
      pose.rotate(Eigen::AngleAxisd(angle(random), Vec3(1, 2, 3).normalized())).pretranslate(Vec3(0.1, 0, -0.1));
    std::vector<Box> boxes;
    for (int b = 0; b <= i % 3; ++b) {
      const Vec3 lo(place(random), place(random), place(random));
      boxes.push_back({lo, lo + Vec3(size(random), size(random), size(random))});
    }
    const RemainingLeaves remaining = leavesOutside(leaves, resolution, pose, boxes);
    std::set<Key> expected;
    for (const Key& key : voxelsOf(leaves)) {
      const auto [x, y, z] = key;
      const Vec3 centre = pose * Vec3(resolution * Vec3(x - 32767.5, y - 32767.5, z - 32767.5));
      bool in = false;
      for (const Box& box : boxes)
        in |= (centre.array() >= box.min.array()).all() && (centre.array() <= box.max.array()).all();
      if (!in) expected.insert(key);
    }
    ASSERT_EQ(voxelsOf(remaining.leaves), expected) << "case " << i;
    ASSERT_EQ(remaining.excluded_voxels, voxelsOf(leaves).size() - expected.size());
    split += remaining.leaves.size() > leaves.size();
    // Taking out what is out already changes nothing, down to the leaves.
    const RemainingLeaves again = leavesOutside(remaining.leaves, resolution, pose, boxes);
    ASSERT_EQ(again.excluded_voxels, 0u);
    ASSERT_EQ(again.leaves.size(), remaining.leaves.size());
  }
  EXPECT_GT(split, 50);
}

// A map that is one cube of 65,536 voxels a side must not be taken apart voxel by voxel.
TEST(ExcludedLeaves, ABoxThroughAHugeLeafEndsAndHidesNothing) {
  const std::vector<OccupiedLeaf> leaves = {{{0, 0, 0}, 65536}};
  const Box cut{Vec3(-1e4, -1e4, -1e4), Vec3(1e4, 1e4, 0.013)};
  const RemainingLeaves remaining = leavesOutside(leaves, 0.01, Eigen::Isometry3d::Identity(), {cut});
  double volume = static_cast<double>(remaining.excluded_voxels);
  for (const OccupiedLeaf& leaf : remaining.leaves) volume += std::pow(leaf.size, 3.0);
  EXPECT_EQ(volume, std::pow(65536.0, 3));
  EXPECT_LE(remaining.leaves.size(), std::size_t{1} << 25);
}

}  // namespace
}  // namespace dccd
