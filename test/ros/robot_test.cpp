// A robot's links through the live node: joint states become tf by robot_state_publisher, and tf carries the links.
#include <deformable_ccd/AttachObject.h>
#include <deformable_ccd/FirstContact.h>
#include <deformable_ccd/Named.h>
#include <deformable_ccd/SafeUntil.h>
#include <deformable_ccd/SetHold.h>
#include <deformable_ccd/State.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <dynamic_reconfigure/Reconfigure.h>
#include <sensor_msgs/JointState.h>

#include <cstdlib>

#include "dccd/elementary.h"
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
  Probe<deformable_ccd::SafeUntil> promises{node, name_ + "/safe_until"};

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
  /// What ~safe_until says of that step.
  deformable_ccd::SafeUntil promisedAt(double stamp_s) {
    EXPECT_TRUE(waitUntil([&] { return promises.count() > 0 && promises.last().header.stamp == ros::Time(stamp_s); }));
    return promises.last();
  }
  /// The promise and the state that are latched are void for this reason, though no step has come.
  void expectRevoked(const std::string& why) {
    EXPECT_TRUE(waitUntil([&] { return promises.last().reason == why; })) << promises.last().reason;
    EXPECT_EQ(promises.last().seconds, 0) << why;
    EXPECT_EQ(promises.last().until, promises.last().header.stamp) << why;
    const std::string reason = why + "; no step has been answered since";
    EXPECT_TRUE(waitUntil([&] { return state.last().reason.find(reason) != std::string::npos; }))
        << state.last().reason;
    EXPECT_FALSE(state.last().proved || state.last().clear) << why;
  }
};

// The first case: it waits for ten seconds. Joint states that go back robot_state_publisher leaves out.
struct Late : WithRobot {
  Late() : WithRobot("/cell/late") {}
  static void SetUpTestSuite() {
    ros::NodeHandle node;
    EXPECT_FALSE(ros::service::exists("/cell/late/reset", false)) << "it waits for its robot";
    Probe<State> state{node, "/cell/late/state"};
    EXPECT_TRUE(waitUntil([&] { return state.count() > 0; }));
    EXPECT_NE(state.last().reason.find("waits for parameter /cell/late_description, a URDF, for 10 s at most"),
              std::string::npos)
        << state.last().reason;
    EXPECT_FALSE(state.last().proved);
    std::string urdf;
    ASSERT_TRUE(node.getParam("robot_description", urdf));
    node.setParam("late_description", urdf);
  }
};

TEST_F(Late, TheLinksAreThereOnceTheDescriptionIs) {
  lift(90, 0.1);
  lift(90.1, 0.1);
  send(mesh, meshStamped(tipAbove(0.3), 90));
  EXPECT_EQ(moveTo(0.05, 90.1).touching, State::NEW);
}

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

TEST_F(Held, WithoutJointStatesTheLinkIsNamed) {
  lift(120, 0.1);
  send(mesh, meshStamped(tipAbove(0.3), 120));
  const State said = moveTo(0.3, 120.1);
  EXPECT_FALSE(said.proved);
  EXPECT_NE(said.reason.find("'plate'"), std::string::npos) << said.reason;
}

/// What a service says.
template <class Call>
typename Call::Response called(const std::string& service, const Call& asked) {
  Call call = asked;
  EXPECT_TRUE(ros::service::call(service, call)) << service;
  return call.response;
}

deformable_ccd::AttachObject rod() {
  deformable_ccd::AttachObject call;
  call.request.name = "rod";
  call.request.link = "plate";
  call.request.pose.position.z = 0.2;
  call.request.pose.orientation.w = 1;
  call.request.primitive.type = shape_msgs::SolidPrimitive::CYLINDER;
  call.request.primitive.dimensions = {0.01, 0.5};
  return call;
}

// A disc above the plate goes with it, stays where it is let go, and is gone when it is removed.
TEST_F(Held, WhatIsAttachedGoesWithTheLinkUntilItIsLetGo) {
  for (int i = 0; i < 5; ++i) lift(130 + 0.1 * i, 0.1);
  send(mesh, meshStamped(tipAbove(0.5), 130));
  EXPECT_TRUE(moveTo(0.5, 130.1).clear);
  EXPECT_GT(promisedAt(130.1).seconds, 0);
  ASSERT_TRUE(called("/held/attach", rod()).success);
  expectRevoked("object 'rod' was attached");
  const State met = moveTo(0.29, 130.2);
  EXPECT_EQ(met.touching, State::NEW) << met.reason;
  EXPECT_TRUE(met.proved) << met.reason;
  EXPECT_TRUE(waitUntil([&] { return first.count() > 0 && first.last().summary.find("rod") != std::string::npos; }));
  // Its recording gives the same bits.
  const std::string files = trigger("record_step").message,
                    file = files.substr(files.find('/'), files.find(".step") + 5 - files.find('/'));
  EXPECT_EQ(std::system(("rosrun deformable_ccd replay_step " + file).c_str()), 0) << files;
  EXPECT_FALSE(moveTo(0.5, 130.3).clear) << "on its way back through it";
  deformable_ccd::Named let_go;
  let_go.request.name = "rod";
  EXPECT_TRUE(moveTo(0.5, 130.35).clear);
  EXPECT_GT(promisedAt(130.35).seconds, 0);
  ASSERT_TRUE(called("/held/detach", let_go).success);
  expectRevoked("object 'rod' was detached");
  EXPECT_FALSE(moveTo(0.5, 130.4).proved) << "when in this step it was let go nobody says";
  lift(130.5, 0.3);
  lift(130.6, 0.3);
  EXPECT_TRUE(moveTo(0.5, 130.5).clear) << "the plate rises to 0.3, the disc stays at 0.3, and would be at 0.5";
  EXPECT_TRUE(moveTo(0.31, 130.6).clear) << "just above the disc";
  deformable_ccd::Named remove;
  remove.request.name = "rod";
  EXPECT_GT(promisedAt(130.6).seconds, 0);
  ASSERT_TRUE(called("/held/remove", remove).success);
  expectRevoked("object 'rod' was removed");
  lift(130.7, 0.1);
  lift(130.8, 0.1);
  EXPECT_TRUE(moveTo(0.31, 130.7).clear);
  EXPECT_TRUE(moveTo(0.2, 130.8).clear) << "through where the disc was";
}

TEST_F(Held, WhatIsRefusedIsAnsweredInALineAndCounted) {
  Probe<diagnostic_msgs::DiagnosticArray> diagnostics(node, "/diagnostics");
  const auto refused = [&] {
    std::string count;
    for (const auto& array : diagnostics.all()) {
      for (const auto& status : array.status) {
        for (const auto& value : status.values) {
          if (status.name.find("held") != std::string::npos && value.key == "refused requests for objects")
            count = value.value;
        }
      }
    }
    return count;
  };
  ASSERT_TRUE(waitUntil([&] { return !refused().empty(); }));
  const int before = std::stoi(refused());
  deformable_ccd::AttachObject call = rod();
  call.request.link = "plat";
  const auto unknown = called("/held/attach", call);
  EXPECT_FALSE(unknown.success);
  EXPECT_EQ(unknown.message,
            "object 'rod': link is 'plat', which is no link of a robot and no rigid body; nearest is 'plate'");
  deformable_ccd::Named let_go;
  let_go.request.name = "rod";
  EXPECT_FALSE(called("/held/detach", let_go).success);
  deformable_ccd::Named remove;
  EXPECT_FALSE(called("/held/remove", remove).success);
  EXPECT_TRUE(waitUntil([&] { return std::stoi(refused()) == before + 3; })) << refused();
}

// dynamic_reconfigure answers what is in force.
TEST_F(Held, ExactIsRefusedAsLongAsSomethingAttachedHasPadding) {
  const auto setAccuracy = [](Accuracy accuracy) {
    dynamic_reconfigure::Reconfigure call;
    call.request.config.ints.emplace_back();
    call.request.config.ints[0].name = "accuracy";
    call.request.config.ints[0].value = static_cast<int>(accuracy);
    EXPECT_TRUE(ros::service::call("/held/live/set_parameters", call));
    for (const auto& value : call.response.config.ints) {
      if (value.name == "accuracy") return static_cast<Accuracy>(value.value);
    }
    return Accuracy();
  };
  ASSERT_EQ(setAccuracy(Accuracy::CONSERVATIVE), Accuracy::CONSERVATIVE);
  deformable_ccd::AttachObject padded = rod();
  padded.request.padding_m = 0.01;
  const auto said = called("/held/attach", padded);
  ASSERT_TRUE(said.success) << said.message;
  EXPECT_EQ(setAccuracy(Accuracy::EXACT), Accuracy::CONSERVATIVE);
  deformable_ccd::Named remove;
  remove.request.name = "rod";
  ASSERT_TRUE(called("/held/remove", remove).success);
  EXPECT_EQ(setAccuracy(Accuracy::EXACT), Accuracy::EXACT);
}

// Nobody saw how it came there: the step is not answered. A smaller jump is a path like any other.
TEST_F(Held, AJointThatJumpsIsASeamAndNeverClear) {
  lift(140, 0.1);
  lift(140.1, 0.1);
  lift(140.2, 0.9);
  lift(140.3, 0.9);
  lift(140.4, 0.6);
  send(mesh, meshStamped(tipAbove(0.5), 140));
  EXPECT_TRUE(moveTo(0.5, 140.1).clear);
  const ContactArray jumped = send(mesh, meshStamped(tipAbove(0.5), 140.2));
  EXPECT_EQ(jumped.status, ContactArray::TELEPORT) << jumped.reason;
  EXPECT_NE(jumped.reason.find("'plate'"), std::string::npos) << jumped.reason;
  EXPECT_TRUE(waitUntil([&] { return !state.last().clear; }));
  EXPECT_TRUE(moveTo(0.5, 140.3).proved);
  EXPECT_TRUE(moveTo(0.5, 140.4).proved) << "by 0.3 m";
}

struct Changing : WithRobot {
  Changing() : WithRobot("/changing") {}
  void SetUp() override {
    static double next_s = 150;
    begin_s = next_s++;
    for (int i = 0; i < 5; ++i) lift(begin_s + 0.1 * i, 0.1);
    send(mesh, meshStamped(tipAbove(0.3), begin_s));
  }
  double begin_s = 0;
};

TEST_F(Changing, WhatTheHandHoldsIsExpectedUntilItIsSaidToBeOpen) {
  EXPECT_EQ(moveTo(0.05, begin_s + 0.1).touching, State::EXPECTED);
  EXPECT_EQ(promisedAt(begin_s + 0.1).seconds, 10) << "nothing else is near";
  deformable_ccd::SetHold open;
  const auto said = called("/changing/set_hold", open);
  EXPECT_TRUE(said.success) << said.message;
  expectRevoked("other contacts are expected now");
  const State opened = moveTo(0.06, begin_s + 0.2);
  EXPECT_EQ(opened.touching, State::NEW) << "what touches since before";
  EXPECT_NE(opened.reason.find("the promise of ~safe_until was void: other contacts are expected now"),
            std::string::npos)
      << opened.reason;
  EXPECT_EQ(promisedAt(begin_s + 0.2).broken, "other contacts are expected now");
  open.request.body = "cloth";
  EXPECT_FALSE(called("/changing/set_hold", open).success);
  open.request.body = "mesh";
  open.request.holds = true;
  EXPECT_NE(called("/changing/set_hold", open).message.find("mesh with plate"), std::string::npos);
  EXPECT_EQ(moveTo(0.05, begin_s + 0.3).touching, State::EXPECTED);
}

TEST_F(Changing, ADescriptionThatChangesIsNotVouchedForUntilItIsBack) {
  EXPECT_TRUE(moveTo(0.3, begin_s + 0.1).clear);
  std::string urdf;
  ASSERT_TRUE(node.getParam("changing_description", urdf));
  node.setParam("changing_description", urdf + " ");
  expectRevoked(
      "parameter /changing_description is another one than at the start; restart the monitor, which watches the robot "
      "of then");
  const State changed = moveTo(0.3, begin_s + 0.2);
  EXPECT_FALSE(changed.proved);
  EXPECT_NE(
      changed.reason.find("parameter /changing_description is another one than at the start; restart the monitor"),
      std::string::npos)
      << changed.reason;
  node.setParam("changing_description", urdf);
  ros::Duration(2.5).sleep();
  EXPECT_TRUE(moveTo(0.3, begin_s + 0.3).clear);
}

struct Alone : WithRobot {
  Alone() : WithRobot("/alone") {}
  static void SetUpTestSuite() {
    EXPECT_TRUE(waitUntil([] { return ros::service::exists("/alone/reset", false); }, 15));
  }
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

struct Orphan : WithRobot {
  Orphan() : WithRobot("/held") {}
};

// The last case: without robot_state_publisher there is no tf any more.
TEST_F(Orphan, WhenTheStatePublisherIsKilledTheLinkIsNamed) {
  lift(500, 0.1);
  lift(500.1, 0.1);
  send(mesh, meshStamped(tipAbove(0.3), 500));
  EXPECT_TRUE(moveTo(0.3, 500.1).clear);
  ASSERT_EQ(std::system("rosnode kill /robot_state_publisher"), 0);
  for (const double stamp_s : {500.2, 500.3}) {
    const State said = moveTo(0.3, stamp_s);
    EXPECT_FALSE(said.proved);
    EXPECT_NE(said.reason.find("'plate'"), std::string::npos) << said.reason;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "robot_test"); }
