// What the map does not know, as `unknown_space` has it: ignored or an obstacle.
#include <gtest/gtest.h>

#include "dccd/assurance.h"
#include "support/folder_test.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

TEST(UnknownSpace, FreeIsWhatNobodyAskedAbout) {
  Driven free(scene());
  EXPECT_EQ(decodeMapMessage(map(1), free.config).known, nullptr) << "nothing is built of it";
  free.giveMap(1);
  free.feed(1, 0.35f);
  const Outcome& outcome = free.feed(1.1, 0.15f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_TRUE(assuranceOf(outcome).clear()) << "the unknown is no obstacle";
  EXPECT_FALSE(free.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

TEST(UnknownSpace, OccupiedIsAnObstacleWithinItsBox) {
  Driven occupied(scene("unknown_space: occupied, unknown_box: [0, 0, 0, 0.5, 0.5, 0.6]"));
  occupied.giveMap(1);
  occupied.feed(1, 0.12f);
  const Outcome& outcome = occupied.feed(1.1, 0.28f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_FALSE(outcome.contacts.empty()) << "from the known into the unknown";
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-4);
  EXPECT_TRUE(occupied.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

class UnknownSpaceOfAFile : public FolderTest {};

/// The table, free up to 0.8 but where told to be unknown, and the voxels in which cloud() lies at this height.
octomap::OcTree shadowed(int cloth, int unknown_below) {
  octomap::OcTree tree = table();
  for (int x = 0; x < 5; ++x) {
    for (int y = 0; y < 5; ++y) {
      const bool lies = x >= 1 && x <= 2 && y >= 1 && y <= 2;
      for (int z = 0; z < 8; ++z) {
        const octomap::point3d at(0.1f * x + 0.05f, 0.1f * y + 0.05f, 0.1f * z + 0.05f);
        if (lies && z < unknown_below) {
          tree.deleteNode(at);
        } else {
          tree.updateNode(at, lies && z == cloth);
        }
      }
    }
  }
  return tree;
}

// A camera above the cloth, of which each map has what one look saw.
TEST(UnknownSpace, AClothThatHidesWhatWasFreeOwnsItAndNothingBelow) {
  Driven driven(
      scene("own_voxels_m: 0.12, octomap_topic: /map, unknown_space: occupied, "
            "unknown_box: [0, 0, 0, 0.5, 0.5, 0.8]"));
  driven.feed(1, 1.5f);
  driven.giveMap(shadowed(-1, 0), 1);
  ASSERT_TRUE(assuranceOf(driven.feed(1.1, 1.5f)).clear()) << describe(assuranceOf(driven.outcome));
  driven.feed(1.2, 0.55f);
  driven.giveMap(shadowed(5, 5), 1.2);
  const Outcome& hides = driven.feed(1.3, 0.55f);
  EXPECT_TRUE(assuranceOf(hides).clear()) << describe(assuranceOf(hides));
  EXPECT_EQ(hides.step->map.own.own, 4u + 4u) << "the cloth's, and what is hidden within reach";
  EXPECT_TRUE(assuranceOf(driven.feed(1.4, 0.45f)).clear()) << "into what it hid";
  EXPECT_EQ(driven.feed(1.5, 0.35f).touching, Touching::NEW) << "what was unknown out of its reach is an obstacle";
}

// A file is nobody's: what is unknown to it is an obstacle whatever a body hides.
TEST_F(UnknownSpaceOfAFile, IsAnObstacleWithOwnVoxelsToo) {
  const std::string file = (folder_ / "free.bt").string();
  ASSERT_TRUE(shadowed(-1, 3).writeBinary(file));
  Driven driven(scene(
      "own_voxels_m: 0.12, unknown_space: occupied, unknown_box: [0, 0, 0, 0.5, 0.5, 0.8], octomap_file: " + file));
  driven.pipeline.setMap(loadMapFile(file, driven.config), 0);
  driven.feed(1, 0.75f);
  EXPECT_TRUE(assuranceOf(driven.feed(1.1, 0.35f)).clear()) << describe(assuranceOf(driven.outcome));
  EXPECT_EQ(driven.feed(1.2, 0.25f).touching, Touching::NEW);
}

// Attack: the box is put where nobody looks, and comes to light with the cloth.
TEST(UnknownSpace, WhatHidesInTheUnknownIsNeverClear) {
  for (const int looks : {0, 1, 6}) {
    Driven driven(
        scene("own_voxels_m: 0.12, octomap_topic: /map, unknown_space: occupied, "
              "unknown_box: [0, 0, 0, 0.5, 0.5, 0.8]"));
    double now_s = 1;
    driven.feed(now_s, 1.5f);
    driven.giveMap(shadowed(-1, 0), now_s);
    for (int k = 0; k <= looks; ++k) {  // a hand over it: maps leave it out, and nobody is near
      driven.feed(now_s += 0.1, 1.5f);
      driven.giveMap(shadowed(-1, 7), now_s);
    }
    driven.feed(now_s += 0.1, 0.75f);
    driven.giveMap(shadowed(-1, 7), now_s);
    EXPECT_FALSE(assuranceOf(driven.feed(now_s += 0.1, 0.65f)).clear()) << looks;
    driven.giveMap(shadowed(6, 0), now_s);  // of the box, not of the cloth
    EXPECT_FALSE(assuranceOf(driven.feed(now_s += 0.1, 0.65f)).clear()) << looks;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
