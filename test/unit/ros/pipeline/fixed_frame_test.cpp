// The fixed frame, where it is learnt from the first message, and names of frames that tf2 does not take.
#include <gtest/gtest.h>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"
#include "unit/ros/robot/robot_texts.h"

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

/// A cloth in the frame of a tracker's head, from which the fixed frame is learnt.
struct Head : Driven {
  explicit Head(const std::string& more = "") : Driven(parameters("max_vertex_step_m: 0.0" + more)) {}
  /// The head is that high in the world then.
  const Outcome& feedAt(double stamp_s, double head_z) {
    tell({above("head", head_z, ros::Time(stamp_s))});
    return feed(stamp_s, 0.25f, {}, "head");
  }
  /// As octomap_file without octomap_frame has it: in the fixed frame.
  void giveMapOfTheFixedFrame() {
    LoadedMap loaded = decodeMapMessage(map(1), config);
    loaded.frame_id.clear();
    pipeline.setMap(std::move(loaded), 0);
  }
  ::testing::AssertionResult isClear() const {
    return (assuranceOf(outcome).clear() ? ::testing::AssertionSuccess() : ::testing::AssertionFailure())
           << joinedText(outcome.missing());
  }
};

// Voxels of the fixed frame rode along with the tracker's camera, through the cloth, and each step was clear.
TEST(FixedFrame, OneThatWasLearntAndMovesHoldsNoMap) {
  Head learnt;
  learnt.giveMapOfTheFixedFrame();
  learnt.feedAt(1, 1);
  learnt.feedAt(1.1, 1);
  EXPECT_TRUE(learnt.isClear());
  learnt.feedAt(1.2, 1.0005);
  EXPECT_TRUE(learnt.isClear()) << "within rigid_tolerance_m";
  learnt.feedAt(1.3, 0.9);
  EXPECT_TRUE(learnt.outcome.answered);
  EXPECT_FALSE(learnt.isClear());
  EXPECT_TRUE(says(learnt.outcome.missing(),
                   "the fixed frame 'head' was learnt and moves in 'world'; set fixed_frame to a frame at rest"))
      << joinedText(learnt.outcome.missing());
  learnt.feedAt(1.4, 1);
  EXPECT_FALSE(learnt.isClear()) << "it is back, and no frame at rest";
  learnt.pipeline.reset(StepStatus::RESET);
  learnt.feedAt(1.5, 0.9);
  learnt.feedAt(1.6, 0.9);
  EXPECT_TRUE(learnt.isClear()) << "learnt anew, it is at rest";
}

TEST(FixedFrame, OneThatWasLearntAndMovesHoldsNoStaticBody) {
  Head learnt(std::string(", effects: {octomap: 'off'}, ") + CLOTH_AND_TABLE);
  learnt.take(1, cloud(1, 0, {}, "head"));
  learnt.feedAt(1, 1);
  learnt.feedAt(1.1, 1);
  EXPECT_TRUE(learnt.isClear());
  learnt.feedAt(1.2, 0.9);
  EXPECT_TRUE(says(learnt.outcome.missing(), "'head' was learnt and moves")) << joinedText(learnt.outcome.missing());
}

TEST(FixedFrame, OneThatWasLearntMayMoveWhereNothingIsHeldInIt) {
  Head learnt(", effects: {octomap: 'off'}");
  learnt.feedAt(1, 1);
  learnt.feedAt(1.1, 1);
  learnt.feedAt(1.2, 0.9);
  EXPECT_TRUE(learnt.isClear());
}

TEST(FixedFrame, OneThatWasNamedIsTakenToRest) {
  Head named(", fixed_frame: head");
  named.giveMapOfTheFixedFrame();
  named.feedAt(1, 1);
  named.feedAt(1.1, 1);
  named.feedAt(1.2, 0.9);
  EXPECT_TRUE(named.isClear());
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
