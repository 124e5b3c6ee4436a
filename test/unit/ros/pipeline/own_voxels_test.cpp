// Own voxels through parameters, messages and map files.
#include <gtest/gtest.h>

#include <fstream>

#include "dccd/assurance.h"
#include "support/folder_test.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

/// The table, and the voxels in which the cloth of cloud() lies at z = 0.35.
octomap::OcTree tableAnd(bool cloth) {
  octomap::OcTree tree = table();
  for (int x = 0; x < 5; ++x) {
    for (int y = 0; y < 5; ++y) {
      const bool lies = cloth && x >= 1 && x <= 2 && y >= 1 && y <= 2;
      tree.updateNode(0.1 * x + 0.05, 0.1 * y + 0.05, 0.35, lies);
    }
  }
  return tree;
}

class OwnVoxelsOfANode : public FolderTest {};

TEST_F(OwnVoxelsOfANode, WithALiveMapAloneTheFirstOneIsInDoubt) {
  Driven driven(scene("own_voxels_m: auto, octomap_topic: /map"));
  driven.feed(1, 0.35f);
  driven.giveMap(tableAnd(true), 1);
  const Outcome& doubted = driven.feed(1.1, 0.35f);
  EXPECT_EQ(doubted.touching, Touching::NONE);
  EXPECT_NE(describe(assuranceOf(doubted)).find("there in the first map"), std::string::npos);
  driven.giveMap(tableAnd(false), 1.1);
  EXPECT_TRUE(assuranceOf(driven.feed(1.2, 0.35f)).clear());
  driven.giveMap(tableAnd(true), 1.2);
  const Outcome& own = driven.feed(1.3, 0.35f);
  EXPECT_TRUE(assuranceOf(own).clear()) << describe(assuranceOf(own));
  EXPECT_EQ(own.step->map.own.own, 4u);
  EXPECT_TRUE(own.step->map.known) << "what is free is asked for";
  EXPECT_EQ(driven.feed(1.4, -0.05f).touching, Touching::NEW) << "the table stays";
}

TEST_F(OwnVoxelsOfANode, AnEmptyMapHasNotSeenTheTableFree) {
  Driven driven(scene("own_voxels_m: auto, octomap_topic: /map"));
  driven.feed(1, 0.35f);
  driven.giveMap(tableAnd(false), 1);
  driven.feed(1.1, 0.35f);
  driven.giveMap(octomap::OcTree(0.1), 1.1);
  driven.feed(1.2, 0.35f);
  driven.feed(1.3, 0.05f);
  driven.giveMap(tableAnd(false), 1.3);
  const Outcome& near = driven.feed(1.4, 0.05f);
  EXPECT_TRUE(assuranceOf(near).clear()) << describe(assuranceOf(near));
  EXPECT_EQ(driven.feed(1.5, -0.05f).touching, Touching::NEW) << "it was there before the cloth came";
}

TEST_F(OwnVoxelsOfANode, MapsOfACellWithoutTheBodyCountAlsoBeforeItsFirstFrame) {
  Driven driven(scene("own_voxels_m: auto, octomap_topic: /map"));
  driven.giveMap(tableAnd(false), 0.8);
  driven.giveMap(tableAnd(true), 1);
  driven.feed(1, 0.35f);
  const Outcome& outcome = driven.feed(1.1, 0.35f);
  EXPECT_TRUE(assuranceOf(outcome).clear()) << describe(assuranceOf(outcome));
  EXPECT_EQ(outcome.step->map.own.own, 4u);
}

TEST_F(OwnVoxelsOfANode, WithAMapFileBesideNothingIsInDoubtThatLiesThere) {
  const std::string file = (folder_ / "table.bt").string();
  ASSERT_TRUE(tableAnd(false).writeBinary(file));
  Driven driven(scene("own_voxels_m: 0.2, octomap_topic: /map, octomap_file: " + file));
  driven.pipeline.setMap(loadMapFile(file, driven.config), 0);
  driven.feed(1, 0.15f);
  EXPECT_EQ(driven.feed(1.1, 0.15f).status, StepStatus::NO_MAP) << "the live one is missed";
  driven.giveMap(tableAnd(false), 1.1);
  const Outcome& near = driven.feed(1.2, 0.15f);
  EXPECT_TRUE(assuranceOf(near).clear()) << "the table is within reach, but trusted: " << describe(assuranceOf(near));
  EXPECT_EQ(driven.feed(1.3, -0.05f).touching, Touching::NEW);
  // The file alone is a map as before.
  Driven single(scene("own_voxels_m: 0.2, octomap_file: " + file));
  single.pipeline.setMap(loadMapFile(file, single.config), 0);
  single.feed(1, 0.15f);
  EXPECT_TRUE(assuranceOf(single.feed(1.1, 0.15f)).clear());
  EXPECT_EQ(single.feed(1.2, -0.05f).touching, Touching::NEW);
}

TEST_F(OwnVoxelsOfANode, AMapFileBesideThatCannotBeReadIsNoMap) {
  Driven driven(scene("octomap_topic: /map, octomap_file: /nowhere/table.bt"));
  driven.pipeline.setMap(loadMapFile("/nowhere/table.bt", driven.config), 0);
  driven.feed(1, 0.35f);
  driven.giveMap(tableAnd(false), 1);
  const Outcome& outcome = driven.feed(1.1, 0.35f);
  EXPECT_EQ(outcome.status, StepStatus::NO_MAP);
  EXPECT_NE(outcome.reason.find("/nowhere/table.bt"), std::string::npos) << outcome.reason;
}

}  // namespace
}  // namespace test
}  // namespace dccd
