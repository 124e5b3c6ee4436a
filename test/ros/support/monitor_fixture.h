// A monitor of a launch file, its topics and services; maps and transforms to give it.
#pragma once

#include <deformable_ccd/ContactArray.h>
#include <deformable_ccd/StepStats.h>

#include <string>

#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <octomap_msgs/Octomap.h>
#include <ros/ros.h>
#include <std_msgs/Bool.h>
#include <std_srvs/Trigger.h>
#include <tf2_msgs/TFMessage.h>

#include "octomap/map_builder.h"
#include "ros/support/meshes.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {

using Stats = deformable_ccd::StepStats;

inline octomap_msgs::Octomap blockBelowZero(bool binary, double stamp_s = 1) {
  octomap_msgs::Octomap map;
  map.header = header(stamp_s);
  map.binary = binary;
  map.id = "OcTree";
  map.resolution = 0.1;
  map.data = buildOctomap(
      0.1, Box{{0, 0, -0.2}, {0.5, 0.4, 0}},
      [](const Vec3& c) { return c.x() > 0 && c.x() < 0.5 && c.y() > 0 && c.y() < 0.4 && c.z() > -0.2 && c.z() < 0; },
      binary);
  return map;
}

inline tf2_msgs::TFMessage transformAt(double stamp_s, const std::string& child, const Vec3& at) {
  geometry_msgs::TransformStamped transform;
  transform.header = header(stamp_s);
  transform.child_frame_id = child;
  transform.transform.translation.x = at.x();
  transform.transform.translation.y = at.y();
  transform.transform.translation.z = at.z();
  transform.transform.rotation.w = 1;
  tf2_msgs::TFMessage message;
  message.transforms.push_back(transform);
  return message;
}

/// One of a launch file's monitors, reset before each case.
class MonitorTest : public ::testing::Test {
 protected:
  explicit MonitorTest(const std::string& name)
      : name_(name), contacts(node, name + "/contacts"), stats(node, name + "/stats"), clear(node, name + "/clear") {
    EXPECT_TRUE(ros::service::waitForService(name + "/reset", 10000));
    EXPECT_TRUE(trigger("reset").success);
    waitUntil([this] { return clear.count() > 0 && !clear.last().data; });
  }

  /// Whatever a test does, no frame is lost.
  void TearDown() override {
    if (stats.count() > 0) expectAddsUp();
  }

  std_srvs::Trigger::Response trigger(const std::string& service) {
    std_srvs::Trigger call;
    EXPECT_TRUE(ros::service::call(name_ + "/" + service, call));
    return call.response;
  }

  /// Publishes one message and returns the outcome that it leads to.
  template <typename Message>
  deformable_ccd::ContactArray send(const ros::Publisher& publisher, const Message& message) {
    const std::size_t seen = contacts.count();
    publisher.publish(message);
    return contacts.after(seen);
  }

  void expectAddsUp() {
    const Stats s = stats.last();
    EXPECT_EQ(s.frames_received, s.frames_processed + s.frames_started + s.frames_skipped + s.frames_waiting);
    // What waits is reckoned as what is left, so that the sum alone shows nothing: a frame that is counted twice makes
    // it huge, and those that are lost count up. No more can wait than 64 steps and a frame of each body.
    EXPECT_LE(s.frames_waiting, 80u);
    EXPECT_EQ(s.frames_skipped, s.skipped_duplicate + s.skipped_vertex_count + s.skipped_bad_message +
                                    s.skipped_no_transform + s.skipped_no_body + s.skipped_queue_full +
                                    s.skipped_disabled + s.skipped_reset + s.skipped_error);
  }

  std::string name_;
  ros::NodeHandle node;
  Probe<deformable_ccd::ContactArray> contacts;
  Probe<Stats> stats;
  Probe<std_msgs::Bool> clear;
};

}  // namespace test
}  // namespace dccd
