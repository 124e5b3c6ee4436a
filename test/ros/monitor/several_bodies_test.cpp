// The live node with several bodies: what is off has no topic, and one that is static and sent once stays.
#include <deformable_ccd/ContactArray.h>

#include <algorithm>

#include <gtest/gtest.h>
#include <octomap_msgs/Octomap.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>

#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {
namespace {

bool isAdvertised(const std::string& topic) {
  ros::master::V_TopicInfo topics;
  EXPECT_TRUE(ros::master::getTopics(topics));
  return std::any_of(topics.begin(), topics.end(), [&](const auto& info) { return info.name == topic; });
}

Mesh floorAt(double z) { return {{{-1, -1, z}, {1, -1, z}, {0, 1, z}}, {{0, 1, 2}}}; }
Mesh tipAt(double z) { return {{{0, 0, z}, {0.5, 0, z + 1}, {-0.5, 0, z + 1}}, {{0, 1, 2}}}; }

struct Pair : MonitorTest {
  Pair() : MonitorTest("/pair") {}
};

// What is off has no topic, neither to listen to nor to speak on.
TEST_F(Pair, EffectsThatAreOffHaveNoTopics) {
  const auto wanted = node.advertise<octomap_msgs::Octomap>("/octomap_binary", 1);
  const auto unwanted = node.advertise<octomap_msgs::Octomap>("/pair/octomap", 1);
  const auto rigid = node.advertise<deformable_ccd::MeshStamped>("/pair/finger", 1);
  EXPECT_TRUE(waitUntil([&] { return wanted.getNumSubscribers() > 0; })) << "auto listens for a map";
  EXPECT_EQ(unwanted.getNumSubscribers(), 0u) << "octomap: off";
  EXPECT_EQ(rigid.getNumSubscribers(), 0u) << "a rigid body has no stream";
  EXPECT_TRUE(isAdvertised("/plain/time_to_contact"));
  EXPECT_FALSE(isAdvertised("/pair/time_to_contact")) << "no look-ahead";
  EXPECT_FALSE(isAdvertised("/pair/predicted_contacts"));
}

struct Tabled : MonitorTest {
  Tabled() : MonitorTest("/tabled") {}
  ros::Publisher cloth = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/tabled/cloth");
  ros::Publisher table = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/tabled/table", true);
  double stamp_s = 10;

  void enable(bool on) {
    std_srvs::SetBool call;
    call.request.data = on;
    ASSERT_TRUE(ros::service::call("/tabled/enable", call));
  }
  /// A step of the cloth, four metres through the height 0.
  deformable_ccd::ContactArray fall() {
    send(cloth, meshStamped(tipAt(2), stamp_s += 1));
    return send(cloth, meshStamped(tipAt(-2), stamp_s += 0.1));
  }
  bool meetsTheTable() {
    const deformable_ccd::ContactArray step = fall();
    return step.status == deformable_ccd::ContactArray::OK && !step.contacts.empty();
  }
  bool isPastTheTable() {
    const deformable_ccd::ContactArray step = fall();
    return step.status == deformable_ccd::ContactArray::OK && step.contacts.empty();
  }
};

TEST_F(Tabled, AStaticBodysOnlyFrameCountsWhileTheMonitorIsDisabled) {
  table.publish(meshStamped(floorAt(0), 1));
  ASSERT_TRUE(waitUntil([&] { return meetsTheTable(); }));
  enable(false);
  table.publish(meshStamped(floorAt(-20), 2));
  ros::Duration(0.2).sleep();
  enable(true);
  EXPECT_TRUE(isPastTheTable()) << "the table is where it was last said to be";
}

TEST_F(Tabled, AStaticBodysFrameThatWaitsItsTurnStaysOverAReset) {
  table.publish(meshStamped(floorAt(0), 4));
  ASSERT_TRUE(waitUntil([&] { return meetsTheTable(); }));
  table.publish(meshStamped(floorAt(0), 5, "nowhere"));  // waits for its transform, and the next one behind it
  table.publish(meshStamped(floorAt(-20), 6));
  ros::Duration(0.2).sleep();
  ASSERT_TRUE(trigger("reset").success);
  EXPECT_TRUE(waitUntil([&] { return isPastTheTable(); }));
}

}  // namespace
}  // namespace test
}  // namespace dccd
