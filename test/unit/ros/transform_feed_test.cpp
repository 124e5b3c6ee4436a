// Transforms that cannot be used: left out, counted, and said once a child frame, with values and remedy.
#include "input/transforms.h"

#include <gtest/gtest.h>

#include <limits>

#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

tf2_msgs::TFMessage turned(const std::string& child, double w, double stamp_s, double x = 0,
                           const std::string& parent = "world") {
  geometry_msgs::TransformStamped one = above(child, 0, ros::Time(stamp_s));
  one.header.frame_id = parent;
  one.transform.translation.x = x;
  one.transform.rotation.w = w;
  tf2_msgs::TFMessage message;
  message.transforms = {one};
  return message;
}

struct TransformFeedTest : ::testing::Test {
  tf2::BufferCore buffer;
  TransformFeed feed{buffer};
};

TEST_F(TransformFeedTest, AQuaternionThatIsNoneIsSaidOnceWithItsValues) {
  const std::string said =
      "transforms of 'finger' are left out: its rotation x y z w (0 0 0 1.2) has the length 1.2; publish a quaternion "
      "of "
      "length 1";
  for (int k = 0; k < 3; ++k) {
    feed.add(turned("/finger", 1.2, 1 + k), k == 2);
    EXPECT_EQ(feed.takeComplaints(), k == 0 ? std::vector<std::string>{said} : std::vector<std::string>{});
    EXPECT_EQ(feed.onlyUnusable(), said);
  }
  EXPECT_EQ(feed.unusable(), 3u);
  feed.add(turned("finger", 1, 5), false);
  EXPECT_EQ(feed.onlyUnusable(), "") << "now it has a place";
  feed.add(turned("finger", 0, 6), false);
  EXPECT_EQ(feed.onlyUnusable(), "") << "and keeps it";
  EXPECT_TRUE(feed.takeComplaints().empty());
  EXPECT_EQ(feed.unusable(), 4u);
}

TEST_F(TransformFeedTest, WhateverIsWrongIsNamed) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::pair<tf2_msgs::TFMessage, const char*> cases[] = {
      {turned("a", 0, 1), "its rotation x y z w (0 0 0 0) has the length 0"},
      {turned("b", nan, 1), "its rotation x y z w (0 0 0 nan) has the length nan"},
      {turned("c", 1, 1, nan), "its translation (nan 0 0) is not finite"},
      {turned("d", 1, 1, 0, "/d"), "it is its own parent"},
      {turned("e", 1, 1, 0, ""), "frame_id: it is empty"},
      {turned("//f", 1, 1), "child_frame_id: it begins with a slash"},
      {turned(std::string(5000, 'g'), 1, 1), "child_frame_id: it has 5000 characters"},
  };
  for (const auto& [message, problem] : cases) {
    feed.add(message, false);
    const std::vector<std::string> said = feed.takeComplaints();
    ASSERT_EQ(said.size(), 1u) << problem;
    EXPECT_NE(said[0].find(problem), std::string::npos) << said[0];
    EXPECT_LT(said[0].size(), 1000u);
  }
  // What two tools round apart is taken as tf2 takes it.
  feed.add(turned("h", 1.004, 1), false);
  EXPECT_TRUE(feed.takeComplaints().empty());
}

TEST_F(TransformFeedTest, AFloodOfNamesIsToldOfInPartAndCountedWhole) {
  for (int k = 0; k < 1000; ++k) feed.add(turned("frame" + std::to_string(k), 1.5, 1), false);
  EXPECT_EQ(feed.takeComplaints().size(), TransformFeed::MAX_TOLD);
  EXPECT_EQ(feed.unusable(), 1000u);
}

TEST_F(TransformFeedTest, TheReasonOfAFrameWithoutAPlaceNamesThem) {
  Driven driven(scene("transform_timeout_s: 0.0"));
  driven.feed_tf.add(turned("camera", 1.2, 1), true);
  const Outcome& outcome = driven.feed(1, 0.2f, {}, "camera");
  EXPECT_EQ(outcome.status, StepStatus::NO_TRANSFORM);
  EXPECT_NE(outcome.reason.find("no transform from 'camera' to 'world': "), std::string::npos) << outcome.reason;
  EXPECT_NE(outcome.reason.find("; transforms of 'camera' are left out: its rotation x y z w (0 0 0 1.2) has"),
            std::string::npos)
      << outcome.reason;
  driven.feed_tf.add(turned("camera", 1, 2), true);
  EXPECT_EQ(driven.feed(3, 0.2f, {}, "camera").status, StepStatus::FIRST_FRAME);
}

}  // namespace
}  // namespace test
}  // namespace dccd
