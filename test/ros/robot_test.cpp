// A robot's links through the live node: joint states become tf by robot_state_publisher, and tf carries the links.
#include <deformable_ccd/FirstContact.h>
#include <deformable_ccd/State.h>
#include <sensor_msgs/JointState.h>

#include "ros/support/live_tests.h"
#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {
namespace {

using deformable_ccd::ContactArray;
using deformable_ccd::State;

struct WithRobot : MonitorTest {
  explicit WithRobot(const std::string& name) : MonitorTest(name) {
    EXPECT_TRUE(waitUntil([&] { return joints.getNumSubscribers() > 0; }));
  }
  ros::Publisher joints = node.advertise<sensor_msgs::JointState>("/joint_states", 10);
  ros::Publisher mesh = advertiseAndWait<deformable_ccd::MeshStamped>(node, name_ + "/mesh");
  Probe<State> state{node, name_ + "/state"};
  Probe<deformable_ccd::FirstContact> first{node, name_ + "/first_contact"};

  Probe<tf2_msgs::TFMessage> tf{node, "/tf"};

  /// One by one: robot_state_publisher keeps no more than the newest message.
  void lift(double stamp_s, double height_m) {
    sensor_msgs::JointState message;
    message.header.stamp = ros::Time(stamp_s);
    message.name = {"lift"};
    message.position = {height_m};
    const std::size_t seen = tf.count();
    joints.publish(message);
    EXPECT_EQ(tf.after(seen).transforms.at(0).header.stamp, message.header.stamp);
  }
  /// What ~state says of a step that ends with the tip at this height.
  State moveTo(double z, double stamp_s) {
    send(mesh, meshStamped(tipAbove(z), stamp_s));
    State said;
    EXPECT_TRUE(waitUntil([&] {
      for (const State& one : state.all()) {
        if (one.holds_until == ros::Time(stamp_s)) said = one;
      }
      return said.holds_until == ros::Time(stamp_s);
    }));
    return said;
  }
};

struct Held : WithRobot {
  Held() : WithRobot("/held") {}
};

TEST_F(Held, TheTipMeetsTheLink) {
  for (const double stamp_s : {100.0, 100.1, 100.2}) lift(stamp_s, 0.1);
  send(mesh, meshStamped(tipAbove(0.3), 100));
  const State above = moveTo(0.2, 100.1);
  EXPECT_TRUE(above.proved) << above.reason;
  EXPECT_EQ(above.touching, State::NONE) << above.reason;
  const State met = moveTo(0.05, 100.2);
  EXPECT_TRUE(met.proved) << met.reason;
  EXPECT_EQ(met.touching, State::NEW) << met.reason;
  EXPECT_TRUE(waitUntil([&] { return first.count() > 0 && first.last().contact; }));
  EXPECT_NE(first.last().summary.find("plate"), std::string::npos) << first.last().summary;
}

TEST_F(Held, TheLinkMeetsTheTip) {
  lift(110, 0.1);
  lift(110.1, 0.25);
  send(mesh, meshStamped(tipAbove(0.2), 110));
  EXPECT_EQ(moveTo(0.2, 110.1).touching, State::NEW);
}

TEST_F(Held, WithoutJointStatesTheLinkIsNamed) {
  lift(120, 0.1);
  send(mesh, meshStamped(tipAbove(0.3), 120));
  const State said = moveTo(0.3, 120.1);
  EXPECT_FALSE(said.proved);
  EXPECT_NE(said.reason.find("'plate'"), std::string::npos) << said.reason;
}

struct Late : WithRobot {
  Late() : WithRobot("/late") {}
  static void SetUpTestSuite() {
    ros::NodeHandle node;
    EXPECT_FALSE(ros::service::exists("/late/reset", false)) << "it waits for its robot";
    std::string urdf;
    ASSERT_TRUE(node.getParam("robot_description", urdf));
    node.setParam("late_description", urdf);
  }
};

TEST_F(Late, TheLinksAreThereOnceTheDescriptionIs) {
  lift(200, 0.1);
  lift(200.1, 0.1);
  send(mesh, meshStamped(tipAbove(0.3), 200));
  EXPECT_EQ(moveTo(0.05, 200.1).touching, State::NEW);
}

struct Alone : WithRobot {
  Alone() : WithRobot("/alone") {}
};

TEST_F(Alone, WithoutARobotTheMonitorGoesOnAndDoesNotVouchForIt) {
  send(mesh, meshStamped(tipAbove(0.3), 300));
  const State said = moveTo(0.2, 300.1);
  EXPECT_FALSE(said.proved);
  EXPECT_EQ(said.touching, State::NONE);
  EXPECT_NE(said.reason.find("nothing of the robot is watched: parameter /nobodys_description was set by nobody"),
            std::string::npos)
      << said.reason;
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "robot_test"); }
