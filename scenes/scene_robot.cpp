#include "scenes/scene_robot.h"

#include <algorithm>
#include <set>
#include <stdexcept>

#include <urdf_parser/urdf_parser.h>

#include "robot/robot_model.h"

namespace dccd {
namespace {

using scene::Link;

constexpr double TOLERANCE_M = 1e-3;  // of round links, as the camera sees them

Eigen::Isometry3d poseOf(const urdf::Pose& pose) {
  Eigen::Isometry3d result(Eigen::Translation3d(pose.position.x, pose.position.y, pose.position.z));
  const urdf::Rotation& q = pose.rotation;
  result.rotate(Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized());
  return result;
}

class RobotReader {
 public:
  RobotReader(scene::Robot& robot, const std::string& scene_path) : robot_(robot), scene_path_(scene_path) {}

  void read() {
    const std::string text = yamlText(pathOf(robot_.description), "a URDF");
    const urdf::ModelInterfaceSharedPtr model = urdf::parseURDF(text);
    if (!model) throw std::runtime_error(robot_.description + " is no URDF");
    made_ = makeRobot({robot_.description, text, ""}, {"", "", ""}, RobotConfig(), TOLERANCE_M);
    if (!made_.missing.empty()) throw std::runtime_error(robot_.description + ": " + made_.missing.front());
    add(*model->getRoot(), -1);
    requireNames();
  }

 private:
  scene::Robot& robot_;
  const std::string& scene_path_;
  Robot made_;
  std::set<std::string> moved_;

  void add(const urdf::Link& from, int parent) {
    Link link;
    link.name = from.name;
    link.parent = parent;
    if (from.parent_joint) addJoint(*from.parent_joint, link);
    for (const RobotPart& part : made_.parts) {
      if (part.link == link.name) link.surfaces.push_back({part.mesh->positions, part.mesh->topology->faces()});
    }
    const int number = static_cast<int>(robot_.links.size());
    robot_.links.push_back(std::move(link));
    for (const urdf::LinkSharedPtr& child : from.child_links) add(*child, number);
  }

  void addJoint(const urdf::Joint& joint, Link& link) {
    link.joint_name = joint.name;
    link.origin = poseOf(joint.parent_to_joint_origin_transform);
    link.axis = Vec3(joint.axis.x, joint.axis.y, joint.axis.z).normalized();
    if (joint.type == urdf::Joint::FIXED) return;
    if (joint.type == urdf::Joint::FLOATING || joint.type == urdf::Joint::PLANAR)
      throw std::runtime_error(robot_.description + ": joint '" + joint.name + "' neither turns nor slides");
    link.joint = joint.type == urdf::Joint::PRISMATIC ? Link::Joint::SLIDES : Link::Joint::TURNS;
    moved_.insert(joint.name);
    const auto keys = robot_.joints.find(joint.mimic ? joint.mimic->joint_name : joint.name);
    if (keys != robot_.joints.end()) link.keys = keys->second;
    if (!joint.mimic) return;
    for (scene::JointKey& key : link.keys) key.position = joint.mimic->multiplier * key.position + joint.mimic->offset;
  }

  void requireNames() const {
    for (const auto& joint : robot_.joints) {
      if (moved_.count(joint.first) == 0)
        throw std::runtime_error(scene_path_ + ": robot/joints names '" + joint.first + "', and " + robot_.description +
                                 " has no joint of that name that moves");
    }
    for (const std::string& name : robot_.named_links) {
      const auto same = [&name](const Link& link) { return link.name == name; };
      if (std::none_of(robot_.links.begin(), robot_.links.end(), same))
        throw std::runtime_error(scene_path_ + ": a gripper names '" + name + "', and " + robot_.description +
                                 " has no link of that name");
    }
  }
};

}  // namespace

void addRobot(scene::SceneSpec& spec, const std::string& scene_path) {
  if (spec.robot) RobotReader(*spec.robot, scene_path).read();
}

}  // namespace dccd
