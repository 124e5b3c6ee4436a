// Why nothing comes, in words: what is waited for, and what may have been misspelt.
#include "input/silence.h"

#include <gtest/gtest.h>
#include <ros/time.h>

namespace dccd {
namespace {

TEST(Silence, WhatIsWaitedForIsNoMistake) {
  ros::Time::init();
  const AwaitedTopic cloth{"/tracker/cloth", 0, "mesh:=TOPIC", false};
  const std::string alone = silenceHint({cloth}, {{"/rosout", "rosgraph_msgs/Log"}});
  EXPECT_EQ(alone, "nobody publishes /tracker/cloth, nor anything else that could be a mesh, yet");
  EXPECT_TRUE(isYetToCome(alone));
  const std::string misspelt = silenceHint({cloth}, {{"/tracker/clothes", "sensor_msgs/PointCloud2"}});
  EXPECT_EQ(misspelt,
            "nobody publishes /tracker/cloth; give the mesh's topic with mesh:=TOPIC; published are /tracker/clothes "
            "(sensor_msgs/PointCloud2)");
  EXPECT_FALSE(isYetToCome(misspelt));
  // The master knew of it before the monitor was connected.
  EXPECT_EQ(silenceHint({cloth}, {{"/tracker/cloth", "sensor_msgs/PointCloud2"}}),
            "/tracker/cloth has a publisher, but no message has come (see rostopic hz and rosnode ping)");
  const std::string ended =
      silenceHint({{"/tracker/cloth", 0, "mesh:=TOPIC", true}}, {{"/tracker/cloth", "sensor_msgs/PointCloud2"}});
  EXPECT_EQ(ended, "nobody publishes /tracker/cloth any more; start its publisher again");
  EXPECT_FALSE(isYetToCome(ended));
  EXPECT_FALSE(isYetToCome(silenceHint({{"/octomap", 0, "", false}}, {}))) << "which was called for";
}

}  // namespace
}  // namespace dccd
