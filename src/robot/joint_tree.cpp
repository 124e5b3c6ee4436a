#include "robot/joint_tree.h"

#include <algorithm>
#include <cmath>

#include <urdf_model/model.h>

#include "robot/urdf_text.h"

namespace dccd {
namespace {

bool isMoving(const urdf::Joint& joint) { return joint.type != urdf::Joint::FIXED; }
bool slides(const urdf::Joint& joint) { return joint.type == urdf::Joint::PRISMATIC; }
bool turnsOrSlides(const urdf::Joint& joint) {
  return slides(joint) || joint.type == urdf::Joint::REVOLUTE || joint.type == urdf::Joint::CONTINUOUS;
}

/// The one that sets its position.
std::string leaderOf(const urdf::Joint& joint) { return joint.mimic ? joint.mimic->joint_name : joint.name; }

Eigen::Isometry3d originOf(const urdf::Pose& pose) {
  Eigen::Isometry3d result(Eigen::Translation3d(pose.position.x, pose.position.y, pose.position.z));
  const urdf::Rotation& q = pose.rotation;
  result.rotate(Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized());
  return result;
}

}  // namespace

JointTree::JointTree(const std::string& urdf) : model_(parseJoints(urdf)) {
  for (const auto& [name, joint] : model_->joints_) {
    if (!joint->mimic) continue;
    const auto leader = model_->joints_.find(joint->mimic->joint_name);
    if (leader != model_->joints_.end() && !leader->second->mimic) continue;
    const std::string what = leader == model_->joints_.end() ? "is not there" : "follows another one itself";
    throw RobotTextError("joint '" + name + "' follows '" + joint->mimic->joint_name + "', which " + what);
  }
}

const std::string& JointTree::root() const { return model_->getRoot()->name; }

bool JointTree::hasLink(const std::string& name) const { return model_->links_.count(name) > 0; }

bool JointTree::moves(const std::string& joint) const {
  const auto found = model_->joints_.find(joint);
  return found != model_->joints_.end() && turnsOrSlides(*found->second) && !found->second->mimic;
}

std::vector<urdf::JointSharedPtr> JointTree::chainTo(const std::string& link) const {
  std::vector<urdf::JointSharedPtr> chain;
  for (urdf::LinkConstSharedPtr at = model_->getLink(link); at && at->parent_joint; at = at->getParent())
    chain.insert(chain.begin(), at->parent_joint);
  return chain;
}

std::set<std::string> JointTree::jointsTo(const std::string& link) const {
  std::set<std::string> joints;
  for (const urdf::JointSharedPtr& joint : chainTo(link))
    if (isMoving(*joint)) joints.insert(leaderOf(*joint));
  return joints;
}

std::string JointTree::lastJointTo(const std::string& link) const {
  std::string last;
  for (const urdf::JointSharedPtr& joint : chainTo(link))
    if (isMoving(*joint)) last = joint->name;
  return last;
}

Eigen::Isometry3d JointTree::pose(const std::string& link, const std::map<std::string, double>& positions) const {
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (const urdf::JointSharedPtr& joint : chainTo(link)) {
    pose = pose * originOf(joint->parent_to_joint_origin_transform);
    if (!isMoving(*joint)) continue;
    double position = positions.at(leaderOf(*joint));
    if (joint->mimic) position = joint->mimic->multiplier * position + joint->mimic->offset;
    const Eigen::Vector3d axis = Eigen::Vector3d(joint->axis.x, joint->axis.y, joint->axis.z).normalized();
    if (slides(*joint)) {
      pose.translate(position * axis);
    } else {
      pose.rotate(Eigen::AngleAxisd(position, axis));
    }
  }
  return pose;
}

/// With p the vertex, w and v the axes of joints i <= j on its way, turning or sliding: the second derivative of p by
/// the two is w_i x (w_j x (p - o_j)), w_i x v_j or 0, the first by one of them w x (p - o) or v. So with the sums S of
/// speeds and A of accelerations and the reach R from any joint's origin: |p''| <= S_turn^2 R + 2 S_turn S_slide +
/// A_turn R + A_slide.
double JointTree::accelerationBound(const std::string& link, double reach_m,
                                    const std::map<std::string, JointPace>& paces, double most_m) const {
  double speed_turns = 0, speed_slides = 0, faster_turns = 0, faster_slides = 0;
  for (const urdf::JointSharedPtr& joint : chainTo(link)) {
    const urdf::Vector3& origin = joint->parent_to_joint_origin_transform.position;
    reach_m += Eigen::Vector3d(origin.x, origin.y, origin.z).norm();
    if (!isMoving(*joint)) continue;
    JointPace pace = paces.at(leaderOf(*joint));
    double out_m = most_m;
    if (joint->mimic) {
      const double times = std::abs(joint->mimic->multiplier);
      pace = {times * pace.speed, times * pace.acceleration};
      out_m = times * out_m + std::abs(joint->mimic->offset);
    }
    if (slides(*joint)) reach_m += out_m;
    (slides(*joint) ? speed_slides : speed_turns) += pace.speed;
    (slides(*joint) ? faster_slides : faster_turns) += pace.acceleration;
  }
  return speed_turns * speed_turns * reach_m + 2 * speed_turns * speed_slides + faster_turns * reach_m + faster_slides;
}

}  // namespace dccd
