// What came and was not used: a step that spans it proves nothing, and says what it was. Stamps are of today.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <functional>
#include <limits>

#include "dccd/assurance.h"
#include "node/input_queue.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

constexpr double START_S = 1.7e9;
constexpr std::size_t CLOTH = 0, OTHER = 1;
constexpr std::int64_t PATIENCE_NS = 1000000000;

ros::Time after(double seconds) { return ros::Time(START_S) + ros::Duration(seconds); }

/// A cloth at z 0, the clock; another sheet at 1; and, of tf, a tip 3 m above.
struct World : Driven {
  explicit World(const std::string& more = "") : Driven(tree(more)) {}

  static XmlRpcValue tree(const std::string& more) {
    const std::string file = ::testing::TempDir() + "tip_of_unused.obj";
    std::ofstream(file) << "v 0.2 0.2 0\nv 0.21 0.2 0.05\nv 0.2 0.21 0.05\nf 1 2 3\n";
    return scene("effects: {octomap: 'off'}, clock_body: cloth, " + more +
                 "bodies: {cloth: {topic: cloth}, other: {topic: other}, tip: {rigid: {frame: tip, mesh: " + file +
                 "}}}");
  }
  void move(const std::string& child, double after_s, double z = 3) { tell({above(child, z, after(after_s))}); }
  void give(std::size_t body, double after_s, float z, const std::string& frame = "world") {
    take(body, cloudAt(after(after_s), z, frame));
  }
  /// All at once; the clock has gone on so far that nothing is waited for.
  const Outcome& answer() {
    EXPECT_TRUE(pipeline.nextOutcome(PATIENCE_NS, outcome));
    return outcome;
  }
  /// Whether the step of all three to there is clear.
  bool step(double after_s, float cloth = 0) {
    move("tip", after_s);
    give(OTHER, after_s, 1);
    give(CLOTH, after_s, cloth);
    answer();
    return assuranceOf(outcome).clear();
  }
  void expectUnknown(const std::string& body, const std::string& why) const {
    EXPECT_EQ(outcome.status, StepStatus::PARTIAL) << outcome.reason;
    EXPECT_TRUE(outcome.answered);
    EXPECT_FALSE(assuranceOf(outcome).proved);
    EXPECT_NE(outcome.reason.find("where " + body + " was is not known for all of this step ("), std::string::npos)
        << outcome.reason;
    EXPECT_NE(outcome.reason.find(why), std::string::npos) << outcome.reason;
  }
};

/// A message that is none.
MeshMessage damaged(double after_s) {
  MeshMessage message{"sensor_msgs/PointCloud2", cloudAt(after(after_s), 0), 0, 0};
  message.bytes.resize(60);
  return message;
}

MeshMessage withPoints(double after_s, std::size_t count) {
  sensor_msgs::PointCloud2 cloud;
  cloud.header.stamp = after(after_s);
  cloud.header.frame_id = "world";
  cloud.height = 1;
  cloud.width = static_cast<std::uint32_t>(count);
  addFields({"x", "y", "z"}, cloud);
  cloud.point_step = 12;
  cloud.row_step = cloud.point_step * cloud.width;
  cloud.data.resize(cloud.row_step);
  return {"sensor_msgs/PointCloud2", bytesOf(cloud), 0, 0};
}

// The cloth is beyond the plate in frames of which nobody knows where the finger was.
TEST(Unused, AStepAcrossFramesThatWereRefusedForALostTransformIsNotClear) {
  World world;
  ASSERT_FALSE(world.step(0));
  ASSERT_TRUE(world.step(0.04)) << world.outcome.reason;
  for (int k = 1; k <= 4; ++k) {
    world.give(OTHER, 0.04 + 0.09 * k, 1);
    world.give(CLOTH, 0.04 + 0.09 * k, 2);
    EXPECT_EQ(world.answer().status, StepStatus::NO_TRANSFORM);
  }
  EXPECT_FALSE(world.step(0.5));
  world.expectUnknown("body 'cloth'", "4 frames of it that came were not used: NO_TRANSFORM: no transform from 'tip'");
  EXPECT_TRUE(world.step(0.54)) << world.outcome.reason;
}

TEST(Unused, FramesOfAnyBodyThatAreNoneAreMissedBetweenTheirNeighbours) {
  struct Case {
    const char* what;
    std::size_t body;
    std::function<void(World&, double)> give;
    const char* why;
  };
  const auto refused = [](std::size_t body, const std::function<MeshMessage(double)>& make) {
    return [body, make](World& world, double at) { world.pipeline.take(body, make(at)); };
  };
  std::vector<Case> cases;
  for (const std::size_t body : {CLOTH, OTHER}) {
    cases.push_back({"cut", body, refused(body, damaged), "1 frame of it that came was not used: BAD_MESSAGE: "});
    cases.push_back({"too few points", body, refused(body, [](double at) { return withPoints(at, 3); }), "not used: "});
    cases.push_back({"of another type", body,
                     refused(body,
                             [](double) {
                               return MeshMessage{"std_msgs/String", {1, 2, 3}, 0, 0};
                             }),
                     "BAD_MESSAGE"});
    cases.push_back({"without memory", body,
                     refused(body,
                             [](double at) {
                               MeshMessage message = damaged(at);
                               message.no_memory = 100;
                               return message;
                             }),
                     "not enough memory"});
    cases.push_back({"without a place", body,
                     [body](World& world, double at) {
                       world.give(body, at, 5, "nowhere");
                       Outcome none;
                       world.pipeline.nextOutcome(PATIENCE_NS, none);
                     },
                     "NO_TRANSFORM: no transform from 'nowhere'"});
    cases.push_back({"a stamp once more, elsewhere", body, [body](World& world, double) { world.give(body, 0.04, 5); },
                     "elsewhere"});
  }
  cases.push_back({"without a number", OTHER, [](World& world, double at) { world.give(OTHER, at, NAN); },
                   "a frame between its ends has lost vertices"});
  for (const Case& one : cases) {
    SCOPED_TRACE(std::string(one.what) + (one.body == CLOTH ? ", cloth" : ", other"));
    World world;
    world.step(0);
    ASSERT_TRUE(world.step(0.04)) << world.outcome.reason;
    one.give(world, 0.06);
    Outcome unanswered;  // the clock body's has one of its own
    while (world.pipeline.nextOutcome(PATIENCE_NS, unanswered)) EXPECT_FALSE(unanswered.answered);
    EXPECT_FALSE(world.step(0.08));
    world.expectUnknown(one.body == CLOTH ? "body 'cloth'" : "body 'other'", one.why);
    EXPECT_TRUE(world.step(0.12)) << world.outcome.reason;
    EXPECT_EQ(world.pipeline.monitor().total().waiting(), 0u);
  }
}

// Of the step that ends there the one that came first was used; it waits for the other body meanwhile.
TEST(Unused, AStampThatIsUsedAgainElsewhereIsMissedOnBothSides) {
  for (const bool elsewhere : {true, false}) {
    World world("sync_timeout_s: 100.0, ");
    world.step(0);
    ASSERT_TRUE(world.step(0.04)) << world.outcome.reason;
    world.move("tip", 0.08);
    world.give(CLOTH, 0.08, 0);
    EXPECT_FALSE(world.pipeline.nextOutcome(0, world.outcome)) << "waits for the other";
    world.give(CLOTH, 0.08, elsewhere ? 0.4f : 0);
    EXPECT_FALSE(world.pipeline.nextOutcome(0, world.outcome));
    world.give(OTHER, 0.08, 1);
    EXPECT_EQ(assuranceOf(world.answer()).clear(), !elsewhere) << world.outcome.reason;
    EXPECT_EQ(world.answer().status, StepStatus::DUPLICATE);
    EXPECT_EQ(world.step(0.12), !elsewhere) << world.outcome.reason;
    EXPECT_TRUE(world.step(0.16)) << world.outcome.reason;
  }
}

TEST(Unused, WhatWasRefusedBeforeTheFirstFrameOrBeforeASeamSpoilsNothing) {
  World world;
  for (const std::size_t body : {CLOTH, OTHER}) world.pipeline.take(body, withPoints(0, 3));
  world.answer();
  EXPECT_FALSE(world.step(0.04)) << "a first frame";
  EXPECT_TRUE(world.step(0.08)) << world.outcome.reason;
  for (const std::size_t body : {CLOTH, OTHER}) world.pipeline.take(body, withPoints(0.1, 3));
  world.answer();
  world.pipeline.reset(StepStatus::RESET);
  EXPECT_FALSE(world.step(0.12)) << "a first frame";
  EXPECT_TRUE(world.step(0.16)) << world.outcome.reason;
  world.pipeline.take(CLOTH, damaged(0.2));
  world.answer();
  EXPECT_FALSE(world.step(1.2)) << "a gap";
  EXPECT_TRUE(world.step(1.24)) << world.outcome.reason;
}

// Twelve frames at once at a queue of eight; two of the first four are beyond the table.
TEST(Unused, FramesThatAQueueDropsAreMissedUnlessItIsToThinThemOut) {
  for (const std::string policy : {"newest", "oldest", "thin"}) {
    World world("queue_policy: " + policy + ", ");
    world.step(0);
    ASSERT_TRUE(world.step(0.02)) << world.outcome.reason;
    for (int k = 1; k <= 13; ++k) {
      world.move("tip", 0.02 + 0.02 * k);
      world.give(OTHER, 0.02 + 0.02 * k, 1);
      EXPECT_FALSE(world.pipeline.nextOutcome(PATIENCE_NS, world.outcome)) << "it gets its place";
    }
    InputQueue queue(1, 8, world.config.queue_policy);
    for (int k = 1; k <= 12; ++k) {
      MeshMessage message{"sensor_msgs/PointCloud2", cloudAt(after(0.02 + 0.02 * k), k == 2 || k == 3 ? 2.0f : 0.0f), 0,
                          0};
      message.number = static_cast<std::uint64_t>(k + 2);
      queue.push(0, std::move(message));
    }
    std::vector<bool> clear;
    const auto drain = [&] {
      for (MeshMessage message; queue.pop(0, message);) {
        world.pipeline.take(CLOTH, message);
        const std::uint64_t dropped = queue.takeDropped()[0];
        world.pipeline.monitor().countReceived(CLOTH, dropped);
        world.pipeline.monitor().countDropped(CLOTH, StepStatus::QUEUE_FULL, dropped);
        const Assurance said = assuranceOf(world.answer());
        clear.push_back(said.clear());
        if (clear.size() == 1 && policy == "newest") world.expectUnknown("body 'cloth'", "not used: QUEUE_FULL");
        const bool thinned = policy == "thin" && clear.size() == 1;
        EXPECT_EQ(
            std::count(said.excluded.begin(), said.excluded.end(), "4 frames of body 'cloth' by queue_policy: thin"),
            thinned)
            << policy;
      }
    };
    drain();
    MeshMessage last{"sensor_msgs/PointCloud2", cloudAt(after(0.28), 0), 0, 0};
    last.number = 15;
    queue.push(0, std::move(last));
    drain();
    std::vector<bool> expected(9, true);
    if (policy == "newest") expected.front() = false;
    if (policy == "oldest") expected[1] = expected[3] = expected[8] = false;  // there and back; and the last five
    EXPECT_EQ(clear, expected) << policy;
  }
}

TEST(Unused, TransformsThatAreNoneWithinAStepLeaveItUnproved) {
  struct Case {
    const char* what;
    std::function<void(World&, geometry_msgs::TransformStamped)> tell;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto told = [](const std::function<void(geometry_msgs::TransformStamped&)>& change) {
    return [change](World& world, geometry_msgs::TransformStamped one) {
      change(one);
      world.tell({one});
    };
  };
  const std::vector<Case> cases = {
      {"a rotation of length 1.2", told([](auto& one) { one.transform.rotation.w = 1.2; })},
      {"a rotation that is not finite", told([=](auto& one) { one.transform.rotation.x = nan; })},
      {"a translation that is not finite", told([=](auto& one) { one.transform.translation.z = nan; })},
      {"its own parent", told([](auto& one) { one.header.frame_id = one.child_frame_id; })},
      {"no parent", told([](auto& one) { one.header.frame_id.clear(); })},
      {"elsewhere at a stamp that it had", told([](auto& one) {
         one.header.stamp = after(0.04);
         one.transform.translation.z += 0.4;
       })},
      {"not finite at a stamp that it had", told([=](auto& one) {
         one.header.stamp = after(0.04);
         one.transform.translation.z = nan;
       })},
      {"a damaged message", [](World& world, const geometry_msgs::TransformStamped&) {
         EXPECT_FALSE(world.feed_tf.read("/tf", {9, 0, 0, 0, 1}));
       }}};
  for (const Case& one : cases) {
    for (const bool moves : {false, true}) {  // the cloth's frame, or the tip's
      SCOPED_TRACE(std::string(one.what) + (moves ? ", camera" : ", tip"));
      World world;
      const auto step = [&](double at) {
        world.move("camera", at, 0);
        world.move("tip", at);
        world.give(OTHER, at, 1);
        world.give(CLOTH, at, 0, moves ? "camera" : "world");
        return assuranceOf(world.answer()).clear();
      };
      step(0);
      ASSERT_TRUE(step(0.04)) << world.outcome.reason;
      one.tell(world, above(moves ? "camera" : "tip", moves ? 0 : 3, after(0.06)));
      EXPECT_FALSE(step(0.08));
      world.expectUnknown(moves ? "body 'cloth'" : "body 'tip'",
                          std::string("a transform of frame '") + (moves ? "camera" : "tip") + "' came");
      step(0.12);
      EXPECT_TRUE(step(0.16)) << world.outcome.reason;
    }
  }
}

// Each step lies between two transforms of the tip: of what came between them one cannot be used.
TEST(Unused, AStepThatLiesBetweenTwoTransformsWithOneThatIsNoneBetweenThemIsNotClear) {
  for (const bool none : {false, true}) {
    World world;
    const auto step = [&](double at) {
      world.give(OTHER, at, 1);
      world.give(CLOTH, at, 0);
      return assuranceOf(world.answer()).clear();
    };
    world.move("tip", 0);
    if (none) world.move("tip", 0.11, std::numeric_limits<double>::quiet_NaN());
    world.move("tip", 0.2);
    world.move("tip", 0.4);
    step(0.01);
    for (const double at : {0.05, 0.1, 0.15, 0.19}) EXPECT_EQ(step(at), !none) << at << ": " << world.outcome.reason;
    EXPECT_EQ(step(0.21), !none) << world.outcome.reason;
    EXPECT_TRUE(step(0.25)) << world.outcome.reason;
  }
}

void tellStatic(Driven& world, const geometry_msgs::TransformStamped& transform) {
  tf2_msgs::TFMessage message;
  message.transforms = {transform};
  world.feed_tf.add(message, true);
}

// Which holds at all times: so it was there before, too, and what was made of it is wrong. What is held in it goes
// there.
TEST(Unused, AStaticTransformThatIsSentAgainElsewhereLeavesNothingProved) {
  enum class What { RIGID, STREAM, STATIC, LEARNT };
  for (const What what : {What::RIGID, What::STREAM, What::STATIC, What::LEARNT}) {
    for (const double by_m : {0.0, 0.5, 0.0009}) {
      SCOPED_TRACE(std::to_string(static_cast<int>(what)) + ", " + std::to_string(by_m) + " m");
      const bool held = what == What::STATIC || what == What::LEARNT;
      const std::string file = World::tree("")["bodies"]["tip"]["rigid"]["mesh"];
      const std::string body = held                  ? "{topic: table, motion: static}"
                               : what == What::RIGID ? "{rigid: {frame: stand, mesh: " + file + "}}"
                                                     : "{topic: table}";
      Driven scene(parameters(std::string(what == What::LEARNT ? "" : "fixed_frame: world, ") +
                              "max_vertex_step_m: 0.0, effects: {octomap: 'off'}, clock_body: cloth, bodies: {cloth: "
                              "{topic: cloth}, thing: " +
                              body + "}"));
      const auto step = [&](double at) {
        if (what == What::STREAM) scene.take(1, cloudAt(after(at), 1, "stand"));
        scene.take(0, cloudAt(after(at), 0));
        EXPECT_TRUE(scene.pipeline.nextOutcome(PATIENCE_NS, scene.outcome));
        return assuranceOf(scene.outcome).clear();
      };
      tellStatic(scene, above("stand", 1));
      if (held) scene.take(1, cloudAt(after(0), 1, "stand"));
      step(0);
      ASSERT_TRUE(step(0.04)) << scene.outcome.reason;
      for (int k = 1; k <= 3; ++k) tellStatic(scene, above("stand", 1 + by_m * k));
      EXPECT_EQ(step(0.08), by_m == 0) << scene.outcome.reason;
      step(0.12);
      EXPECT_TRUE(step(0.16)) << scene.outcome.reason;
      if (!held) continue;
      scene.take(1, cloudAt(after(0.16), 1, "stand"));
      step(0.2);
      EXPECT_TRUE(step(0.24)) << scene.outcome.reason;
    }
  }
}

// What a depth camera in a hand saw is where it was; a table's frame that moves has its table with it.
TEST(Unused, AStaticBodyGoesWithItsFrameUnlessThatIsACamerasInANamedFixedFrame) {
  for (const bool camera : {false, true}) {
    const std::string table = camera ? "{topic: table, motion: static, topology: {source: depth_image, stride: 1, "
                                       "max_edge_m: 1.0}}"
                                     : "{topic: table, motion: static}";
    Driven scene(test::scene(
        "effects: {octomap: 'off'}, clock_body: cloth, bodies: {cloth: {topic: cloth}, table: " + table + "}"));
    const auto step = [&](double at, double z) {
      scene.tell({above("stand", z, after(at))});
      scene.take(0, cloudAt(after(at), 0));
      EXPECT_TRUE(scene.pipeline.nextOutcome(PATIENCE_NS, scene.outcome));
      return assuranceOf(scene.outcome).clear();
    };
    scene.tell({above("stand", 1, after(-0.1))});
    scene.take(1, cloudAt(after(-0.1), 1, "stand"));
    scene.take(0, cloudAt(after(0), 0));
    ASSERT_TRUE(scene.pipeline.nextOutcome(PATIENCE_NS, scene.outcome)) << "of a frame that was sent once";
    scene.take(0, cloudAt(after(0.04), 0));
    ASSERT_TRUE(scene.pipeline.nextOutcome(PATIENCE_NS, scene.outcome));
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    EXPECT_TRUE(step(0.08, 1)) << scene.outcome.reason;
    EXPECT_EQ(step(0.12, -1.5), camera) << "down through the cloth: " << scene.outcome.reason;
    EXPECT_TRUE(step(0.16, -1.5)) << scene.outcome.reason;
    EXPECT_EQ(step(0.2, 1), camera) << "and up again: " << scene.outcome.reason;
    EXPECT_TRUE(step(0.24, 1)) << scene.outcome.reason;
  }
}

TEST(Unused, WhatACameraSawInALearntFixedFrameDoesNotGoWithTheCamera) {
  for (const bool moves : {false, true}) {
    Driven scene(
        parameters("effects: {octomap: 'off'}, clock_body: cloth, bodies: {cloth: {topic: cloth}, table: "
                   "{topic: table, motion: static, topology: {source: depth_image, stride: 1, max_edge_m: 1.0}}}"));
    const auto step = [&](double at, double z) {
      scene.tell({above("stand", z, after(at))});
      if (at == 0) scene.take(1, cloudAt(after(at), 1, "stand"));
      scene.take(0, cloudAt(after(at), 0));
      EXPECT_TRUE(scene.pipeline.nextOutcome(PATIENCE_NS, scene.outcome));
    };
    step(0, 1);
    step(0.04, 1);
    EXPECT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    step(0.08, moves ? 1.5 : 1);
    EXPECT_EQ(assuranceOf(scene.outcome).proved, !moves) << scene.outcome.reason;
  }
}

// A question is held to all that a step is held to.
TEST(Unused, AQuestionIsHeldToWhatCameAfterTheNewestFrames) {
  World world;
  world.step(0);
  ASSERT_TRUE(world.step(0.04));
  ASSERT_TRUE(assuranceOf(world.pipeline.checkNow(0)).clear());
  world.pipeline.take(OTHER, damaged(0.06));
  const Assurance refused = assuranceOf(world.pipeline.checkNow(0));
  EXPECT_FALSE(refused.proved);
  EXPECT_NE(describe(refused).find("body 'other'"), std::string::npos) << describe(refused);
  world.give(OTHER, 0.07, 1);
  Outcome none;
  EXPECT_FALSE(world.pipeline.nextOutcome(PATIENCE_NS, none));
  EXPECT_TRUE(assuranceOf(world.pipeline.checkNow(0)).clear());

  constexpr std::int64_t LATER_NS = 600'000'000;
  EXPECT_NE(describe(assuranceOf(world.pipeline.checkNow(LATER_NS))).find("no frame has come for more than 0.5 s"),
            std::string::npos);

  Driven mapped(scene("transform_timeout_s: 0.0"));
  mapped.giveMap(1);
  mapped.feed(1, 0.1f);
  mapped.feed(1.1, 0.1f);
  EXPECT_TRUE(assuranceOf(mapped.pipeline.checkNow(0)).clear());
  LoadedMap unplaced = decodeMapMessage(mapOf(table(), 1.2), mapped.config);
  unplaced.frame_id = "nowhere";
  mapped.pipeline.setMap(std::move(unplaced), 0);
  const Assurance said = assuranceOf(mapped.pipeline.checkNow(0));
  EXPECT_FALSE(said.proved);
  EXPECT_NE(describe(said).find("has no place"), std::string::npos) << describe(said);
}

// A map whose place is between two transforms, between which came one that is none.
TEST(Unused, AMapThatIsPlacedInDoubtProvesNothingUntilTheNext) {
  for (const bool none : {false, true}) {
    Driven scene(test::scene());
    const auto move = [&](double at, double z) { scene.tell({above("odom", z, after(at))}); };
    const auto giveMap = [&](double at) {
      LoadedMap loaded = decodeMapMessage(mapOf(table(), 1), scene.config);
      loaded.frame_id = "odom";
      loaded.stamp_ns = loaded.arrival_ns = static_cast<StampNs>(after(at).toNSec());
      scene.pipeline.setMap(std::move(loaded), 0);
    };
    const auto step = [&](double at) {
      move(at, -0.5);
      const auto now_ns = static_cast<std::int64_t>(after(at).toNSec());
      scene.take(0, cloudAt(after(at), 0.05f), now_ns);
      EXPECT_TRUE(scene.pipeline.nextOutcome(now_ns + PATIENCE_NS, scene.outcome));
      return assuranceOf(scene.outcome).clear();
    };
    move(0, -0.5);
    if (none) move(0.03, std::numeric_limits<double>::infinity());
    move(0.04, -0.5);
    giveMap(0.02);
    step(0.1);
    for (const double at : {0.14, 0.18}) EXPECT_EQ(step(at), !none) << scene.outcome.reason;
    giveMap(0.18);
    EXPECT_TRUE(step(0.22)) << scene.outcome.reason;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
