// The panda of the shared data: its texts, and where independent kinematics (KDL) has its links.
#pragma once

#include <tf2_msgs/TFMessage.h>

#include <fstream>
#include <functional>
#include <iterator>
#include <kdl/frames_io.hpp>
#include <kdl_parser/kdl_parser.hpp>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/data.h"

namespace dccd {
namespace test {

class Panda {
 public:
  /// Throws std::runtime_error where it is not there.
  Panda() {
    const std::string folder = dataDir() + "/robots/panda", package = "package://moveit_resources_panda_description";
    urdf_ = textOf(folder + "/panda.urdf");
    srdf_ = textOf(folder + "/panda.srdf");
    for (std::size_t at = 0; (at = urdf_.find(package, at)) != std::string::npos;) {
      urdf_.replace(at, package.size(), "file://" + folder);
    }
    if (!kdl_parser::treeFromString(urdf_, tree_)) throw std::runtime_error("KDL cannot read the panda");
  }
  static bool isThere() { return std::ifstream(dataDir() + "/robots/panda/panda.urdf").good(); }

  const std::string& urdf() const { return urdf_; }
  const std::string& srdf() const { return srdf_; }
  std::size_t joints() const { return tree_.getNrOfSegments(); }

  struct Placed {
    std::map<std::string, KDL::Frame> from_base;  ///< of each link
    tf2_msgs::TFMessage tf;                       ///< as robot_state_publisher would send it
  };
  /// `positions` [rad, m] of its segments in KDL's order, those that do not move included.
  Placed place(const std::vector<double>& positions, double stamp_s) const {
    Placed placed{{{"panda_link0", KDL::Frame::Identity()}}, {}};
    std::size_t joint = 0;
    const std::function<void(const KDL::TreeElement&)> go = [&](const KDL::TreeElement& parent) {
      for (const auto& child : parent.children) {
        const KDL::Segment& segment = child->second.segment;
        const KDL::Frame pose = segment.pose(positions.at(joint++));
        placed.from_base[segment.getName()] = placed.from_base[parent.segment.getName()] * pose;
        geometry_msgs::TransformStamped& one = placed.tf.transforms.emplace_back();
        one.header.frame_id = parent.segment.getName();
        one.header.stamp = ros::Time(stamp_s);
        one.child_frame_id = segment.getName();
        one.transform.translation.x = pose.p.x();
        one.transform.translation.y = pose.p.y();
        one.transform.translation.z = pose.p.z();
        auto& q = one.transform.rotation;
        pose.M.GetQuaternion(q.x, q.y, q.z, q.w);
        go(child->second);
      }
    };
    go(tree_.getRootSegment()->second);
    return placed;
  }

 private:
  std::string urdf_, srdf_;
  KDL::Tree tree_;

  static std::string textOf(const std::string& path) {
    std::ifstream file(path);
    if (!file) throw std::runtime_error(path + " is not there");
    return {std::istreambuf_iterator<char>(file), {}};
  }
};

}  // namespace test
}  // namespace dccd
