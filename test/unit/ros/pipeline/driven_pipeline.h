// The pipeline that the node and analyze_bag share, driven by messages as bytes: a cloth, a map, transforms.
#pragma once

#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>
#include <octomap/OcTree.h>
#include <octomap_msgs/Octomap.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <cstring>
#include <sstream>

#include "node/map_loader.h"
#include "node/monitor_pipeline.h"
#include "ros/support/bytes_of.h"
#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {

/// Numbers of 4 bytes each, one behind the other.
inline void addFields(const std::vector<std::string>& names, sensor_msgs::PointCloud2& cloud) {
  for (const std::string& name : names) {
    sensor_msgs::PointField field;
    field.name = name;
    field.offset = static_cast<std::uint32_t>(4 * cloud.fields.size());
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    cloud.fields.push_back(field);
  }
}

/// 2 x 2 points, 0.1 m apart, first corner at (0.15, 0.15, z), each point `tilt` above the one before; the field sigma
/// where wanted.
inline std::vector<std::uint8_t> cloud(double stamp_s, float z, const std::vector<float>& sigma = {},
                                       const std::string& frame = "world", float tilt = 0) {
  sensor_msgs::PointCloud2 out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = frame;
  out.height = out.width = 2;
  addFields({"x", "y", "z"}, out);
  if (!sigma.empty()) addFields({"sigma"}, out);
  out.point_step = 16;
  out.row_step = 32;
  out.data.resize(64);
  for (std::size_t i = 0; i < 4; ++i) {
    const float p[4] = {0.15f + 0.1f * static_cast<float>(i % 2), 0.15f + 0.1f * static_cast<float>(i / 2),
                        z + tilt * static_cast<float>(i), sigma.empty() ? 0 : sigma[i]};
    std::memcpy(out.data.data() + 16 * i, p, 16);
  }
  return bytesOf(out);
}

/// The same with a stamp of which no double has all nanoseconds.
inline std::vector<std::uint8_t> cloudAt(const ros::Time& stamp, float z, const std::string& frame = "world") {
  std::vector<std::uint8_t> bytes = cloud(0, z, {}, frame);
  const std::uint32_t parts[] = {stamp.sec, stamp.nsec};  // after the sequence number
  std::memcpy(bytes.data() + 4, parts, sizeof parts);
  return bytes;
}

inline std::vector<std::uint8_t> mapOf(octomap::OcTree tree, double stamp_s) {
  octomap_msgs::Octomap out;
  out.header.stamp = ros::Time(stamp_s);
  out.header.frame_id = "world";
  out.binary = true;
  out.id = "OcTree";
  out.resolution = tree.getResolution();
  std::ostringstream stream;
  tree.writeBinaryData(stream);
  const std::string bytes = stream.str();
  out.data.assign(bytes.begin(), bytes.end());
  return bytesOf(out);
}

/// Occupied below 0, free up to 0.2, unknown from there on; 0.1 m voxels over 0.5 m x 0.5 m.
inline octomap::OcTree table() {
  octomap::OcTree tree(0.1);
  for (int x = 0; x < 5; ++x) {
    for (int y = 0; y < 5; ++y) {
      for (int z = -2; z < 2; ++z) tree.updateNode(0.1 * x + 0.05, 0.1 * y + 0.05, 0.1 * z + 0.05, z < 0);
    }
  }
  return tree;
}
inline std::vector<std::uint8_t> map(double stamp_s) { return mapOf(table(), stamp_s); }

/// The frame `child`, `z` above the world at this stamp and turned about its z axis.
inline geometry_msgs::TransformStamped above(const std::string& child, double z, const ros::Time& stamp = {},
                                             double turn = 0) {
  geometry_msgs::TransformStamped transform;
  transform.header.stamp = stamp;
  transform.header.frame_id = "world";
  transform.child_frame_id = child;
  transform.transform.translation.z = z;
  transform.transform.rotation.w = std::cos(turn / 2);
  transform.transform.rotation.z = std::sin(turn / 2);
  return transform;
}

struct Driven {
  TransformFeed feed_tf;
  MonitorConfig config;
  MonitorPipeline pipeline;
  Outcome outcome;

  explicit Driven(const XmlRpcValue& tree, const RobotLoader& load = {})
      : config(readConfig(tree, "~", load)), pipeline(config, feed_tf) {}

  void giveMap(const octomap::OcTree& tree, double stamp_s) {
    LoadedMap loaded = decodeMapMessage(mapOf(tree, stamp_s), config);
    EXPECT_EQ(loaded.problem, "");
    pipeline.setMap(std::move(loaded), 0);
  }
  void giveMap(double stamp_s) { giveMap(table(), stamp_s); }
  /// The frame `child`, at all times `z` above the world.
  void raise(const std::string& child, double z) { tell({above(child, z)}, true); }
  void tell(const std::vector<geometry_msgs::TransformStamped>& moved, bool is_static = false) {
    tf2_msgs::TFMessage message;
    message.transforms = moved;
    feed_tf.add(message, is_static);
  }
  void take(std::size_t body, const std::vector<std::uint8_t>& cloud, std::int64_t now_ns = 0) {
    pipeline.take(body, {"sensor_msgs/PointCloud2", cloud, 0, now_ns});
  }
  const Outcome& feed(double stamp_s, float z, const std::vector<float>& sigma = {}, const std::string& frame = "world",
                      float tilt = 0) {
    take(0, cloud(stamp_s, z, sigma, frame, tilt));
    EXPECT_TRUE(pipeline.nextOutcome(0, outcome));
    return outcome;
  }
};

/// The parameters of YAML in a world that is named.
inline XmlRpcValue scene(const std::string& more = "") {
  return parameters("fixed_frame: world, max_vertex_step_m: 0.0" + (more.empty() ? "" : ", " + more));
}

/// A cloth over a table that is sent once.
constexpr const char* CLOTH_AND_TABLE = "bodies: {cloth: {topic: cloth}, table: {topic: table, motion: static}}";

}  // namespace test
}  // namespace dccd
