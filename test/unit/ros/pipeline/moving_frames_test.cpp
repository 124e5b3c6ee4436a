// What moves by tf between the frames of the cloth, at stamps of today: rigid bodies, and the map.
#include <gtest/gtest.h>

#include <fstream>

#include "dccd/assurance.h"
#include "output/advice.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

constexpr double START_S = 1.7e9;

XmlRpcValue clothAndTip() {
  const std::string file = ::testing::TempDir() + "tip.obj";
  std::ofstream(file) << "v 0.2 0.2 0\nv 0.21 0.2 0.05\nv 0.2 0.21 0.05\nf 1 2 3\n";
  return scene("effects: {octomap: 'off'}, bodies: {cloth: {topic: cloth}, tip: {rigid: {frame: tip, mesh: " + file +
               "}}}");
}

ros::Time after(double seconds) { return ros::Time(START_S) + ros::Duration(seconds); }

struct Moving : Driven {
  explicit Moving(const XmlRpcValue& tree) : Driven(tree) {}
  void move(const std::string& child, double after_s, double z, double turn = 0) {
    tell({above(child, z, after(after_s), turn)});
  }
  /// Whether the frame has its outcome at once.
  bool offer(double after_s, float z, std::int64_t now_ns = 0) {
    take(0, cloudAt(after(after_s), z), now_ns);
    return pipeline.nextOutcome(now_ns, outcome);
  }
};

// The tip is at z 0.5 at both ends, the cloth at 0.
TEST(RigidBodies, ThatLeaveTheirPathBetweenTheEndsAreNoClearStep) {
  const auto lastOf = [](const std::vector<double>& between) {
    Moving scene(clothAndTip());
    for (int i = 0; i <= 2; ++i) scene.move("tip", 0.05 * i, 0.5);
    EXPECT_TRUE(scene.offer(0, 0));
    EXPECT_TRUE(scene.offer(0.05, 0));
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    for (std::size_t i = 0; i < between.size(); ++i) {
      scene.move("tip", 0.05 + 0.05 * static_cast<double>(i + 1) / static_cast<double>(between.size() + 1), between[i]);
    }
    EXPECT_TRUE(scene.offer(0.1, 0));
    const Outcome through = scene.outcome;
    scene.move("tip", 0.15, 0.5);
    EXPECT_TRUE(scene.offer(0.15, 0));
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << "the step after is as it was seen";
    return through;
  };
  for (const auto& dip : {std::vector<double>{-0.5}, {0.2, -0.5, -0.5, 0.2}, {0.5, 0.4985, 0.5}}) {
    const Outcome outcome = lastOf(dip);
    EXPECT_EQ(outcome.status, StepStatus::PARTIAL);
    EXPECT_TRUE(outcome.answered);
    EXPECT_FALSE(assuranceOf(outcome).proved);
    EXPECT_NE(outcome.reason.find("body 'tip' was seen up to"), std::string::npos) << outcome.reason;
    EXPECT_NE(outcome.reason.find("transforms between its ends"), std::string::npos) << outcome.reason;
  }
  EXPECT_TRUE(assuranceOf(lastOf({0.5, 0.4995, 0.5005})).clear()) << "within rigid_tolerance_m of 1 mm";
}

TEST(RigidBodies, ThatTurnEvenlyAreOnTheirPath) {
  for (const double off : {0.0, 0.1}) {
    Moving scene(clothAndTip());
    for (int i = 0; i <= 10; ++i) scene.move("tip", 0.01 * i, 0.5, 0.1 * i + (i == 7 ? off : 0));
    scene.offer(0, 0);
    scene.offer(0.05, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.offer(0.1, 0);
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), off == 0) << scene.outcome.reason;
  }
}

// A frame that is refused in between: the step is longer, and what was seen in all of it counts.
TEST(RigidBodies, AreLookedAtOverALongerStepToo) {
  Moving scene(clothAndTip());
  for (const double at : {0.0, 0.05, 0.1, 0.15}) scene.move("tip", at, 0.5);
  scene.move("tip", 0.06, -0.5);
  scene.offer(0, 0);
  scene.offer(0.05, 0);
  scene.take(0, {});
  EXPECT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
  EXPECT_EQ(scene.outcome.status, StepStatus::BAD_MESSAGE);
  scene.offer(0.15, 0);
  EXPECT_EQ(scene.outcome.status, StepStatus::PARTIAL) << scene.outcome.reason;
}

// A lookup for each of them would take as long as there are many.
TEST(RigidBodies, AFloodOfTransformsWithinAStepIsNotLookedAtAndProvesNothing) {
  Moving scene(clothAndTip());
  for (const double at : {0.0, 0.05, 0.1, 0.15}) scene.move("tip", at, 0.5);
  scene.offer(0, 0);
  for (int i = 0; i < 5000; ++i) scene.move("tip", 0.051 + 1e-8 * i, 0.5);
  scene.offer(0.05, 0);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  scene.offer(0.1, 0);
  EXPECT_EQ(scene.outcome.status, StepStatus::PARTIAL);
  EXPECT_FALSE(assuranceOf(scene.outcome).proved);
  EXPECT_NE(scene.outcome.reason.find("where body 'tip' was is not known for all of this step"), std::string::npos)
      << scene.outcome.reason;
  EXPECT_NE(adviceFor(scene.outcome.status, scene.outcome.reason, "").find("larger transform_timeout_s"),
            std::string::npos);
  scene.offer(0.15, 0);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
}

// Another frame's stamps go back, and tf begins anew, within the step in which the tip dips through the cloth.
TEST(RigidBodies, WhatTfForgotWithinAStepIsNotTakenForRest) {
  for (const double dip : {0.5, -0.5}) {
    Moving scene(clothAndTip());
    scene.move("tip", 0, 0.5);
    scene.move("tip", 0.05, 0.5);
    scene.move("far", 0.05, 0);
    scene.offer(0, 0);
    scene.offer(0.05, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.move("tip", 0.07, dip);
    scene.move("far", -2, 0);
    scene.move("tip", 0.1, 0.5);
    scene.offer(0.1, 0);
    EXPECT_EQ(scene.outcome.status, StepStatus::PARTIAL) << dip;
    EXPECT_NE(scene.outcome.reason.find("or stamps of tf that went back"), std::string::npos) << scene.outcome.reason;
    scene.move("tip", 0.15, 0.5);
    scene.offer(0.15, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  }
}

struct Mapped : Moving {
  explicit Mapped(const XmlRpcValue& tree = scene()) : Moving(tree) {}
  void giveMapIn(const std::string& frame, double after_s, std::int64_t now_ns = 0) {
    LoadedMap loaded = decodeMapMessage(map(1), config);
    loaded.frame_id = frame;
    loaded.stamp_ns = static_cast<StampNs>(after(after_s).toNSec());
    pipeline.setMap(std::move(loaded), now_ns);
  }
};

// The map's top is at 0 in its frame, the cloth hangs at 0.05.
TEST(Map, ThatMovesAgainstTheFixedFrameIsNoClearStep) {
  Mapped scene;
  for (const double at : {0.0, 0.05, 0.1}) scene.move("odom", at, -0.5);
  scene.giveMapIn("odom", 0);
  scene.offer(0, 0.05f);
  scene.offer(0.05, 0.05f);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  scene.offer(0.1, 0.05f);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  scene.move("odom", 0.12, 0.2);  // up through the cloth and back
  scene.move("odom", 0.15, -0.5);
  scene.offer(0.15, 0.05f);
  EXPECT_EQ(scene.outcome.status, StepStatus::PARTIAL);
  EXPECT_FALSE(assuranceOf(scene.outcome).proved);
  EXPECT_NE(scene.outcome.reason.find("the octomap's frame 'odom' was seen up to 0.7 m"), std::string::npos)
      << scene.outcome.reason;
  scene.move("odom", 0.2, -0.5);
  scene.offer(0.2, 0.05f);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << "it is back: " << scene.outcome.reason;
  scene.move("odom", 0.25, -0.3);
  scene.offer(0.25, 0.05f);
  EXPECT_FALSE(assuranceOf(scene.outcome).proved);
  EXPECT_FALSE(assuranceOf(scene.pipeline.checkNow()).proved) << "nor by a question";
  scene.move("odom", 0.3, -0.3);
  scene.offer(0.3, 0.05f);
  EXPECT_FALSE(assuranceOf(scene.outcome).proved) << "it stays where the map is not held";
  scene.giveMapIn("odom", 0.3);
  scene.move("odom", 0.35, -0.3);
  scene.offer(0.35, 0.05f);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << "a map of now: " << scene.outcome.reason;
}

// It is up in the cloth at the very stamp of a frame: both steps that have this frame are of that time.
TEST(Map, ThatIsElsewhereWhereOneStepEndsAndTheNextBeginsIsInNeitherClear) {
  Mapped scene;
  for (int i = 0; i <= 4; ++i) scene.move("odom", 0.05 * i, i == 2 ? 0.2 : -0.5);
  scene.giveMapIn("odom", 0);
  for (int i = 0; i <= 4; ++i) {
    scene.offer(0.05 * i, 0.05f);
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), i == 1 || i == 4) << i << ": " << scene.outcome.reason;
  }
}

// What moved before the first map came, in the step in which it comes.
TEST(Map, WhoseFrameMovedBeforeItCameIsNoClearStep) {
  for (const bool moves : {false, true}) {
    Mapped scene;
    for (const double at : {0.0, 0.05}) scene.move("odom", at, moves ? 0.2 : -0.5);
    for (const double at : {0.08, 0.1, 0.15}) scene.move("odom", at, -0.5);
    scene.offer(0, 0.05f);
    scene.offer(0.05, 0.05f);
    scene.giveMapIn("odom", 0.08);
    scene.offer(0.1, 0.05f);
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), !moves) << scene.outcome.reason;
    scene.offer(0.15, 0.05f);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  }
}

// Where a step begins, between two transforms: the frame before it had another stamp, or its transform came later.
TEST(Map, ThatIsElsewhereWhereAStepBeginsIsNoClearStep) {
  for (const bool moves : {false, true}) {
    Mapped scene;
    for (const double at : {0.0, 0.2, 0.24}) scene.move("odom", at, -0.5);
    scene.giveMapIn("odom", 0);
    const auto moveAround = [&](double at) {
      scene.move("odom", at - 0.001, moves ? 0.6 : -0.5);
      scene.move("odom", at + 0.001, -0.5);
    };
    moveAround(0.25);
    for (const double at : {0.3, 0.35}) scene.move("odom", at, -0.5);
    for (const double at : {0.3, 0.35}) scene.offer(at, 0.05f);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.offer(0.25, 0.05f);
    EXPECT_EQ(scene.outcome.status, StepStatus::TIME_JUMP);
    scene.offer(0.3, 0.05f);
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), !moves) << "after a jump back: " << scene.outcome.reason;
    scene.offer(0.35, 0.05f);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.offer(0.4, 0.05f, 0);
    scene.move("odom", 0.4, -0.5);
    EXPECT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));

    Mapped late;
    for (const double at : {0.0, 0.04}) late.move("odom", at, -0.5);
    for (const double at : {0.0, 0.05}) late.offer(at, 0.05f);
    late.giveMapIn("odom", 0.04);
    late.pipeline.nextOutcome(0, late.outcome);
    late.move("odom", 0.049, moves ? 0.6 : -0.5);
    for (const double at : {0.051, 0.1}) late.move("odom", at, -0.5);
    late.offer(0.1, 0.05f);
    EXPECT_EQ(late.outcome.status == StepStatus::OK, !moves) << late.outcome.reason;
    EXPECT_EQ(assuranceOf(late.outcome).clear(), !moves) << "after a map that came before it: " << late.outcome.reason;
  }
}

// The map comes when several steps wait, together longer than a step may be: it is asked where it was in each of them.
TEST(Map, ThatComesLateIsLookedAtInAllStepsThatWait) {
  for (const int off : {-1, 0, 1, 3}) {  // between two transforms, before the step's begin; or the last one of all
    Mapped scene(
        test::scene("max_step_s: 0.08, sync_timeout_s: 1.0, clock_body: cloth, bodies: {cloth: {topic: cloth}, "
                    "other: {topic: other}}"));
    for (int i = 0; i <= 4; ++i) {
      scene.move("odom", 0.05 * i - 0.001, i == off ? 0.6 : -0.5);
      scene.move("odom", 0.05 * i + 0.001, -0.5);
    }
    for (int i = 0; i <= 4; ++i) scene.offer(0.05 * i, 0.05f);
    EXPECT_EQ(scene.outcome.status, StepStatus::FIRST_FRAME);
    scene.giveMapIn("odom", 0.21);
    scene.move("odom", 0.25, -0.5);
    for (int i = 0; i <= 4; ++i) {
      scene.take(1, cloudAt(after(0.05 * i), 1));
      ASSERT_EQ(scene.pipeline.nextOutcome(0, scene.outcome), i > 0);
      if (i == 0) continue;
      EXPECT_EQ(assuranceOf(scene.outcome).clear(), off != i && off != i - 1)
          << off << " " << i << ": " << scene.outcome.reason;
    }
  }
}

// A map of another frame comes while a step waits that is before its stamp.
TEST(Map, ThatMovesIsSeenAlsoWhereTheNextMapHasAnotherFrame) {
  Mapped scene(
      test::scene("own_voxels_m: auto, clock_body: cloth, bodies: {cloth: {topic: cloth}, other: {topic: other}}"));
  for (const double at : {0.0, 0.05, 0.1, 0.15}) scene.move("odom", at, -0.5);
  scene.move("odom", 0.07, 0.2);
  scene.giveMapIn("odom", 0);
  for (const double at : {0.0, 0.05}) {
    scene.take(1, cloudAt(after(at), 1));
    scene.offer(at, 0.05f);
  }
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  EXPECT_FALSE(scene.offer(0.1, 0.05f)) << "the other one's frame is to come";
  scene.giveMapIn("world", 0.12);
  scene.take(1, cloudAt(after(0.1), 1));
  EXPECT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
  EXPECT_FALSE(assuranceOf(scene.outcome).proved) << "through the cloth and back";
}

TEST(Map, WhoseFrameNobodyTellsOfIsNoClearStep) {
  Mapped scene;
  scene.move("odom", 0, -0.5);
  scene.move("odom", 0.05, -0.5);
  scene.giveMapIn("odom", 0);
  scene.offer(0, 0.05f);
  scene.offer(0.05, 0.05f);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear());
  EXPECT_FALSE(scene.offer(0.1, 0.05f)) << "waits for the transform";
  EXPECT_TRUE(scene.pipeline.nextOutcome(1000000000, scene.outcome));
  EXPECT_EQ(scene.outcome.status, StepStatus::PARTIAL);
  EXPECT_FALSE(assuranceOf(scene.outcome).proved);
  EXPECT_NE(scene.outcome.reason.find("where the octomap's frame 'odom' was is not known for all of this step"),
            std::string::npos)
      << scene.outcome.reason;
}

// The cloth's frame is a camera's, from which the fixed frame is learnt; the table's is at rest.
TEST(StaticBodies, InAFixedFrameThatMovesAreNoClearStep) {
  for (const bool named : {false, true}) {
    const std::string frame = named ? "fixed_frame: world, " : "";
    Moving scene(parameters(frame + "max_vertex_step_m: 0.0, effects: {octomap: 'off'}, " + CLOTH_AND_TABLE));
    for (int i = 0; i < 6; ++i) scene.move("table", 0.05 * i, i < 3 ? -0.5 : 0.5);
    const std::size_t table = 1;
    scene.take(table, cloud(START_S, 0, {}, "table"));
    for (int i = 0; i < 3; ++i) scene.offer(0.05 * i, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.offer(0.15, 0);
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), named) << "the table was where it was seen; whose frame moved?";
    if (named) continue;
    EXPECT_EQ(scene.outcome.status, StepStatus::PARTIAL);
    EXPECT_NE(scene.outcome.reason.find("the frame of the static body 'table' was seen up to 1 m"), std::string::npos)
        << scene.outcome.reason;
    scene.take(table, cloudAt(after(0.15), 0, "table"));
    scene.offer(0.2, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << "a frame of now: " << scene.outcome.reason;
  }
}

// octomap_server sends its map once, before the monitor hears of tf.
TEST(Map, ThatIsOlderThanAllOfTfIsPlacedByTheFirstTransform) {
  Mapped scene;
  scene.giveMapIn("odom", -60);
  scene.offer(0, 0.05f);
  scene.pipeline.nextOutcome(1000000000, scene.outcome);
  EXPECT_FALSE(scene.offer(0.05, 0.05f, 1000000000) && scene.outcome.status != StepStatus::NO_MAP);
  for (const double at : {0.1, 0.15, 0.2}) scene.move("odom", at, -0.5);
  scene.offer(0.1, 0.05f, 2000000000);
  scene.offer(0.15, 0.05f, 2000000000);
  EXPECT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
  EXPECT_TRUE(scene.outcome.obstacle);
  const std::string note = scene.pipeline.takeMapNote();
  EXPECT_NE(note.find("it is placed by the first, 60.1 s after its stamp"), std::string::npos) << note;
  EXPECT_EQ(scene.pipeline.takeMapNote(), "");
  scene.offer(0.2, -0.6f, 2000000000);
  EXPECT_FALSE(scene.outcome.contacts.empty()) << "its top is at -0.5";
}

// One that came before a frame, but has no place yet, is waited for.
TEST(Map, AFrameWaitsForTheMapThatCameBeforeIt) {
  Mapped scene;
  for (const double at : {0.0, 0.05, 0.1}) scene.move("odom", at, -0.5);
  scene.giveMapIn("odom", 0);
  scene.offer(0, 0.05f);
  scene.offer(0.05, 0.05f);
  scene.giveMapIn("odom", 0.11, 100000000);
  EXPECT_FALSE(scene.offer(0.1, 0.05f, 100000000)) << "the newer map may have its place soon";
  scene.move("odom", 0.12, 0);
  EXPECT_TRUE(scene.pipeline.nextOutcome(150000000, scene.outcome));
  EXPECT_NEAR(scene.pipeline.monitor().map().map_from_fixed.translation().z(), 0.25, 1e-6) << "between -0.5 and 0";
  scene.giveMapIn("nowhere", 0.2, 200000000);
  scene.move("odom", 0.15, 0);
  EXPECT_FALSE(scene.offer(0.15, 0.2f, 200000000));
  EXPECT_TRUE(scene.pipeline.nextOutcome(500000000, scene.outcome)) << "but not for ever";
  EXPECT_FALSE(assuranceOf(scene.outcome).proved);
}

}  // namespace
}  // namespace test
}  // namespace dccd
