#include "octomap/coarser.h"

#include <gtest/gtest.h>

#include <random>
#include <set>
#include <tuple>

namespace dccd {
namespace {

using Leaf = std::tuple<std::uint32_t, std::uint16_t, std::uint16_t, std::uint16_t>;

std::set<Leaf> leavesOf(const VoxelSurface& map) {
  std::set<Leaf> leaves;
  for (const OccupiedLeaf& leaf : map.leaves()) leaves.emplace(leaf.size, leaf.min.x, leaf.min.y, leaf.min.z);
  return leaves;
}

TEST(CoarserMap, AVoxelBecomesTheLargerOneAroundIt) {
  const auto map = VoxelSurface::build(0.05, {{{32767, 32768, 5}, 1}});
  const auto coarse = coarser(*map, 4);
  EXPECT_EQ(coarse->resolution(), 0.05) << "planes stay where they were to the bit";
  EXPECT_EQ(leavesOf(*coarse), (std::set<Leaf>{{4, 32764, 32768, 4}}));
  EXPECT_EQ(leavesOf(*coarser(*map, 1)), leavesOf(*map));
  EXPECT_EQ(leavesOf(*coarser(*map, 65536)), (std::set<Leaf>{{65536, 0, 0, 0}}));
  EXPECT_THROW(coarser(*map, 3), std::invalid_argument);
  EXPECT_THROW(coarser(*map, 0), std::invalid_argument);
}

TEST(CoarserMap, LargeLeavesStayAndEightMakeOne) {
  std::vector<OccupiedLeaf> leaves{{{64, 64, 64}, 8}};
  for (int i = 0; i < 8; ++i) {  // one voxel in each octant of the cube of 8 at the origin
    const auto key = [&](int axis) { return static_cast<std::uint16_t>(i >> axis & 1 ? 6 : 1); };
    leaves.push_back({{key(0), key(1), key(2)}, 1});
  }
  const auto map = VoxelSurface::build(0.1, leaves);
  EXPECT_EQ(leavesOf(*coarser(*map, 4)), (std::set<Leaf>{{8, 0, 0, 0}, {8, 64, 64, 64}}));
  EXPECT_EQ(leavesOf(*coarser(*map, 2)).size(), 9u);
}

TEST(CoarserMap, OccupiedIsWhatTheLargerVoxelsHold) {
  std::mt19937 random(7);
  std::set<std::array<std::uint16_t, 3>> voxels;
  for (int i = 0; i < 400; ++i) {
    const auto key = [&] { return static_cast<std::uint16_t>(32760 + random() % 16); };
    voxels.insert({key(), key(), key()});
  }
  std::vector<OccupiedLeaf> leaves;
  for (const auto& v : voxels) leaves.push_back({{v[0], v[1], v[2]}, 1});
  const auto map = VoxelSurface::build(1, leaves);
  for (const unsigned factor : {2u, 4u, 8u}) {
    const auto coarse = coarser(*map, factor);
    std::set<std::array<unsigned, 3>> expected;
    for (const auto& v : voxels) expected.insert({v[0] / factor, v[1] / factor, v[2] / factor});
    for (unsigned x = 32752 / factor; x < 32784 / factor; ++x) {
      for (unsigned y = 32752 / factor; y < 32784 / factor; ++y) {
        for (unsigned z = 32752 / factor; z < 32784 / factor; ++z) {
          const auto middle = [&](unsigned k) { return voxelPlane(k * factor, 1) + 0.5 * factor; };
          EXPECT_EQ(coarse->leafAt({middle(x), middle(y), middle(z)}) != nullptr, expected.count({x, y, z}) > 0);
        }
      }
    }
  }
}

}  // namespace
}  // namespace dccd
