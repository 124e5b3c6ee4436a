#include "octomap/map_odds.h"

#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

namespace dccd {
namespace {

constexpr float MOST = 3.5f;

OccupiedLeaf voxel(int x, std::uint32_t size = 1) {
  return {{static_cast<std::uint16_t>(32768 + x), 32768, 32768}, size};
}

/// Leaves along x, from the first on, each with its log-odds.
DecodedOctomap mapOf(const std::vector<std::pair<OccupiedLeaf, float>>& leaves) {
  DecodedOctomap map;
  map.resolution_m = 0.05;
  for (const auto& [leaf, odds] : leaves) {
    map.occupied.push_back(leaf);
    map.log_odds.push_back(odds);
  }
  return map;
}

class FoundIn : public ::testing::Test {
 protected:
  /// Where the second map found something, by the keys of x from the first voxel on.
  std::vector<int> found(const DecodedOctomap& map) {
    const auto leaves = odds_.foundIn(map, "map", ++stamp_ns_);
    EXPECT_TRUE(leaves);
    std::vector<int> keys;
    for (const OccupiedLeaf& leaf : *leaves) keys.push_back(leaf.min.x - 32768);
    return keys;
  }
  bool tells(const DecodedOctomap& map, const std::string& frame_id, StampNs stamp_ns) {
    return odds_.foundIn(map, frame_id, stamp_ns).has_value();
  }

  MapOdds odds_;
  StampNs stamp_ns_ = 1;
};

TEST_F(FoundIn, WhatRoseOrAppearedOrStandsAtTheMost) {
  EXPECT_FALSE(tells(mapOf({{voxel(0), 1}, {voxel(1), 1}, {voxel(2), 1}, {voxel(4), MOST}}), "map", 1))
      << "a first one";
  EXPECT_EQ(found(mapOf({{voxel(0), 1.4f}, {voxel(1), 1}, {voxel(2), 0.6f}, {voxel(3), 1}, {voxel(4), MOST}})),
            (std::vector<int>{0, 3, 4}));
  EXPECT_EQ(found(mapOf({{voxel(0), 1.4f}, {voxel(4), 3}})), std::vector<int>()) << "the most is less than before";
}

TEST_F(FoundIn, PartsOfALargerLeafByItsValueAndALargerLeafByTheMostAlone) {
  EXPECT_FALSE(tells(mapOf({{voxel(0, 2), 1}, {voxel(2), MOST}, {voxel(4), 1}}), "map", 1));
  EXPECT_EQ(found(mapOf({{voxel(0), 2}, {voxel(1), 1}, {voxel(2), MOST}, {voxel(4, 2), 2}})), (std::vector<int>{0, 2}));
  EXPECT_EQ(found(mapOf({{voxel(0, 2), MOST}, {voxel(4, 2), 2}})), (std::vector<int>{0}));
}

TEST_F(FoundIn, OfNoTwoOfOneMakerNothingIsTold) {
  const DecodedOctomap map = mapOf({{voxel(0), 1}});
  DecodedOctomap coarse = map, binary = map;
  coarse.resolution_m = 0.1;
  binary.log_odds.clear();
  struct Second {
    const DecodedOctomap& map;
    std::string frame_id;
    StampNs stamp_ns;
    bool told;
  };
  for (const auto& [second, frame_id, stamp_ns, told] :
       {Second{map, "map", 2, true}, Second{map, "map", 1, false}, Second{map, "odom", 2, false},
        Second{coarse, "map", 2, false}, Second{binary, "map", 2, false}}) {
    odds_ = MapOdds();
    EXPECT_FALSE(tells(map, "map", 1));
    EXPECT_EQ(tells(second, frame_id, stamp_ns), told) << frame_id << ' ' << stamp_ns;
  }
  EXPECT_FALSE(tells(map, "map", 3)) << "after a binary one";
}

}  // namespace
}  // namespace dccd
