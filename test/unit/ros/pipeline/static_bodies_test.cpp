// A static body whose frames are sent once: how they wait for their transform, and what the steps say meanwhile.
#include <gtest/gtest.h>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

constexpr std::int64_t SECOND_NS = 1000000000;

/// A cloth in the world over a static table in a frame of its own, whose transform is not there.
struct Tabled : Driven {
  Tabled() : Driven(parameters("max_vertex_step_m: 0.0, effects: {octomap: 'off'}, " + std::string(CLOTH_AND_TABLE))) {}
  void take(std::size_t body, double stamp_s, float z, std::int64_t now_ns) {
    Driven::take(body, cloud(stamp_s, z, {}, body == TABLE ? "table" : "world"), now_ns);
  }
  const FrameCounters& tables() const { return pipeline.monitor().counters(TABLE); }
  static constexpr std::size_t CLOTH = 0, TABLE = 1;
};

TEST(StaticBodies, AFrameThatComesAfterALaterOneProvesNothing) {
  Tabled scene;
  scene.raise("table", 0.1);
  const auto saidWith = [&](double table_s, double stamp_s) {
    scene.take(Tabled::TABLE, table_s, 0, 0);
    scene.take(Tabled::CLOTH, stamp_s, 0.3f, 0);
    while (scene.pipeline.nextOutcome(0, scene.outcome)) continue;
    return assuranceOf(scene.outcome);
  };
  saidWith(5, 1);
  EXPECT_TRUE(saidWith(5.1, 1.1).proved);
  const Assurance late = saidWith(5.05, 1.2);
  EXPECT_FALSE(late.proved);
  EXPECT_NE(describe(late).find("its stamps went back"), std::string::npos) << describe(late);
  EXPECT_TRUE(saidWith(5.2, 1.3).proved);
  EXPECT_TRUE(saidWith(2, 1.4).proved) << "a time that begins anew";
}

TEST(StaticBodies, TheOnlyFrameWaitsForItsTransform) {
  Tabled scene;
  scene.take(Tabled::TABLE, 1, 0, 0);
  EXPECT_FALSE(scene.pipeline.nextOutcome(0, scene.outcome));
  EXPECT_FALSE(scene.pipeline.idle(Tabled::TABLE)) << "a newer one waits its turn at first";
  EXPECT_FALSE(scene.pipeline.nextOutcome(SECOND_NS, scene.outcome)) << "nobody knows the fixed frame yet";
  EXPECT_EQ(scene.pipeline.takeProblem(Tabled::TABLE), "") << "which is no mistake";

  scene.take(Tabled::CLOTH, 2, 0.3f, 2 * SECOND_NS);
  ASSERT_TRUE(scene.pipeline.nextOutcome(2 * SECOND_NS, scene.outcome));
  const std::string problem = scene.pipeline.takeProblem(Tabled::TABLE);
  EXPECT_EQ(problem.rfind("waits: no transform from 'table' to 'world'", 0), 0u) << problem;
  scene.take(Tabled::CLOTH, 2.1, 0.3f, 3 * SECOND_NS);
  scene.pipeline.nextOutcome(3 * SECOND_NS, scene.outcome);
  ASSERT_TRUE(scene.pipeline.nextOutcome(4 * SECOND_NS, scene.outcome));
  EXPECT_EQ(scene.outcome.status, StepStatus::NO_BODY);
  EXPECT_EQ(scene.outcome.reason.rfind("no transform from 'table' to 'world'", 0), 0u) << scene.outcome.reason;
  EXPECT_EQ(scene.pipeline.takeProblem(Tabled::TABLE), "") << "said once";
  EXPECT_EQ(scene.pipeline.checkNow(0).reason, scene.outcome.reason);
  EXPECT_EQ(scene.tables().waiting(), 1u);

  ASSERT_TRUE(scene.pipeline.idle(Tabled::TABLE));
  scene.take(Tabled::TABLE, 1.5, 0, 5 * SECOND_NS);
  EXPECT_EQ(scene.tables().of(StepStatus::NO_TRANSFORM), 1u) << "the newer one takes its place";
  EXPECT_EQ(scene.tables().waiting(), 1u);
  scene.pipeline.reset(StepStatus::RESET);
  EXPECT_EQ(scene.tables().waiting(), 1u) << "static bodies stay over a reset";

  scene.raise("table", 0.1);
  scene.take(Tabled::CLOTH, 3, 0.3f, 6 * SECOND_NS);
  ASSERT_TRUE(scene.pipeline.nextOutcome(6 * SECOND_NS, scene.outcome));
  scene.take(Tabled::CLOTH, 3.1, -0.1f, 7 * SECOND_NS);
  ASSERT_TRUE(scene.pipeline.nextOutcome(7 * SECOND_NS, scene.outcome));
  ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
  EXPECT_NEAR(scene.outcome.earliest_toc, 0.5, 1e-6);
  EXPECT_EQ(scene.tables().processed(), 1u);
  EXPECT_EQ(scene.pipeline.monitor().total().waiting(), 0u);
}

TEST(StaticBodies, AreWhereTheyWereWhenTheFixedFrameIsLearntAnew) {
  Tabled scene;
  scene.raise("table", 0.1);
  scene.take(Tabled::TABLE, 1, 0, 0);
  for (const double stamp_s : {2.0, 3.0}) {
    scene.take(Tabled::CLOTH, stamp_s, 0.3f, 0);
    ASSERT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
    EXPECT_EQ(scene.outcome.status, StepStatus::FIRST_FRAME);
    scene.take(Tabled::CLOTH, stamp_s + 0.1, -0.1f, 0);
    ASSERT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
    ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
    EXPECT_NEAR(scene.outcome.earliest_toc, 0.5, 1e-6);
    EXPECT_EQ(scene.tables().received, 1u);
    EXPECT_EQ(scene.tables().processed(), 1u);
    scene.pipeline.reset(StepStatus::RESET);
    EXPECT_EQ(scene.pipeline.fixedFrame(), "");
    EXPECT_EQ(scene.tables().waiting(), 1u);
  }
}

TEST(StaticBodies, AnOldPlaceIsNoAnswerWhileTheNewOneHasNoTransform) {
  Tabled scene;
  scene.raise("table", 0.1);
  scene.take(Tabled::TABLE, 1, 0, 0);
  double stamp_s = 1;
  const auto feed = [&](float z, std::int64_t now_ns) {
    scene.take(Tabled::CLOTH, stamp_s += 0.1, z, now_ns);
    return scene.pipeline.nextOutcome(now_ns, scene.outcome);
  };
  ASSERT_TRUE(feed(0.3f, 0));
  ASSERT_TRUE(feed(0.3f, 0));
  ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;

  const auto moved = cloud(2, 0, {}, "lorry");
  scene.Driven::take(Tabled::TABLE, moved, SECOND_NS);
  EXPECT_FALSE(feed(0.3f, SECOND_NS)) << "waits with the table's frame, as long as that may wait";
  ASSERT_TRUE(scene.pipeline.nextOutcome(2 * SECOND_NS, scene.outcome));
  EXPECT_EQ(scene.outcome.status, StepStatus::NO_BODY);
  EXPECT_FALSE(scene.outcome.answered);
  EXPECT_EQ(scene.outcome.reason.rfind("no transform from 'lorry' to 'world'", 0), 0u) << scene.outcome.reason;
  EXPECT_NE(scene.outcome.reason.find("body 'table'"), std::string::npos) << scene.outcome.reason;
  const Outcome now = scene.pipeline.checkNow(0);
  EXPECT_FALSE(now.answered);
  EXPECT_EQ(now.status, StepStatus::NO_BODY);
  EXPECT_EQ(now.reason, scene.outcome.reason);
  scene.Driven::take(Tabled::TABLE, moved, 3 * SECOND_NS);
  ASSERT_TRUE(feed(0.3f, 3 * SECOND_NS)) << "what comes in a frame that is known to be missing holds nothing up again";
  EXPECT_EQ(scene.outcome.status, StepStatus::NO_BODY);

  scene.raise("lorry", 0.1);
  ASSERT_TRUE(feed(0.3f, 4 * SECOND_NS));
  ASSERT_TRUE(feed(-0.1f, 4 * SECOND_NS));
  ASSERT_EQ(scene.outcome.status, StepStatus::OK) << scene.outcome.reason;
  EXPECT_NEAR(scene.outcome.earliest_toc, 0.5, 1e-6);
  const FrameCounters total = scene.pipeline.monitor().total();
  EXPECT_EQ(total.of(StepStatus::NO_BODY), 2u);
  EXPECT_EQ(total.of(StepStatus::NO_TRANSFORM), 1u) << "the table's second frame gave way to the third";
  EXPECT_EQ(total.waiting(), 0u);
}

// As with a map: what was refused is newer than what is known, which is void with it.
TEST(StaticBodies, ARefusedFrameMakesTheOneBeforeVoid) {
  Tabled scene;
  scene.raise("table", 0.1);
  scene.take(Tabled::TABLE, 1, 0, 0);
  double stamp_s = 1.7e9;
  const auto feed = [&] {
    scene.take(Tabled::CLOTH, stamp_s += 0.1, 0.3f, 0);
    return scene.pipeline.nextOutcome(0, scene.outcome);
  };
  ASSERT_TRUE(feed());
  for (const bool cut : {true, false}) {
    ASSERT_TRUE(feed());
    ASSERT_TRUE(assuranceOf(scene.outcome).clear()) << scene.outcome.reason;
    MeshMessage bad{"sensor_msgs/PointCloud2", cloud(2, 0, {}, "table"), 0, 0};
    cut ? bad.bytes.resize(50) : void(bad.too_large = std::size_t{1} << 30);
    scene.pipeline.take(Tabled::TABLE, bad);
    for (int i = 0; i < 2; ++i) {
      ASSERT_TRUE(feed()) << "there is nothing to wait for";
      EXPECT_EQ(scene.outcome.status, StepStatus::NO_BODY);
      EXPECT_EQ(scene.outcome.reason.rfind("the newest frame of body 'table' was refused: ", 0), 0u)
          << scene.outcome.reason;
    }
    EXPECT_EQ(scene.pipeline.checkNow(0).status, StepStatus::NO_BODY);
    scene.take(Tabled::TABLE, 3, 0, 0);
    ASSERT_TRUE(feed());
  }
  EXPECT_EQ(scene.tables().of(StepStatus::BAD_MESSAGE), 2u);
  EXPECT_EQ(scene.pipeline.monitor().total().waiting(), 0u);
}

TEST(StaticBodies, CloudsThatComeFasterThanTfFindTheirPlace) {
  Tabled scene;
  scene.take(Tabled::CLOTH, 1, 0.3f, 0);
  ASSERT_TRUE(scene.pipeline.nextOutcome(0, scene.outcome));
  scene.take(Tabled::TABLE, 1, 0, 0);
  scene.pipeline.nextOutcome(SECOND_NS, scene.outcome);  // has waited in vain
  ASSERT_TRUE(scene.pipeline.idle(Tabled::TABLE));
  scene.take(Tabled::TABLE, 2, 0, SECOND_NS);
  scene.pipeline.nextOutcome(SECOND_NS, scene.outcome);
  EXPECT_FALSE(scene.pipeline.idle(Tabled::TABLE)) << "its transform may come in a moment";
  scene.raise("table", 0.1);
  scene.pipeline.nextOutcome(SECOND_NS + 1, scene.outcome);
  EXPECT_EQ(scene.tables().processed(), 1u);
  EXPECT_EQ(scene.tables().of(StepStatus::NO_TRANSFORM), 1u);
}

TEST(StaticBodies, WhatStillWaitsAtTheEndIsCounted) {
  Tabled scene;
  scene.take(Tabled::TABLE, 1, 0, 0);
  scene.pipeline.nextOutcome(SECOND_NS, scene.outcome);
  scene.pipeline.finish();
  EXPECT_FALSE(scene.pipeline.nextOutcome(SECOND_NS, scene.outcome));
  EXPECT_EQ(scene.tables().of(StepStatus::NO_TRANSFORM), 1u);
  EXPECT_EQ(scene.tables().waiting(), 0u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
