// The fixed frame, where it is learnt from the first message, and names of frames that tf2 does not take.
#include <gtest/gtest.h>

#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

TEST(FixedFrame, OneThatWasLearntIsLearntAnewAfterAReset) {
  Driven learnt(parameters("max_vertex_step_m: 0.0"));
  learnt.raise("camera", 0.1);
  learnt.giveMap(1);
  learnt.feed(1, 0.25f, {}, "camera");
  learnt.pipeline.reset(StepStatus::RESET);
  learnt.feed(2, 0.35f);
  const Outcome& outcome = learnt.feed(2.1, -0.05f);
  EXPECT_EQ(learnt.pipeline.fixedFrame(), "world");
  EXPECT_NEAR(outcome.earliest_toc, 0.875, 1e-4) << "the map is where it was, 0.35 m below the mesh";
}

TEST(FixedFrame, OneInWhichNothingWasAnsweredGivesWay) {
  Driven learnt(parameters("max_vertex_step_m: 0.0, transform_timeout_s: 0.0"));
  learnt.giveMap(1);
  learnt.feed(1, 0.25f, {}, "nowhere");
  EXPECT_EQ(learnt.pipeline.fixedFrame(), "nowhere");
  EXPECT_EQ(learnt.feed(1.1, 0.35f).status, StepStatus::NO_TRANSFORM);
  EXPECT_NE(learnt.outcome.reason.find("from 'world' to 'nowhere'"), std::string::npos) << learnt.outcome.reason;
  EXPECT_EQ(learnt.feed(1.2, 0.35f).status, StepStatus::FIRST_FRAME);
  const Outcome& outcome = learnt.feed(1.3, -0.05f);
  EXPECT_NEAR(outcome.earliest_toc, 0.875, 1e-4) << "the map has its place in the new one";
  // From the first answer on it stays.
  EXPECT_EQ(learnt.feed(1.4, 0.25f, {}, "nowhere").status, StepStatus::NO_TRANSFORM);
  EXPECT_EQ(learnt.feed(1.5, 0.25f, {}, "nowhere").status, StepStatus::NO_TRANSFORM);
  EXPECT_EQ(learnt.pipeline.fixedFrame(), "world");
  EXPECT_EQ(learnt.pipeline.monitor().total().waiting(), 0u);
}

TEST(FrameNames, OnesThatTf2DoesNotTakeAreRefusedInFewWords) {
  Driven driven(scene());
  driven.giveMap(1);
  driven.feed(1, 0.35f);
  for (const std::string& name : {std::string("//cam"), std::string("/"), std::string(10000000, 'x')}) {
    EXPECT_EQ(driven.feed(1.1, 0.35f, {}, name).status, StepStatus::BAD_MESSAGE);
    EXPECT_LT(driven.outcome.reason.size(), 400u);
  }
  EXPECT_EQ(driven.feed(1.2, 0.3f, {}, "/world").status, StepStatus::PARTIAL) << "the three before it are missed";
  EXPECT_EQ(driven.feed(1.3, -0.05f, {}, "/world").status, StepStatus::OK) << "one slash was tf's own way";
}

}  // namespace
}  // namespace test
}  // namespace dccd
