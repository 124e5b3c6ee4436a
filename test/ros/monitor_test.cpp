// The live node with one mesh: messages of any type in, contacts or the reason why there are none out. With a map, and
// with several bodies: in monitor/.
#include <deformable_ccd/ContactArray.h>
#include <deformable_ccd/FirstContact.h>
#include <deformable_ccd/State.h>
#include <deformable_ccd/StepStats.h>

#include <algorithm>
#include <cmath>

#include <dynamic_reconfigure/Reconfigure.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_msgs/Bool.h>
#include <std_srvs/SetBool.h>
#include <tf2_msgs/TFMessage.h>

#include "ros/support/live_tests.h"
#include "ros/support/monitor_fixture.h"

namespace dccd {
namespace test {
namespace {

constexpr std::size_t MONITORS = 4;  // in monitor.test; each listens to /tf

struct Plain : MonitorTest {
  Plain() : MonitorTest("/plain") {}

  /// From z = 1 to z = -3 in 0.1 s: the tip meets the triangle at a quarter of the step.
  void expectQuarter(const deformable_ccd::ContactArray& outcome) {
    ASSERT_EQ(outcome.status, deformable_ccd::ContactArray::OK) << outcome.reason;
    ASSERT_TRUE(outcome.answered);
    ASSERT_FALSE(outcome.contacts.empty());
    double earliest = 1;
    for (const auto& contact : outcome.contacts) earliest = std::min(earliest, contact.toc_lower);
    EXPECT_LE(earliest, 0.25);
    EXPECT_GE(earliest, 0.25 - std::ldexp(1.0, -30));
    EXPECT_FALSE(clear.last().data);
  }
};

TEST_F(Plain, MeshStampedKnownTime) {
  Probe<deformable_ccd::FirstContact> first(node, "/plain/first_contact");
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  const deformable_ccd::ContactArray alone = send(publisher, meshStamped(tipAbove(1), 10));
  EXPECT_EQ(alone.status, deformable_ccd::ContactArray::FIRST_FRAME);
  EXPECT_FALSE(alone.answered);
  EXPECT_EQ(alone.header.frame_id, "world");
  const deformable_ccd::ContactArray outcome = send(publisher, meshStamped(tipAbove(-3), 10.1));
  expectQuarter(outcome);
  EXPECT_EQ(outcome.start, ros::Time(10));
  EXPECT_EQ(outcome.header.stamp, ros::Time(10.1));
  ASSERT_EQ(outcome.bodies.size(), 1u);
  const auto& contact = outcome.contacts.front();
  EXPECT_NEAR((contact.time_of_contact - ros::Time(10)).toSec(), 0.025, 1e-6);
  EXPECT_NEAR(contact.point.z, 0, 1e-6);
  EXPECT_NEAR(contact.approach_speed, 40, 1e-3) << "m/s, not m per step";
  ASSERT_TRUE(waitUntil([&] { return first.count() > 0 && first.last().contact; }));
  EXPECT_NEAR(first.last().seconds, 0.025, 1e-6);
  EXPECT_EQ(first.last().summary.rfind("contact 0.025000 s into the step: ", 0), 0u) << first.last().summary;
  expectAddsUp();
}

TEST_F(Plain, EveryMessageTypeSaysTheSame) {
  const auto expectSame = [&](const auto& above, const auto& below) {
    const auto publisher = advertiseAndWait<std::decay_t<decltype(above)>>(node, "/plain/mesh");
    send(publisher, above);
    expectQuarter(send(publisher, below));
  };
  const auto expectRefused = [&](const auto& message) {
    ros::Duration(0.2).sleep();
    const auto publisher = advertiseAndWait<std::decay_t<decltype(message)>>(node, "/plain/mesh");
    const deformable_ccd::ContactArray outcome = send(publisher, message);
    EXPECT_EQ(outcome.status, deformable_ccd::ContactArray::BAD_MESSAGE);
    return outcome.reason;
  };
  const Mesh high = tipAbove(1), low = tipAbove(-3);
  expectSame(polygonMesh(high, 10), polygonMesh(low, 10.1));
  ros::Duration(0.2).sleep();
  expectSame(soup(high, 20), soup(low, 20.1));
  ros::Duration(0.2).sleep();
  expectSame(soup(high, 30).markers[0], soup(low, 30.1).markers[0]);
  const std::string reason = expectRefused(shapeMesh(high));
  EXPECT_NE(reason.find("frame_id"), std::string::npos) << reason;
  expectRefused(std_msgs::Bool());
  expectAddsUp();
}

TEST_F(Plain, ClearIsTrueOnlyForACheckedStep) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  send(publisher, meshStamped(tipAbove(1), 10));
  EXPECT_FALSE(clear.last().data);
  const deformable_ccd::ContactArray outcome = send(publisher, meshStamped(tipAbove(0.9), 10.1));
  EXPECT_EQ(outcome.start_state, deformable_ccd::ContactArray::CLEAR);
  EXPECT_TRUE(waitUntil([&] { return clear.last().data; }));
  const ros::Time asked = ros::Time::now();
  const deformable_ccd::State state = Probe<deformable_ccd::State>(node, "/plain/state").after(0);
  EXPECT_EQ(state.holds_until, ros::Time(10.1));
  EXPECT_LT(state.header.stamp, asked) << "it was said when nobody listened";
  EXPECT_TRUE(trigger("reset").success);
  EXPECT_TRUE(waitUntil([&] { return !clear.last().data; })) << "a reset is not clear";
}

TEST_F(Plain, MarkersBeginAnewAndEndWithTheMonitor) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  send(publisher, meshStamped(tipAbove(1), 10));
  send(publisher, meshStamped(tipAbove(-3), 10.1));
  ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(10.1); }));
  Probe<visualization_msgs::MarkerArray> markers(node, "/plain/markers");
  send(publisher, meshStamped(tipAbove(1), 5));
  send(publisher, meshStamped(tipAbove(-3), 5.1));
  ASSERT_TRUE(waitUntil([&] { return markers.count() >= 2; }));
  const auto array = markers.last();
  ASSERT_GE(array.markers.size(), 2u);
  EXPECT_EQ(array.markers[0].action, visualization_msgs::Marker::DELETEALL);
  EXPECT_EQ(array.markers[0].header.frame_id, "world");
  EXPECT_TRUE(array.markers[0].ns.empty());
  ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(5.1); })) << "published after the markers";
  std_srvs::SetBool enable;
  enable.request.data = false;
  ASSERT_TRUE(ros::service::call("/plain/enable", enable));
  EXPECT_TRUE(waitUntil([&] { return markers.count() == 3; })) << "what is shown is out of date";
  EXPECT_EQ(markers.last().markers.size(), 1u);
  EXPECT_EQ(markers.last().markers.at(0).action, visualization_msgs::Marker::DELETEALL);
  EXPECT_EQ(markers.last().markers.at(0).header.frame_id, "world");
  enable.request.data = true;
  ASSERT_TRUE(ros::service::call("/plain/enable", enable));
}

TEST_F(Plain, FramesWaitForMovingTransforms) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  ros::Publisher tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf", false, MONITORS);
  Mesh mesh = tipAbove(1);
  // The camera goes up while the mesh goes down with it: in the world nothing moves, and nothing touches.
  tf.publish(transformAt(200, "camera", {0, 0, 0}));
  send(publisher, meshStamped(mesh, 200, "camera"));
  const std::size_t seen = contacts.count();
  for (Vec3& p : mesh.positions) p.z() -= 0.4;
  publisher.publish(meshStamped(mesh, 200.05, "camera"));
  ros::Duration(0.05).sleep();
  EXPECT_EQ(contacts.count(), seen) << "its transform is not there yet";
  tf.publish(transformAt(200.1, "camera", {0, 0, 0.8}));
  const deformable_ccd::ContactArray outcome = contacts.after(seen);
  EXPECT_EQ(outcome.status, deformable_ccd::ContactArray::OK) << outcome.reason;
  EXPECT_TRUE(outcome.contacts.empty());

  const deformable_ccd::ContactArray lost = send(publisher, meshStamped(mesh, 200.15, "nowhere"));
  EXPECT_EQ(lost.status, deformable_ccd::ContactArray::NO_TRANSFORM);
  EXPECT_NE(lost.reason.find("nowhere"), std::string::npos) << lost.reason;
  expectAddsUp();
}

TEST_F(Plain, LookAheadPredictsWhatComes) {
  Probe<deformable_ccd::FirstContact> ahead(node, "/plain/time_to_contact");
  Probe<deformable_ccd::ContactArray> predicted(node, "/plain/predicted_contacts");
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  send(publisher, meshStamped(tipAbove(2), 10));
  send(publisher, meshStamped(tipAbove(1.5), 10.1));
  const auto told = [&](double stamp_s, std::uint8_t status) {
    deformable_ccd::FirstContact found;
    EXPECT_TRUE(waitUntil([&] {
      for (const deformable_ccd::FirstContact& m : ahead.all()) {
        if (m.header.stamp == ros::Time(stamp_s) && m.status == status) found = m;
      }
      return found.header.stamp == ros::Time(stamp_s);
    })) << stamp_s;
    return found;
  };
  const deformable_ccd::FirstContact time = told(10.1, deformable_ccd::ContactArray::OK);
  ASSERT_TRUE(time.answered);
  EXPECT_TRUE(time.contact);
  EXPECT_NEAR(time.seconds, 0.3, 1e-6);
  EXPECT_TRUE(waitUntil([&] { return predicted.count() > 0 && !predicted.last().contacts.empty(); }));
  EXPECT_TRUE(contacts.last().contacts.empty()) << "predictions are never mixed with what was observed";
  // Whoever hears predictions alone hears of an outage, too.
  send(publisher, meshStamped(tipAbove(1.4), 10.2, "nowhere"));
  EXPECT_FALSE(told(10.2, deformable_ccd::ContactArray::NO_TRANSFORM).answered);
  EXPECT_TRUE(trigger("reset").success);
  EXPECT_FALSE(told(10.2, deformable_ccd::ContactArray::RESET).answered);
}

TEST_F(Plain, StampsAtTheEndOfTimeAreFramesLikeAnyOther) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  Probe<deformable_ccd::ContactArray> predictions(node, "/plain/predicted_contacts");
  const auto sendAt = [&](std::uint32_t nsec, double z) {
    deformable_ccd::MeshStamped message = meshStamped(tipAbove(z), 0);
    message.header.stamp = ros::Time(4294967295, nsec);
    return send(publisher, message);
  };
  sendAt(600000000, 2);
  EXPECT_EQ(sendAt(633000000, 1.9).status, deformable_ccd::ContactArray::OK);
  // The prediction ends half a second later, which no message can say.
  EXPECT_TRUE(waitUntil([&] { return predictions.count() > 0 && predictions.last().answered; }));
  EXPECT_TRUE(trigger("reset").success) << "and the node is there";
}

TEST_F(Plain, Services) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  EXPECT_FALSE(trigger("check_now").success) << "nothing to check yet";
  send(publisher, meshStamped(tipAbove(0), 10));
  const auto now = trigger("check_now");
  EXPECT_TRUE(now.success) << now.message;
  EXPECT_NE(now.message.find("contacts"), std::string::npos);
  std_srvs::SetBool enable;
  enable.request.data = false;
  ASSERT_TRUE(ros::service::call("/plain/enable", enable));
  const std::size_t seen = contacts.count();
  publisher.publish(meshStamped(tipAbove(1), 10.1));
  ros::Duration(0.2).sleep();
  EXPECT_EQ(contacts.count(), seen);
  enable.request.data = true;
  ASSERT_TRUE(ros::service::call("/plain/enable", enable));
  EXPECT_EQ(send(publisher, meshStamped(tipAbove(1), 10.2)).status, deformable_ccd::ContactArray::FIRST_FRAME);
  ASSERT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(10.2); }));
  EXPECT_GE(stats.last().skipped_disabled, 1u);
  expectAddsUp();
}

TEST_F(Plain, LiveChangesShowInTheParameterHashAndTouchNothingElse) {
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/plain/mesh");
  double stamp_s = 10;
  const auto hash = [&] {
    send(publisher, meshStamped(tipAbove(1), stamp_s += 0.1));
    EXPECT_TRUE(waitUntil([&] { return stats.last().header.stamp == ros::Time(stamp_s); }));
    return stats.last().parameter_hash;
  };
  const auto setMesh = [&](bool shown) {
    dynamic_reconfigure::Reconfigure call;
    dynamic_reconfigure::BoolParameter mesh;
    mesh.name = "marker_mesh";
    mesh.value = shown;
    call.request.config.bools.push_back(mesh);
    EXPECT_TRUE(ros::service::call("/plain/live/set_parameters", call));
    return call.response.config;
  };
  const std::uint64_t before = hash();
  const dynamic_reconfigure::Config in_force = setMesh(true);
  EXPECT_TRUE(waitUntil([&] { return hash() != before; }));
  for (const auto& value : in_force.doubles) {
    if (value.name == "marker_point_size_m") {
      EXPECT_EQ(value.value, 2) << "a size that the parameter may have";
    }
  }
  setMesh(false);
  EXPECT_TRUE(waitUntil([&] { return hash() == before; })) << "nothing else was changed on the way";
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "monitor_test"); }
