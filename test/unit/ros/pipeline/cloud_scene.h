// A camera above a table, whose clouds and pictures become the map of a driven pipeline.
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <array>
#include <limits>
#include <string>
#include <vector>

#include "dccd/assurance.h"
#include "input/steady_clock.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {

constexpr float LOST = std::numeric_limits<float>::quiet_NaN(), NO_RETURN = std::numeric_limits<float>::infinity();

/// A camera 1.05 m above the world's origin that looks straight down.
inline geometry_msgs::TransformStamped cameraPose(double stamp_s) {
  geometry_msgs::TransformStamped pose;
  pose.header.stamp = ros::Time(stamp_s);
  pose.header.frame_id = "world";
  pose.child_frame_id = "camera";
  pose.transform.translation.z = 1.05;
  pose.transform.rotation.x = 1;  // half a turn about x: it sees along the world's -z, its y is the world's -y
  return pose;
}

inline sensor_msgs::PointCloud2 cloudOf(double stamp_s, const std::vector<std::array<float, 3>>& points,
                                        const std::string& frame = "camera") {
  sensor_msgs::PointCloud2 out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = frame;
  out.height = 1;
  out.width = static_cast<std::uint32_t>(points.size());
  addFields({"x", "y", "z"}, out);
  out.point_step = 12;
  out.row_step = 12 * out.width;
  out.data.resize(out.row_step);
  if (!points.empty()) std::memcpy(out.data.data(), points.data(), out.data.size());
  return out;
}

/// The top of a table at the world's z = 0.05, within its uppermost layer of voxels, 0 to 0.1; with lost pixels.
inline sensor_msgs::PointCloud2 tableFrom(double stamp_s, const std::string& frame = "camera") {
  std::vector<std::array<float, 3>> points{{LOST, LOST, LOST}};
  for (int i = 0; i < 40; ++i) {
    for (int k = 0; k < 40; ++k) {
      points.push_back({0.0125f + 0.0125f * static_cast<float>(i), -0.0125f - 0.0125f * static_cast<float>(k), 1});
    }
  }
  return cloudOf(stamp_s, points, frame);
}

/// As the node hands it on.
template <class Message>
CloudMessage messageOf(const Message& message, std::size_t source = 0, StampNs receipt_ns = 0) {
  return {source, ros::message_traits::datatype<Message>(), bytesOf(message), receipt_ns};
}

inline XmlRpcValue cloudScene(const std::string& more = "") {
  XmlRpcValue tree = scene(more);
  if (!tree.hasMember("obstacle_cloud_topics")) tree["obstacle_cloud_topic"] = "/camera/points";
  tree["obstacle_resolution_m"] = 0.1;
  return tree;
}

/// A pipeline and what makes its map.
struct Seen : Driven {
  MapMemory memory{config};
  CloudMapping clouds{config, feed_tf, memory};
  StampNs receipt_ns = 1;

  explicit Seen(const XmlRpcValue& tree = cloudScene()) : Driven(tree) { clouds.setFrame("world"); }
  /// Where the camera is at all times, or another one.
  void showCamera(const std::string& frame = "camera") {
    geometry_msgs::TransformStamped pose = cameraPose(1);
    pose.child_frame_id = frame;
    tf2_msgs::TFMessage message;
    message.transforms.push_back(pose);
    feed_tf.add(message, true);
  }
  template <class Message>
  LoadedMap add(const Message& message, std::size_t source = 0, double seconds_later = 0) {
    receipt_ns += static_cast<StampNs>(seconds_later * 1e9);
    return clouds.add(messageOf(message, source, receipt_ns), [] { return false; });
  }
  /// As the worker gives it on.
  void give(LoadedMap map) {
    if (!map.surface) map.problem = whyRefused(map.problem, config);
    pipeline.setMap(std::move(map), 0);
  }
};

}  // namespace test
}  // namespace dccd
