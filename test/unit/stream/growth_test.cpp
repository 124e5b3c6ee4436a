#include "stream/growth.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

namespace dccd {
namespace test {
namespace {

std::uint64_t at(int x, int y) { return packed({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), 0}); }

/// Two hands of four voxels, at x = 0 and x = 20, that were last free at 1 and at 2.
class TwoHands : public ::testing::Test {
 protected:
  void SetUp() override {
    for (const auto& [x, free_ns] : {std::pair{0, 1}, std::pair{20, 2}}) {
      for (int y = 0; y < 4; ++y) {
        const OccupiedLeaf voxel{unpacked(at(x, y)), 1};
        leaves_.push_back(voxel);
        growth_.add(voxel, false, free_ns, 3);
      }
    }
  }
  /// What grew on beside the hands, by the time that it goes by.
  std::map<std::uint64_t, StampNs> touched(const std::vector<std::uint64_t>& keys) {
    std::map<std::uint64_t, StampNs> found;
    for (const Growth::Seed& one : growth_.touched(keys, growth_.beside(keys, false)))
      found[packed(one.voxel.min)] = one.free_ns;
    return found;
  }

  std::vector<OccupiedLeaf> leaves_;
  Growth growth_;
};

TEST_F(TwoHands, WhatGrowsOnGoesByTheHandThatItTouches) {
  const VoxelTree now(leaves_);
  growth_.keep(now, now, 0, 3);
  const std::map<std::uint64_t, StampNs> both{{at(1, 0), 1}, {at(2, 0), 1}, {at(19, 0), 2}};
  EXPECT_EQ(touched({at(1, 0), at(2, 0), at(19, 0), at(10, 0)}), both);
}

TEST_F(TwoHands, BetweenBothItGoesByTheNewerOne) {
  const VoxelTree now(leaves_);
  growth_.keep(now, now, 0, 3);
  std::vector<std::uint64_t> bridge;
  for (int x = 1; x < 20; ++x) bridge.push_back(at(x, 0));
  const auto found = touched(bridge);
  ASSERT_EQ(found.size(), bridge.size());
  EXPECT_TRUE(std::all_of(found.begin(), found.end(), [](const auto& one) { return one.second == 2; }));
}

TEST_F(TwoHands, AfterAWhileAHandIsOver) {
  const VoxelTree now(leaves_);
  growth_.keep(now, now, 1, 3);
  EXPECT_EQ(touched({at(1, 0), at(19, 0)}), (std::map<std::uint64_t, StampNs>{{at(19, 0), 2}}));
}

}  // namespace
}  // namespace test
}  // namespace dccd
