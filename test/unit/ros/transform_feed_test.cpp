// Transforms that cannot be used: left out, counted, and said once a child frame, with values and hint.
#include "input/transforms.h"

#include <gtest/gtest.h>

#include <limits>

#include "input/transform_tracks.h"
#include "node/bag_reading.h"
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
  TransformFeed feed;
};

TEST_F(TransformFeedTest, AQuaternionThatIsNoneIsSaidOnceWithItsValues) {
  const std::string said =
      "transforms of 'finger' are left out: its rotation x y z w (0 0 0 1.2) has the length 1.2; publish a quaternion "
      "of "
      "length 1";
  for (int k = 0; k < 3; ++k) {
    feed.add(turned("/finger", 1.2, 1 + k), k == 2);
    EXPECT_EQ(feed.takeProblems(), k == 0 ? std::vector<std::string>{said} : std::vector<std::string>{});
    EXPECT_EQ(feed.onlyUnusable(), said);
  }
  EXPECT_EQ(feed.unusable(), 3u);
  feed.add(turned("finger", 1, 5), false);
  EXPECT_EQ(feed.onlyUnusable(), "") << "now it has a place";
  feed.add(turned("finger", 0, 6), false);
  EXPECT_EQ(feed.onlyUnusable(), "") << "and keeps it";
  EXPECT_TRUE(feed.takeProblems().empty());
  EXPECT_EQ(feed.unusable(), 4u);
}

TEST_F(TransformFeedTest, WhereTimeBeginsAnewWhatWasSentForLaterTimesIsForgotten) {
  const auto isKnown = [&](const std::string& frame, StampNs stamp_ns) {
    Eigen::Isometry3d pose;
    std::string reason;
    return feed.lookup("world", frame, stamp_ns, pose, reason);
  };
  constexpr StampNs S = 1000000000;
  const auto send = [&](double until_s) {
    for (const char* frame : {"a", "b"}) {
      for (const double stamp_s : {1.0, until_s}) feed.add(turned(frame, 1, stamp_s), false, frame);
    }
  };
  feed.add(turned("fixed", 1, 20), true, "/fixed");
  send(2);
  feed.beginAnew(2 * S);
  EXPECT_TRUE(isKnown("a", 2 * S)) << "all of it is of the time that begins";
  feed.add(turned("b", 1, 12), false, "b");
  feed.beginAnew(2 * S);
  EXPECT_TRUE(isKnown("a", 2 * S));
  EXPECT_FALSE(isKnown("b", 2 * S)) << "what was sent of it was sent for the time before";
  EXPECT_TRUE(isKnown("fixed", 2 * S));
  feed.add(turned("b", 1, 2), false, "b");
  EXPECT_TRUE(isKnown("b", 2 * S)) << "its publisher begins anew, too";

  send(40);
  feed.beginAnew(2 * S);
  for (const char* frame : {"a", "b"}) EXPECT_FALSE(isKnown(frame, 2 * S)) << "all of them";
  send(50);
  for (const double stamp_s : {1.0, 2.0, 9.0}) feed.add(turned("a", 1, stamp_s), false, "a");
  feed.beginAnew(2 * S);
  EXPECT_TRUE(isKnown("a", 2 * S)) << "it went back before, and was sent ahead since";
  EXPECT_FALSE(isKnown("b", 2 * S));
  feed.beginAnew(2 * S);
  EXPECT_FALSE(isKnown("a", 2 * S)) << "the next time it did not";
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
    const std::vector<std::string> said = feed.takeProblems();
    ASSERT_EQ(said.size(), 1u) << problem;
    EXPECT_NE(said[0].find(problem), std::string::npos) << said[0];
    EXPECT_LT(said[0].size(), 1000u);
  }
  // What two tools round apart is taken as tf2 takes it.
  feed.add(turned("h", 1.004, 1), false);
  EXPECT_TRUE(feed.takeProblems().empty());
}

TEST_F(TransformFeedTest, AFloodOfNamesIsToldOfInPartAndCountedWhole) {
  for (int k = 0; k < 1000; ++k) feed.add(turned("frame" + std::to_string(k), 1.5, 1), false);
  EXPECT_EQ(feed.takeProblems().size(), TransformFeed::MAX_TOLD);
  EXPECT_EQ(feed.unusable(), 1000u);
}

TEST_F(TransformFeedTest, AFrameThatWasElsewhereAtAStampBeginsAnew) {
  Eigen::Isometry3d pose;
  std::string reason;
  for (const double stamp_s : {1.0, 1.25, 1.5}) feed.add(turned("finger", 1, stamp_s, 3), false);
  EXPECT_FALSE(feed.add(turned("finger", 1, 1.25, 3), false)) << "the same once more, as a loop sends it";
  EXPECT_FALSE(feed.add(turned("finger", 1, 1.125, 7), false)) << "late, and nothing contradicts it";
  EXPECT_FALSE(feed.add(turned("finger", 1, 1.5, 4), false)) << "the newest stays what came first, as tf2 has it";
  EXPECT_FALSE(feed.add(turned("finger", 1, 1.25, 3 + 5e-7), false)) << "as two broadcasters round";
  const tf2_msgs::TFMessage elsewhere = turned("finger", 1, 1.25, 5);
  EXPECT_TRUE(feed.clears(elsewhere, false));
  EXPECT_TRUE(feed.add(elsewhere, false));
  ASSERT_TRUE(feed.lookup("world", "finger", 1250000000, pose, reason)) << reason;
  EXPECT_EQ(pose.translation().x(), 5);
  EXPECT_FALSE(feed.lookup("world", "finger", 1500000000, pose, reason)) << "that was before";
  feed.add(turned("finger", 1, 1.5, 5), false);
  EXPECT_TRUE(feed.add(turned("finger", 1, 1.25, 5, "arm"), false)) << "of another parent";
  feed.add(turned("finger", 1, 1.5, 5, "arm"), false);
  EXPECT_FALSE(feed.clears(turned("finger", std::numeric_limits<double>::quiet_NaN(), 1.25, 5), false)) << "left out";
}

// The frame came for 1.5 s as well, and that was forgotten: from 1.25 s to 1.75 s nobody knows where it went.
TEST_F(TransformFeedTest, WhatWasForgottenAfterAStampIsAGapUpToTheNextOne) {
  // Sent again by the one that sent it, or by another one.
  for (const auto& [frame, second] : {std::pair("finger", "/arm"), std::pair("thumb", "/other")}) {
    feed.add(turned("camera", 1, 1, 0), false, "/camera");
    for (const double stamp_s : {1.0, 1.25, 1.5}) feed.add(turned(frame, 1, stamp_s, 3), false, "/arm");
    EXPECT_TRUE(feed.add(turned(frame, 1, 1.25, 5), false, second));
    for (const double stamp_s : {1.75, 2.0}) feed.add(turned(frame, 1, stamp_s, 3), false, "/arm");
    std::vector<TransformFeed::NewParent> changes;
    feed.stampsBetween("world", frame, 1300000000, 1600000000, changes);
    ASSERT_EQ(changes.size(), 1u) << second;
    EXPECT_EQ(changes[0].now, nullptr);
    changes.clear();
    feed.stampsBetween("world", frame, 1800000000, 1900000000, changes);
    EXPECT_TRUE(changes.empty()) << "after that it is known again";
  }
}

// Two clocks 1.5 s apart on one frame that nobody asks for cost that frame alone.
TEST_F(TransformFeedTest, TwoPublishersOfAFrameForgetThatFrameAlone) {
  Eigen::Isometry3d pose;
  std::string reason;
  for (int k = 0; k < 50; ++k) {
    const double now_s = 10 + 0.1 * k;
    feed.add(turned("finger", 1, now_s, k), false, "/arm");
    feed.add(turned("tip", 1, now_s, 1, "spinner"), false, "/arm");
    feed.add(turned("spinner", 1, now_s, 1), false, "/one");
    EXPECT_FALSE(feed.clears(turned("spinner", 1, now_s - 1.5, 5), false, "/two"));
    EXPECT_EQ(feed.add(turned("spinner", 1, now_s - 1.5, 5), false, "/two"), true) << k;
  }
  EXPECT_EQ(feed.timesForgotten(), 0u);
  ASSERT_TRUE(feed.lookup("world", "finger", 10050000000, pose, reason)) << reason;
  EXPECT_NEAR(pose.translation().x(), 0.5, 1e-12) << "all of it is there, by tf2";
  std::vector<TransformFeed::NewParent> changes;
  EXPECT_EQ(feed.stampsBetween("world", "finger", 10000000000, 14900000000, changes).size(), 48u);
  EXPECT_TRUE(changes.empty());
  EXPECT_FALSE(feed.lookup("world", "tip", 14900000000, pose, reason));
  EXPECT_EQ(
      reason,
      "nothing is known of 'spinner' then; what was sent before is forgotten, as the stamps of '/one' and '/two', "
      "which both send it, are apart");
  ASSERT_TRUE(feed.lookup("world", "tip", 13400000000, pose, reason)) << reason;
  EXPECT_EQ(pose.translation().x(), 6) << "of the last stamp, as it was sent";
  feed.add(turned("spinner", 1, 15, 1), false, "/one");
  EXPECT_FALSE(feed.lookup("world", "spinner", 14000000000, pose, reason)) << "between two clocks";
  feed.add(turned("spinner", 1, 15.5, 2), false, "/one");
  ASSERT_TRUE(feed.lookup("world", "spinner", 15250000000, pose, reason)) << reason;
  EXPECT_DOUBLE_EQ(pose.translation().x(), 1.5) << "between two of one";
  ASSERT_TRUE(feed.lookup("spinner", "world", 0, pose, reason)) << reason;
  EXPECT_EQ(pose.translation().x(), -2) << "the newest";
  feed.stampsBetween("world", "spinner", 13000000000, 15500000000, changes);
  EXPECT_FALSE(changes.empty()) << "where it was before that nobody knows";
}

// As a node that passes on two recordings that are played in loops.
TEST_F(TransformFeedTest, TwoStreamsUnderOneNameHaveNoPlaceBetweenThem) {
  Eigen::Isometry3d pose;
  std::string reason;
  for (const bool alone : {true, false}) {  // then all is forgotten at once, and not the publisher's frames
    TransformFeed fresh;
    if (!alone) fresh.add(turned("camera", 1, 10), false, "/camera");
    for (int k = 0; k < 50; ++k) {
      const double now_s = 10 + 0.1 * k;
      fresh.add(turned("finger", 1, now_s, k), false, "/relay");
      EXPECT_FALSE(fresh.lookup("world", "finger", std::llround(1e9 * (now_s - 0.7)), pose, reason)) << k;
      fresh.add(turned("finger", 1, now_s - 1.5, 5), false, "/relay");
    }
  }
}

TEST_F(TransformFeedTest, AFrameThatChangesItsParentHasItsPlaceAtBothStamps) {
  feed.add(turned("arm", 1, 1), true);
  for (const double stamp_s : {1.0, 1.25, 1.5}) {
    feed.add(turned("finger", 1, stamp_s, 3, stamp_s < 1.5 ? "world" : "arm"), false);
  }
  const std::string world = "world";
  const TransformTracks tracks(feed, world);
  EXPECT_EQ(tracks.doubtAt("world", "finger", 1250000000), "");
  EXPECT_NE(tracks.doubtAt("world", "finger", 1250000001), "") << "between the two";
  EXPECT_NE(tracks.doubtAt("world", "finger", 1499999999), "");
  EXPECT_EQ(tracks.doubtAt("world", "finger", 1500000000), "");
}

TEST_F(TransformFeedTest, ALoopGoesOnOverItsOwnEnd) {
  Eigen::Isometry3d pose;
  std::string reason;
  for (const double begin_s : {10.0, 10.125}) {
    for (int k = 0; k < 6; ++k) feed.add(turned("finger", 1, begin_s + 0.75 * k, k), false);
  }
  EXPECT_TRUE(feed.lookup("world", "finger", 13500000000, pose, reason)) << reason;
  EXPECT_NEAR(pose.translation().x(), 4.5, 1e-9) << "between 13.125 and 13.875 s, and the first run ended at 13.75";
}

TEST_F(TransformFeedTest, APublisherWhoseStampsGoBackForgetsWhatItSent) {
  Eigen::Isometry3d pose;
  std::string reason;
  for (const double stamp_s : {10.0, 11.0, 12.0}) {
    feed.add(turned("finger", 1, stamp_s, 1), false, "/arm");
    feed.add(turned("hand", 1, stamp_s, 1), false, "/arm");
    feed.add(turned("camera", 1, stamp_s, 1), false, "/camera");
  }
  EXPECT_TRUE(feed.clears(turned("finger", 1, 5, 2), false, "/arm"));
  EXPECT_TRUE(feed.add(turned("finger", 1, 5, 2), false, "/arm"));
  EXPECT_TRUE(feed.lookup("world", "camera", 11500000000, pose, reason)) << reason;
  EXPECT_FALSE(feed.lookup("world", "hand", 11500000000, pose, reason)) << "tf2 still has it";
  EXPECT_EQ(reason,
            "nothing is known of 'hand' then; what was sent before is forgotten, as the stamps of '/arm' went back");
  EXPECT_FALSE(feed.lookup("world", "hand", 0, pose, reason));
  EXPECT_FALSE(feed.add(turned("hand", 1, 5, 2), false, "/arm")) << "once for all that it sends";
  EXPECT_TRUE(feed.lookup("world", "hand", 5000000000, pose, reason)) << reason;
  EXPECT_TRUE(feed.add(turned("camera", 1, 5, 2), false, "/camera"));
  ASSERT_TRUE(feed.lookup("camera", "finger", 5000000000, pose, reason)) << reason;
  EXPECT_EQ(pose.translation().x(), 0);
}

// What the node takes in 10 s analyze_bag takes in 70 s: the transforms of two humanoids, far more slowly than the
// limit.
TEST(TransformFeedLimit, IsOfARate) {
  TransformFeed feed(TransformWindow::length().toSec());
  tf2_msgs::TFMessage message;
  for (int frame = 0; frame < 90; ++frame) {
    message.transforms.push_back(turned("link" + std::to_string(frame), 1, 0).transforms[0]);
  }
  for (int k = 0; k < 6900; ++k) {
    for (auto& transform : message.transforms) transform.header.stamp = ros::Time(100 + 0.01 * k);
    ASSERT_FALSE(feed.add(message, false)) << k;
  }
  EXPECT_EQ(feed.timesForgotten(), 0u);
}

TEST_F(TransformFeedTest, AFrameOnBothTopicsHasNoPlaceUnlessTheyAgree) {
  Eigen::Isometry3d pose;
  std::string reason;
  for (const bool static_first : {true, false}) {
    const std::string tool = static_first ? "tool" : "other";
    feed.add(turned(tool, 1, 1, 3), static_first);
    feed.add(turned("tip of " + tool, 1, 1, 1, tool), true);
    feed.add(turned(tool, 1, 1.5, 3.0005), !static_first);
    EXPECT_TRUE(feed.lookup("world", "tip of " + tool, 1000000000, pose, reason)) << reason;
    EXPECT_EQ(pose.translation().x(), 4);
    EXPECT_TRUE(feed.takeProblems().empty());
    feed.add(turned(tool, 1, 2, 3.5), !static_first);
    EXPECT_FALSE(feed.lookup("world", "tip of " + tool, 1000000000, pose, reason));
    EXPECT_EQ(reason, "'" + tool + "' is on /tf and, elsewhere, on /tf_static");
    EXPECT_FALSE(feed.lookup(tool, "world", 0, pose, reason)) << "the newest one, too";
    EXPECT_TRUE(feed.lookup(tool, "tip of " + tool, 1000000000, pose, reason)) << reason;
    ASSERT_EQ(feed.takeProblems().size(), 1u);
  }
}

TEST_F(TransformFeedTest, WhatAFrameOnBothTopicsCarriedHasNoPlaceAtThatTime) {
  feed.add(turned("tool", 1, 1, 3), true);
  for (const double stamp_s : {1.0, 1.5}) feed.add(turned("cup", 1, stamp_s, 0, "tool"), false);
  feed.add(turned("cup", 1, 2, 3), false);
  feed.add(turned("tool", 1, 2, 3.5), false);
  Eigen::Isometry3d pose;
  std::string reason;
  EXPECT_TRUE(feed.lookup("world", "cup", 2000000000, pose, reason)) << reason;
  EXPECT_FALSE(feed.lookup("world", "cup", 1500000000, pose, reason));
  EXPECT_EQ(reason, "'tool' is on /tf and, elsewhere, on /tf_static");
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
