// ~intended of a live node: a motion of the robot's joints, one that is wrong, and an arm that leaves it.
#include <deformable_ccd/AlongPath.h>
#include <deformable_ccd/Limits.h>
#include <deformable_ccd/SafeUntil.h>
#include <deformable_ccd/SpeedScale.h>
#include <deformable_ccd/WouldTouch.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <rosgraph_msgs/Log.h>
#include <tf2_msgs/TFMessage.h>
#include <trajectory_msgs/JointTrajectory.h>
#include <visualization_msgs/MarkerArray.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <thread>

#include "ros/support/live_tests.h"
#include "ros/support/meshes.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {
namespace {

using trajectory_msgs::JointTrajectory;

/// A plate on a lift, 0.1 m above the nearest point of a tip, less half of its thickness, in frames at 20 Hz.
struct Intended : ::testing::Test {
  const std::string name = "/collision_monitor";
  ros::NodeHandle node;
  Probe<deformable_ccd::SafeUntil> promises{node, name + "/safe_until"};
  Probe<deformable_ccd::AlongPath> paths{node, name + "/along_path"};
  Probe<deformable_ccd::SpeedScale> scales{node, name + "/speed_scale"};
  Probe<visualization_msgs::MarkerArray> markers{node, name + "/markers"};
  Probe<rosgraph_msgs::Log> lines{node, "/rosout"};
  ros::Publisher intended = advertiseAndWait<JointTrajectory>(node, name + "/intended");
  ros::Publisher tf = advertiseAndWait<tf2_msgs::TFMessage>(node, "/tf");
  ros::Publisher tip = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/tip");
  std::atomic<double> plate_m{0.1};
  std::atomic<bool> ends{false}, pauses{false};
  std::thread frames{[this] {
    for (; !ends; ros::WallDuration(0.05).sleep()) {
      if (pauses) continue;
      const deformable_ccd::MeshStamped mesh = meshStamped(tipAbove(0.3), ros::Time::now().toSec());
      tf2_msgs::TFMessage message;
      auto& one = message.transforms.emplace_back();
      one.header.stamp = mesh.header.stamp;
      one.header.frame_id = "world";
      one.child_frame_id = "plate";
      one.transform.translation.z = plate_m;
      one.transform.rotation.w = 1;
      tf.publish(message);
      tip.publish(mesh);
    }
  }};
  ~Intended() override {
    ends = true;
    frames.join();
  }

  static JointTrajectory holds() {
    JointTrajectory message;
    message.header.stamp = ros::Time::now();
    message.joint_names = {"lift"};
    message.points.resize(2);
    for (auto& point : message.points) point.positions = {0.1};
    message.points[1].time_from_start = ros::Duration(30);
    return message;
  }
  /// By bounds alone, 0.1 and 0.5 m/s.
  void expectBoundsAlone(const std::string& when) {
    EXPECT_TRUE(waitUntil([&] { return paths.count() > 0 && !paths.last().used; })) << when;
    EXPECT_TRUE(waitUntil([&] { return std::abs(promises.last().seconds - 0.099 / 0.6) < 1e-3; }))
        << when << ": " << promises.last().seconds << " s " << promises.last().reason;
    EXPECT_TRUE(waitUntil([&] { return scales.last().scale < 1; })) << when;
  }
  /// Until the tip, at 0.1 m/s, and the tube, of 0.01 m and 0.01 m/s, may meet.
  void expectThePath(const std::string& when) {
    EXPECT_TRUE(waitUntil([&] { return paths.last().used; })) << when << ": " << paths.last().reason;
    EXPECT_TRUE(waitUntil([&] { return std::abs(promises.last().seconds - (0.099 - 0.01) / 0.11) < 1e-3; }))
        << when << ": " << promises.last().seconds << " s " << promises.last().reason;
    EXPECT_TRUE(waitUntil([&] { return scales.last().scale == 1; })) << when << ": " << scales.last().reason;
  }
  bool isSaid(const std::string& text) {
    return waitUntil([&] {
      const auto all = lines.all();
      return std::any_of(all.begin(), all.end(), [&](const rosgraph_msgs::Log& line) {
        return line.msg.find(name + "/intended: " + text) != std::string::npos;
      });
    });
  }
};

TEST_F(Intended, AMotionIsLookedAheadUntilOneIsWrongOrTheArmIsElsewhere) {
  expectBoundsAlone("at first");
  intended.publish(holds());
  expectThePath("with a motion");
  EXPECT_EQ(paths.last().bodies, std::vector<std::string>{"plate"});
  EXPECT_NEAR(paths.last().ahead, 1, 0.1);
  EXPECT_TRUE(waitUntil([&] {
    const auto shown = markers.last().markers;
    return std::any_of(shown.begin(), shown.end(), [](const visualization_msgs::Marker& one) {
      return one.ns == "intended" && std::abs(one.scale.x - 2 * 0.02) < 0.002 && one.points.size() > 1;
    });
  })) << "RViz shows the tube";
  const auto assumed = promises.last().assumed;
  EXPECT_TRUE(std::any_of(assumed.begin(), assumed.end(), [](const std::string& sentence) {
    return sentence.find("'plate' go along the intended path") != std::string::npos;
  }));

  JointTrajectory wrong = holds();
  wrong.joint_names = {"elbow"};
  intended.publish(wrong);
  EXPECT_TRUE(isSaid("joint_names[0] 'elbow' is no joint"));
  expectBoundsAlone("after a joint that does not exist");
  for (const auto& change : std::vector<std::function<void(JointTrajectory&)>>{
           [](JointTrajectory& t) { t.points[1].positions = {std::nan("")}; },
           [](JointTrajectory& t) { t.points[1].time_from_start = ros::Duration(0); },
           [](JointTrajectory& t) { t.header.stamp -= ros::Duration(60); },
           [](JointTrajectory& t) { t.header.stamp -= ros::Duration(2); }}) {
    intended.publish(holds());
    expectThePath("once more");
    wrong = holds();
    change(wrong);
    intended.publish(wrong);
    expectBoundsAlone("after a mistake");
  }

  // Two mistakes of one kind make one line, another kind has its own; and no frame is waited for.
  const auto count = [&](const std::string& text) {
    const auto all = lines.all();
    return std::count_if(all.begin(), all.end(), [&](const rosgraph_msgs::Log& line) {
      return line.msg.find(name + "/intended: " + text) != std::string::npos;
    });
  };
  EXPECT_EQ(count("joint_names[0] 'elbow'"), 1);
  EXPECT_EQ(count("points[1]/positions[0] is nan"), 1) << "within five seconds of the first one";
  EXPECT_EQ(count("header/stamp is late"), 1);
  EXPECT_EQ(count("header/stamp goes back by"), 1);
  for (const double lasts_s : {30.0, 0.5}) {
    JointTrajectory another = holds();
    another.points[1].time_from_start = ros::Duration(lasts_s);
    intended.publish(another);
    expectThePath("replaced in mid-motion");
  }
  EXPECT_TRUE(isSaid("has ended"));
  expectBoundsAlone("after its end");
  intended.publish(holds());
  expectThePath("before frames stay away");
  pauses = true;
  ros::WallDuration(0.2).sleep();
  const ros::Time stamp = promises.last().header.stamp;
  wrong = holds();
  wrong.joint_names = {"elbow"};
  intended.publish(wrong);
  expectBoundsAlone("without a frame");
  EXPECT_EQ(promises.last().header.stamp, stamp);
  EXPECT_EQ(promises.last().broken, "something else is intended now");
  pauses = false;

  intended.publish(holds());
  expectThePath("before the plate is elsewhere");
  plate_m = 0.15;
  EXPECT_TRUE(waitUntil([&] { return !paths.last().used; }));
  EXPECT_TRUE(waitUntil([&] {
    const auto all = promises.all();
    return std::any_of(all.begin(), all.end(), [](const deformable_ccd::SafeUntil& said) {
      return said.broken.find("m off the intended path") != std::string::npos;
    });
  }));
  EXPECT_TRUE(waitUntil([&] { return std::abs(promises.last().seconds - 0.149 / 0.6) < 1e-3; }));
}

TEST_F(Intended, LimitsTellAControllerHowFastThePlateMayComeUp) {
  Probe<deformable_ccd::Limits> limits(node, name + "/limits");
  EXPECT_TRUE(waitUntil([&] { return limits.count() > 0 && !limits.last().speeds.empty(); }));
  const deformable_ccd::Limits said = limits.last();
  EXPECT_TRUE(said.unknown.empty());
  EXPECT_EQ(said.links, std::vector<std::string>{"plate"});
  EXPECT_EQ(said.partners, std::vector<std::string>(said.speeds.size(), "mesh"));
  EXPECT_NEAR(said.origins.at(0).z, 0.1, 1e-9);
  EXPECT_NEAR(std::abs(said.normals.at(0).z), 1, 1e-6);
  EXPECT_NEAR(*std::min_element(said.speeds.begin(), said.speeds.end()), 0.099 / 0.2 - 0.1, 0.02);
  EXPECT_NEAR(said.most_speed, 0.4 / 0.2 - 0.1, 1e-6);
  EXPECT_EQ(said.corners.size(), 8 * said.speeds.size());
  EXPECT_FALSE(said.assumed.empty());
}

TEST_F(Intended, APlannerAsksBeforeItSends) {
  using deformable_ccd::WouldTouch;
  expectBoundsAlone("at first");
  const auto ask = [&](double height_m) {
    WouldTouch call;
    call.request.trajectory = holds();
    call.request.trajectory.points[1].positions = {height_m};
    call.request.trajectory.points[1].time_from_start = ros::Duration(2);
    EXPECT_TRUE(ros::service::call(name + "/would_touch", call));
    return call.response;
  };
  // The mesh below, at 0.1 m/s, and the tube, which grows by 0.01 m/s, come towards what comes down at 0.1 m/s, or
  // rests.
  const WouldTouch::Response down = ask(-0.1), rests = ask(0.1);
  EXPECT_EQ(down.verdict, WouldTouch::Response::TOUCHES) << down.reason;
  EXPECT_NEAR(down.first, (0.099 - 0.01) / 0.21, 0.03 * 0.42);
  EXPECT_NEAR(down.point.z, (0.099 - 0.042) / 2, 0.002);
  EXPECT_EQ(rests.verdict, WouldTouch::Response::TOUCHES) << rests.reason;
  EXPECT_NEAR(rests.first, (0.099 - 0.01) / 0.11, 0.03 * 0.81);
  EXPECT_FALSE(paths.last().used);
  pauses = true;
  EXPECT_TRUE(waitUntil([&] { return scales.last().reason.find("not proved") != std::string::npos; }));
  const WouldTouch::Response late = ask(0.05);
  EXPECT_EQ(late.verdict, WouldTouch::Response::NOT_PROVED);
  EXPECT_NE(late.reason, "");
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "intended_test"); }
