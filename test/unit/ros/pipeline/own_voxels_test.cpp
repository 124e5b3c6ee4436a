// Own voxels through parameters, messages and map files.
#include <gtest/gtest.h>

#include <atomic>
#include <fstream>
#include <mutex>
#include <thread>

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
  EXPECT_NE(describe(assuranceOf(doubted)).find("that no look has told from an obstacle"), std::string::npos);
  driven.feed(1.2, 0.7f);
  driven.giveMap(tableAnd(false), 1.2);
  driven.feed(1.3, 0.7f);
  driven.giveMap(tableAnd(false), 1.3);
  EXPECT_TRUE(assuranceOf(driven.feed(1.4, 0.35f)).clear()) << "seen free without the cloth";
  driven.giveMap(tableAnd(true), 1.4);
  const Outcome& own = driven.feed(1.5, 0.35f);
  EXPECT_TRUE(assuranceOf(own).clear()) << describe(assuranceOf(own));
  EXPECT_EQ(own.step->map.own.own, 4u);
  EXPECT_TRUE(own.step->map.known) << "what is free is asked for";
  EXPECT_EQ(driven.feed(1.6, -0.05f).touching, Touching::NEW) << "the table stays";
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

// The second map shows what the third one does, from when the cloth was far from there.
TEST_F(OwnVoxelsOfANode, AMapThatIsRefusedOrGivesWayLeavesInDoubtWhatTheNextOneShows) {
  enum class Second { USED, REFUSED, WITHOUT_PLACE };
  for (const Second second : {Second::USED, Second::REFUSED, Second::WITHOUT_PLACE}) {
    Driven driven(scene("own_voxels_m: auto, octomap_topic: /map"));
    driven.feed(1, 0.8f);
    driven.giveMap(tableAnd(false), 1);
    ASSERT_TRUE(assuranceOf(driven.feed(1.1, 0.8f)).clear());
    LoadedMap map = decodeMapMessage(mapOf(tableAnd(true), 1.1), driven.config);
    if (second == Second::WITHOUT_PLACE) map.frame_id = "nowhere";
    if (second == Second::REFUSED) map.surface = nullptr, map.problem = "a test";
    driven.pipeline.setMap(std::move(map), 0);
    for (const auto& [stamp_s, z] : {std::pair(1.2, 0.8f), {1.5, 0.8f}, {1.8, 0.45f}}) {
      driven.take(0, cloud(stamp_s, z));
      EXPECT_TRUE(driven.pipeline.nextOutcome(1000000000, driven.outcome));  // no transform comes
    }
    driven.giveMap(tableAnd(true), 1.8);
    const Outcome& reached = driven.feed(1.9, 0.35f);
    EXPECT_FALSE(assuranceOf(reached).clear()) << static_cast<int>(second);
    EXPECT_EQ(reached.step->map.own.doubted, second == Second::USED ? 0u : 4u) << static_cast<int>(second);
  }
}

// A map that is stamped ahead of the bodies' frames waits for these, but not for ever.
TEST_F(OwnVoxelsOfANode, AMapThatWaitsForTheFramesHasItsTime) {
  for (const bool is_given : {true, false}) {
    Driven driven(scene("own_voxels_m: auto, octomap_topic: /map"));
    driven.feed(1, 0.8f);
    driven.giveMap(tableAnd(false), 1);
    ASSERT_TRUE(assuranceOf(driven.feed(1.1, 0.8f)).clear());
    LoadedMap ahead = decodeMapMessage(mapOf(tableAnd(true), 3), driven.config);
    ahead.arrival_ns = 1;
    if (is_given) driven.pipeline.setMap(std::move(ahead), 1);
    for (const auto& [now_s, in_time] : {std::pair(0.4, true), {0.6, !is_given}}) {
      driven.take(0, cloud(1.2 + now_s / 10, 0.8f));
      ASSERT_TRUE(driven.pipeline.nextOutcome(static_cast<std::int64_t>(now_s * 1e9), driven.outcome));
      const std::string said = describe(assuranceOf(driven.outcome));
      EXPECT_EQ(assuranceOf(driven.outcome).clear(), in_time) << now_s << " " << said;
      const bool is_named = said.find("a newer map came and has not been in use for more than 0.5 s") < said.size();
      EXPECT_EQ(is_named, !in_time) << said;
    }
  }
}

// Which of the ways it was is said, where nobody looked for more than half a second.
TEST_F(OwnVoxelsOfANode, WhyMapsWereNotLookedAtIsSaid) {
  Driven driven(scene("own_voxels_m: auto, octomap_topic: /map"));
  driven.feed(1, 0.35f);
  driven.giveMap(tableAnd(true), 1);
  const auto saidAfter = [&](double stamp_s, std::uint64_t number = 0, const LoadedMap& lost = {}) {
    for (const double before_s : {0.4, 0.2, 0.0}) driven.feed(stamp_s - before_s, 0.35f);
    if (!lost.frame_id.empty()) driven.pipeline.setMap(lost, 0);
    LoadedMap map = decodeMapMessage(mapOf(tableAnd(true), stamp_s), driven.config);
    map.number = number;
    driven.pipeline.setMap(std::move(map), 0);
    driven.feed(stamp_s + 0.1, 0.35f);
    return describe(assuranceOf(driven.outcome));
  };
  const std::string late = saidAfter(1.6, 4);
  EXPECT_NE(
      late.find("4 voxels near body 'mesh' that no look has told from an obstacle, after 0.6 s without a look, in "
                "which 2 maps were not looked at (they come faster than they are used; send fewer)"),
      std::string::npos)
      << late;
  LoadedMap refused, lost = decodeMapMessage(mapOf(tableAnd(true), 2.3), driven.config);
  refused.problem = "a test";
  driven.pipeline.setMap(refused, 0);
  EXPECT_NE(saidAfter(2.2).find("in which 1 map was not looked at (a test)"), std::string::npos);
  lost.frame_id = "nowhere";
  EXPECT_NE(saidAfter(2.8, 0, lost).find("(one got no transform to its frame before the next one did)"),
            std::string::npos);
}

// While a map is decoded, or the worker is in a step, more of them come.
TEST_F(OwnVoxelsOfANode, TheLoaderKeepsFinishedMapsAndSaysWhichCameAfterOthers) {
  for (const bool owns : {true, false}) {
    Driven driven(scene(std::string("octomap_topic: /map") + (owns ? ", own_voxels_m: auto" : "")));
    std::mutex decoding;
    std::unique_lock<std::mutex> hold(decoding);
    std::atomic<int> count{0};
    MapLoader loader(driven.config, driven.feed_tf, [&] {
      ++count;
      const std::lock_guard<std::mutex> wait(decoding);
    });
    const auto submit = [&](int stamp_s) { loader.submit({0, "octomap_msgs/Octomap", map(stamp_s), 0}, stamp_s); };
    const auto finished = [&](int maps) {
      while (count < maps) std::this_thread::yield();
    };
    submit(1);
    finished(1);
    submit(2);  // gives way to the third
    submit(3);
    hold.unlock();
    finished(2);
    for (int i = 4; i <= 7; ++i) {
      submit(i);
      finished(i - 1);
    }
    loader.lose();
    submit(8);
    finished(7);
    std::vector<std::pair<StampNs, std::uint64_t>> taken;
    for (LoadedMap one; loader.take(one);) taken.emplace_back(one.stamp_ns / 1000000000, one.number);
    if (owns) {
      const std::vector<std::pair<StampNs, std::uint64_t>> first_and_last{{1, 1}, {3, 3}, {4, 4}, {8, 9}};
      EXPECT_EQ(taken, first_and_last) << "numbers that are missing tell of the others";
    } else {
      ASSERT_EQ(taken.size(), 1u);
      EXPECT_EQ(taken[0].first, 8);
    }
  }
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
