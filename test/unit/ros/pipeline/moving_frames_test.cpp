// What moves by tf between the frames of the cloth, at stamps of today: rigid bodies, and the map.
#include <gtest/gtest.h>

#include <cmath>
#include <deque>
#include <fstream>
#include <map>

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
TEST(RigidBodies, AreFollowedBetweenTheEnds) {
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
  for (const auto& dip : {std::vector<double>{-0.5}, {0.2, -0.5, -0.5, 0.2}}) {
    const Outcome outcome = lastOf(dip);
    ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
    EXPECT_EQ(assuranceOf(outcome).touching, Touching::NEW) << "through the cloth and back";
    EXPECT_NEAR(outcome.earliest_toc, dip.size() == 1 ? 0.25 : 0.2 + 0.2 * 2 / 7, 0.01);
  }
  for (const auto& dip : {std::vector<double>{0.5, 0.4985, 0.5}, {0.5, 0.4995, 0.5005}, {0.2, 0.01, 0.2}}) {
    EXPECT_TRUE(assuranceOf(lastOf(dip)).clear());
  }
  const Outcome wild = lastOf({0.5, 0.5, -30, 0.5, 0.5, 0.5, 30});
  EXPECT_EQ(wild.status, StepStatus::OK) << "eight equal parts meet it: " << wild.reason;
}

TEST(RigidBodies, ThatTurnEvenlyNeedNoWaypoints) {
  for (const double off : {0.0, 0.1}) {
    Moving scene(clothAndTip());
    for (int i = 0; i <= 10; ++i) scene.move("tip", 0.01 * i, 0.5, 0.1 * i + (i == 7 ? off : 0));
    scene.offer(0, 0);
    scene.offer(0.05, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.offer(0.1, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    EXPECT_EQ(scene.outcome.step->bodies[1].waypoints.empty(), off == 0);
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
  EXPECT_NE(scene.outcome.reason.find("where body 'tip' was is not known for all of this step (more than 1024"),
            std::string::npos)
      << scene.outcome.reason;
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
    EXPECT_NE(scene.outcome.reason.find("stamps of tf went back"), std::string::npos) << scene.outcome.reason;
    scene.move("tip", 0.15, 0.5);
    scene.offer(0.15, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  }
}

// An arm lays the tip down on a stand: what carried it until then dips through the cloth after the tip was last sent
// with it. From the next step on all is as before. `ahead`: all of tf is there before the first step, as in a bag.
TEST(RigidBodies, WhoseFrameHasAnotherParentWithinAStepHaveNoPlaceInIt) {
  for (const bool ahead : {false, true}) {
    for (const double dip : {0.5, -0.5}) {
      Moving scene(clothAndTip());
      const auto send = [&](int i) {
        if (i == 3) scene.move("arm", 0.12, dip);
        for (const char* frame : {"arm", "stand"}) scene.move(frame, 0.05 * i, 0.5);
        geometry_msgs::TransformStamped tip = above("tip", 0, after(0.05 * i));
        tip.header.frame_id = i < 3 ? "arm" : "stand";
        scene.tell({tip});
      };
      for (int i = 0; ahead && i <= 5; ++i) send(i);
      for (int i = 0; i <= 5; ++i) {
        if (!ahead) send(i);
        scene.offer(0.05 * i, 0);
        if (i == 0) continue;
        EXPECT_EQ(assuranceOf(scene.outcome).clear(), i != 3) << i << ": " << scene.outcome.reason;
        if (i != 3) continue;
        EXPECT_EQ(scene.outcome.status, StepStatus::PARTIAL);
        EXPECT_EQ(scene.outcome.reason.find("where body 'tip' was is not known for all of this step (frame 'tip' "
                                            "changed its parent from 'arm' to 'stand' at 1700000000.150000000 s)"),
                  0u)
            << scene.outcome.reason;
      }
    }
  }
}

// The end of a step lies between the last transform by the arm and the first one by the stand: tf2 leaves the tip with
// the arm until then, and nobody said so.
TEST(RigidBodies, WhoseFrameIsHandedOverAroundTheEndOfAStepHaveNoPlaceAroundIt) {
  Moving scene(clothAndTip());
  for (int i = 0; i <= 8; ++i) {
    const double at = 0.03 * i - 0.01;
    for (const char* frame : {"arm", "stand"}) scene.move(frame, at, 0.5);
    geometry_msgs::TransformStamped tip = above("tip", 0, after(at));
    tip.header.frame_id = at < 0.1 ? "arm" : "stand";
    scene.tell({tip});
  }
  for (const double at : {0.0, 0.05, 0.1, 0.15, 0.2}) {
    scene.offer(at, 0);
    const bool is_known = at == 0.05 || at == 0.2;
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), is_known) << at << ": " << scene.outcome.reason;
    if (at == 0 || is_known) continue;
    EXPECT_NE(scene.outcome.reason.find("frame 'tip' changed its parent from 'arm' to 'stand' at"), std::string::npos)
        << scene.outcome.reason;
  }
}

// As in a bag, where all of tf is there: the arm that has the tip dips within a step that is long over when the tip is
// laid down.
TEST(RigidBodies, AreLookedAtByWhatCarriedThemThen) {
  for (const double dip : {0.5, -0.5}) {
    Moving scene(clothAndTip());
    for (const double at : {0.0, 0.05, 0.1, 0.15, 0.2}) {
      scene.move("arm", at, 0.5);
      scene.move("stand", at, 0.5);
      geometry_msgs::TransformStamped tip = above("tip", 0, after(at));
      tip.header.frame_id = at < 0.18 ? "arm" : "stand";
      scene.tell({tip});
    }
    scene.move("arm", 0.07, dip);
    scene.move("arm", 0.072, 0.5);  // before the middle of the step, which is looked at as well
    scene.offer(0, 0);
    scene.offer(0.05, 0);
    scene.offer(0.1, 0);
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), dip > 0) << scene.outcome.reason;
  }
}

// A static transform holds at all times: once it is another one nobody knows since when the tip is elsewhere.
TEST(RigidBodies, WhoseStaticTransformBecomesAnotherOneHaveNoPlaceInThatStep) {
  for (const bool changes : {false, true}) {
    Moving scene(clothAndTip());
    tf2_msgs::TFMessage tip;
    tip.transforms = {above("tip", 0)};
    tip.transforms[0].header.frame_id = "arm";
    scene.feed_tf.add(tip, true);
    for (const double at : {0.0, 0.05, 0.07, 0.1, 0.15}) {
      scene.move("arm", at, at == 0.07 ? -0.5 : 0.5);
      scene.move("stand", at, 0.5);
    }
    scene.offer(0, 0);
    scene.offer(0.05, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    if (changes) tip.transforms[0].header.frame_id = "stand";
    scene.feed_tf.add(tip, true);
    scene.offer(0.1, 0);
    EXPECT_FALSE(assuranceOf(scene.outcome).clear()) << "the arm dips through the cloth";
    EXPECT_EQ(scene.outcome.status, changes ? StepStatus::PARTIAL : StepStatus::OK) << scene.outcome.reason;
    EXPECT_EQ(scene.outcome.reason.find("or a static transform is another one") != std::string::npos, changes)
        << scene.outcome.reason;
    scene.offer(0.15, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  }
}

// tf keeps 10 s.
TEST(RigidBodies, OfAStepThatIsLongerThanTfRemembersAreNoClearOne) {
  XmlRpcValue tree = clothAndTip();
  tree["max_step_s"] = 30.0;
  for (const double length_s : {9.0, 15.0}) {
    Moving scene(tree);
    scene.move("tip", 0, 0.5);
    scene.offer(0, 0);
    for (int at = 1; at <= 15; ++at) scene.move("tip", at, at == 2 && length_s > 9 ? -0.5 : 0.5);
    scene.offer(length_s, 0);
    EXPECT_EQ(assuranceOf(scene.outcome).clear(), length_s < 9) << scene.outcome.reason;
  }
}

// Arms that turn in two joints, faster and slower, 0.3 m a link: at each rate of tf and of the cloth all of it is
// proved.
TEST(RigidBodies, OfAnArmThatSwingsAreProvedInEachStep) {
  struct Rates {
    double speed, tf_hz, cloth_hz;
  };
  for (const Rates& rates : {Rates{1, 500, 30}, Rates{1.5, 30, 10}, Rates{1.5, 100, 30}}) {
    Moving scene(clothAndTip());
    std::size_t proved = 0, steps = 0, in_parts = 0;
    double told = -0.2;
    for (int k = 0; k <= static_cast<int>(3 * rates.cloth_hz); ++k) {
      const double at = k / rates.cloth_hz;
      for (; told < at + 1.5 / rates.tf_hz; told += 1 / rates.tf_hz) {
        const double angle = rates.speed / 2 * std::sin(2 * told);
        geometry_msgs::TransformStamped shoulder = above("shoulder", 0.8, after(told), angle),
                                        elbow = above("elbow", 0, after(told), angle),
                                        tip = above("tip", 0, after(told));
        elbow.header.frame_id = "shoulder";
        tip.header.frame_id = "elbow";
        elbow.transform.translation.x = tip.transform.translation.x = 0.3;
        scene.tell({shoulder, elbow, tip});
      }
      ASSERT_TRUE(scene.offer(at, 0));
      if (k == 0) continue;
      ASSERT_TRUE(scene.outcome.answered) << scene.outcome.reason;
      ++steps;
      proved += assuranceOf(scene.outcome).clear();
      in_parts += !scene.outcome.step->bodies[1].waypoints.empty();
    }
    EXPECT_EQ(proved, steps) << rates.tf_hz << " Hz, " << rates.cloth_hz << " Hz: " << scene.outcome.reason;
    if (rates.cloth_hz < 20) EXPECT_GT(in_parts, 0u) << "else it shows nothing";
  }
}

// Two trackers at 30 Hz, 15 ms apart, each with up to 4 mm of noise.
TEST(Streams, OutOfPhaseAreProved) {
  Moving scene(test::scene("effects: {octomap: 'off'}, bodies: {cloth: {topic: cloth}, towel: {topic: towel}}"));
  std::size_t proved = 0, steps = 0, in_parts = 0;
  for (int k = 0; k < 100; ++k) {
    const auto noisy = [&](double z) { return static_cast<float>(z + 4e-3 * (k * 7919 % 17 / 8.0 - 1)); };
    scene.take(1, cloudAt(after(0.033 * k - 0.018), noisy(0.3)));
    scene.take(0, cloudAt(after(0.033 * k - 0.033), noisy(0)));
    while (scene.pipeline.nextOutcome(0, scene.outcome)) {
      if (!scene.outcome.answered) continue;
      ++steps;
      proved += assuranceOf(scene.outcome).clear();
      in_parts += !scene.outcome.step->bodies[1].waypoints.empty();
    }
  }
  EXPECT_GT(steps, 90u);
  EXPECT_EQ(proved, steps) << scene.outcome.reason;
  EXPECT_GT(in_parts, 0u) << "else it shows nothing";
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
TEST(Map, GoesWhereItsFrameGoes) {
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
  EXPECT_TRUE(assuranceOf(scene.outcome).proved) << scene.outcome.reason;
  EXPECT_EQ(assuranceOf(scene.outcome).touching, Touching::NEW);
  EXPECT_NEAR(scene.outcome.earliest_toc, 0.4 * (0.5 + 0.05) / 0.7, 0.02);
  scene.move("odom", 0.2, -0.5);
  scene.offer(0.2, 0.05f);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << "it is back: " << scene.outcome.reason;
  scene.move("odom", 0.25, -0.3);
  scene.offer(0.25, 0.05f);
  EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
  EXPECT_TRUE(assuranceOf(scene.pipeline.checkNow(0)).clear());
  scene.move("odom", 0.3, 0.1);
  scene.offer(0.3, 0.05f);
  EXPECT_NE(assuranceOf(scene.outcome).touching, Touching::NONE);
  EXPECT_NE(assuranceOf(scene.pipeline.checkNow(0)).touching, Touching::NONE) << "nor by a question";
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
      scene.move("odom", at - 0.001, moves ? 0.7 : -0.5);
      scene.move("odom", at + 0.001, -0.5);
    };
    moveAround(0.25);
    for (const double at : {0.3, 0.35}) scene.move("odom", at, -0.5);
    for (const double at : {0.3, 0.35}) scene.offer(at, 0.05f);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.offer(0.25, 0.05f);
    EXPECT_EQ(scene.outcome.status, StepStatus::TIME_JUMP);
    scene.offer(0.3, 0.05f);
    EXPECT_EQ(assuranceOf(scene.outcome).touching != Touching::NONE, moves) << "after a jump back";
    scene.offer(0.35, 0.05f);
    EXPECT_FALSE(assuranceOf(scene.outcome).proved) << "frames up to there had come before";
    scene.offer(0.4, 0.05f, 0);
    scene.move("odom", 0.4, -0.5);
    EXPECT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));

    Mapped late;
    for (const double at : {0.0, 0.04}) late.move("odom", at, -0.5);
    for (const double at : {0.0, 0.05}) late.offer(at, 0.05f);
    late.giveMapIn("odom", 0.04);
    late.pipeline.nextOutcome(0, late.outcome);
    late.move("odom", 0.049, moves ? 0.7 : -0.5);
    for (const double at : {0.051, 0.1}) late.move("odom", at, -0.5);
    late.offer(0.1, 0.05f);
    EXPECT_TRUE(assuranceOf(late.outcome).proved) << late.outcome.reason;
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
      scene.move("odom", 0.05 * i - 0.001, i == off ? 0.7 : -0.5);
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

TEST(Map, WhoseFrameHasAnotherParentWithinAStepIsNoClearStep) {
  for (const double dip : {-0.5, 0.2}) {
    Mapped scene;
    for (int i = 0; i <= 5; ++i) {
      for (const char* base : {"base", "other"}) scene.move(base, 0.05 * i, -0.5);
      geometry_msgs::TransformStamped odom = above("odom", 0, after(0.05 * i));
      odom.header.frame_id = i < 3 ? "base" : "other";
      scene.tell({odom});
    }
    scene.move("base", 0.12, dip);
    scene.giveMapIn("odom", 0);
    for (int i = 0; i <= 5; ++i) {
      scene.offer(0.05 * i, 0.05f);
      EXPECT_EQ(assuranceOf(scene.outcome).clear(), i > 0 && i != 3) << i << ": " << scene.outcome.reason;
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

// Its frame goes up through the cloth and back in the first of the steps that wait for the other body when the map
// comes: long ago, before tf forgot it, or beside more transforms than are looked at.
TEST(Map, ThatComesWhileStepsWaitIsHeldToWhatTfSawInEachOfThem) {
  enum class Case { DIPS, LONG, FORGOTTEN, FLOOD, RESTS };
  for (const Case one : {Case::DIPS, Case::LONG, Case::FORGOTTEN, Case::FLOOD, Case::RESTS}) {
    Mapped scene(test::scene(
        "sync_timeout_s: 100.0, clock_body: cloth, bodies: {cloth: {topic: cloth}, other: {topic: other}}"));
    const double period_s = one == Case::LONG ? 0.4 : 0.05;
    const auto at = [&](double frame) { return period_s * frame; };
    scene.take(1, cloudAt(after(0), 1));
    for (int i = 0; i <= 4; ++i) {
      scene.move("odom", at(i), -0.5);
      scene.move("far", at(i), 0);
      if (one != Case::RESTS && i == 0) scene.move("odom", at(0.5), 0.2);
      for (int k = 0; one == Case::FLOOD && i == 0 && k < 2000; ++k) scene.move("odom", at(0.6) + 1e-6 * k, -0.5);
      if (one == Case::FORGOTTEN && i == 1) {
        scene.move("far", -2, 0);
        scene.move("odom", at(1), -0.5);
      }
      scene.offer(at(i), 0.05f);
    }
    scene.giveMapIn("odom", at(4));
    EXPECT_FALSE(scene.pipeline.nextOutcome(0, scene.outcome));
    for (int i = 1; i <= 4; ++i) {
      scene.take(1, cloudAt(after(at(i)), 1));
      ASSERT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome)) << i;
      EXPECT_EQ(assuranceOf(scene.outcome).clear(), i > 1 || one == Case::RESTS)
          << static_cast<int>(one) << ", " << i << ": " << describe(assuranceOf(scene.outcome));
    }
  }
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
  EXPECT_NE(scene.outcome.reason.find("where the octomap's frame 'odom' was is not known for all of this step (no "
                                      "transform of its frame at 1700000000.100000000 s)"),
            std::string::npos)
      << scene.outcome.reason;
  EXPECT_NE(adviceFor(scene.outcome.status, scene.outcome.reason, "").find("larger transform_timeout_s"),
            std::string::npos);
}

// The cloth's frame is a camera's, from which the fixed frame is learnt, and the table's is at rest; or the table
// moves.
TEST(StaticBodies, GoWhereTheirFrameGoes) {
  for (const bool named : {false, true}) {
    const std::string frame = named ? "fixed_frame: world, " : "";
    Moving scene(parameters(frame + "max_vertex_step_m: 0.0, effects: {octomap: 'off'}, " + CLOTH_AND_TABLE));
    for (int i = 0; i < 6; ++i) scene.move("table", 0.05 * i, i < 3 ? -0.5 : 0.5);
    const std::size_t table = 1;
    scene.take(table, cloud(START_S, 0, {}, "table"));
    for (int i = 0; i < 3; ++i) scene.offer(0.05 * i, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    scene.offer(0.15, 0);
    EXPECT_TRUE(assuranceOf(scene.outcome).proved) << scene.outcome.reason;
    EXPECT_EQ(assuranceOf(scene.outcome).touching, Touching::NEW);
    EXPECT_NEAR(scene.outcome.earliest_toc, 0.5, 0.02);
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
  const std::string note = scene.pipeline.takeMapHint();
  EXPECT_NE(note.find("it is placed by the first, 60.1 s after its stamp"), std::string::npos) << note;
  EXPECT_EQ(scene.pipeline.takeMapHint(), "");
  scene.offer(0.2, -0.6f, 2000000000);
  EXPECT_FALSE(scene.outcome.contacts.empty()) << "its top is at -0.5";
}

/// Ten maps a second in a frame of which tf lags 0.3 s behind, and a cloth at 20 Hz in the fixed frame.
struct LateTf : Mapped {
  static constexpr int STEPS = 60;
  std::map<int, Outcome> outcomes;  // by the frame's number

  LateTf(double timeout_s, const std::string& more = "")
      : Mapped(test::scene("octomap_topic: /map, transform_timeout_s: " + std::to_string(timeout_s) + more)) {
    for (int k = 0; k < STEPS; ++k) {
      const std::int64_t now_ns = std::int64_t{50000000} * (k + 20);
      if (k >= 6) move("odom", 0.05 * (k - 6), -0.5);
      if (k % 2 == 0) {
        LoadedMap loaded = decodeMapMessage(map(1), config);
        loaded.frame_id = "odom";
        loaded.stamp_ns = static_cast<StampNs>(after(0.05 * k).toNSec());
        loaded.arrival_ns = now_ns;
        pipeline.setMap(std::move(loaded), now_ns);
      }
      // The queue before the pipeline.
      queue.emplace_back(k, now_ns);
      drain(now_ns + 1000);
    }
  }
  void drain(std::int64_t now_ns) {
    do {
      for (; !queue.empty() && pipeline.idle(0); queue.pop_front()) {
        take(0, cloudAt(after(0.05 * queue.front().first), 0.05f), queue.front().second);
      }
      while (pipeline.nextOutcome(now_ns, outcome)) {
        outcomes[static_cast<int>(std::lround(secondsBetween(START_NS, outcome.stamp_ns) / 0.05))] = outcome;
      }
    } while (!queue.empty() && pipeline.idle(0));
  }
  /// How old the map is that the frame was answered with, in the cloth's frames; none: very.
  int ageAt(int k) const {
    const Outcome& outcome = outcomes.at(k);
    if (!outcome.obstacle) return 1000;
    return k - static_cast<int>(std::lround(secondsBetween(START_NS, outcome.step->map.stamp_ns) / 0.05));
  }

 private:
  static constexpr StampNs START_NS = 1700000000000000000;
  std::deque<std::pair<int, std::int64_t>> queue;
};

TEST(Map, ThoseThatTfLagsBehindAreUsedInTurn) {
  for (const char* own : {"", ", own_voxels_m: auto"}) {
    const LateTf scene(0.5, own);
    for (int k = 10; k < LateTf::STEPS - 10; ++k) {
      EXPECT_EQ(scene.ageAt(k), k % 2) << k << ": the newest that came before the frame";
      EXPECT_TRUE(assuranceOf(scene.outcomes.at(k)).clear())
          << k << ": " << describe(assuranceOf(scene.outcomes.at(k)));
    }
  }
}

// A frame is not waited for as long: the newest map that has a place is looked at, but proves nothing.
TEST(Map, TheNewestThatHasAPlaceIsLookedAtWhereTfLagsFurtherThanFramesWait) {
  const LateTf scene(0.2);
  for (int k = 10; k < LateTf::STEPS - 10; ++k) {
    EXPECT_LE(scene.ageAt(k), 4) << k << ": " << scene.outcomes.at(k).reason;
    const Assurance said = assuranceOf(scene.outcomes.at(k));
    EXPECT_FALSE(said.proved) << k;
    EXPECT_NE(
        describe(said).find("an octomap that came before this frame has no place: no transform of its frame 'odom'"),
        std::string::npos)
        << describe(said);
  }
}

// Nor is a frame called clear where a map that came before it is of a time that tf has not reached, or of nowhere.
TEST(Map, ANewerOneWithoutAPlaceLeavesNothingProved) {
  for (const char* frame : {"odom", "nowhere"}) {
    Mapped scene;
    for (int i = 0; i <= 10; ++i) scene.move("odom", 0.05 * i, -0.5);
    scene.giveMapIn("odom", 0, 1);
    scene.offer(0, 0.05f, 1);
    scene.giveMapIn(frame, 60, 1);
    scene.giveMapIn("odom", 0.05, 2);
    scene.giveMapIn(frame, 60, 2);
    EXPECT_FALSE(scene.offer(0.05, 0.05f, 2));
    EXPECT_TRUE(scene.pipeline.nextOutcome(300000000, scene.outcome));
    EXPECT_FALSE(assuranceOf(scene.outcome).proved) << frame;
  }
}

// Of large ones there is room for one: the newest, as the last one before a pause must be used.
TEST(Map, OfThoseThatWaitAsManyAreKeptAsThereIsRoomFor) {
  for (const int mb : {1, 64}) {
    Mapped scene(test::scene("max_map_mb: " + std::to_string(mb)));
    octomap::OcTree large(0.1);
    for (int i = 0; i < 4096; ++i)
      large.updateNode(0.05 + 0.2 * (i % 64), 0.05 + 0.2 * static_cast<double>(i / 64), -0.95, true);
    const LoadedMap one = decodeMapMessage(mapOf(large, 1), scene.config);
    for (int i = 0; i < 40; ++i) {
      LoadedMap loaded = one;
      loaded.frame_id = "odom";
      loaded.stamp_ns = static_cast<StampNs>(after(0.1 * i).toNSec());
      scene.pipeline.setMap(std::move(loaded), i);
    }
    scene.offer(0, 0.05f, 100);
    scene.move("odom", 0, 0);
    EXPECT_FALSE(scene.pipeline.nextOutcome(101, scene.outcome));
    EXPECT_EQ(scene.pipeline.monitor().map().surface != nullptr, mb == 64) << "the oldest was kept";
    for (int i = 1; i < 40; ++i) scene.move("odom", 0.1 * i, 0);
    EXPECT_TRUE(scene.pipeline.nextOutcome(102, scene.outcome));
    EXPECT_EQ(scene.pipeline.monitor().map().stamp_ns, static_cast<StampNs>(after(3.9).toNSec())) << "the newest";
  }
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
