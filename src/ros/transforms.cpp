#include "ros/transforms.h"

#include <algorithm>

#include <geometry_msgs/TransformStamped.h>
#include <tf2/exceptions.h>

namespace dccd {

bool TransformFeed::goesBack(const geometry_msgs::TransformStamped& transform) const {
  const auto known = newest_.find(transform.child_frame_id);
  return known != newest_.end() && static_cast<StampNs>(transform.header.stamp.toNSec()) < known->second - JUMP_BACK_NS;
}

bool TransformFeed::clears(const tf2_msgs::TFMessage& message, bool is_static) const {
  return !is_static && std::any_of(message.transforms.begin(), message.transforms.end(),
                                   [&](const auto& transform) { return goesBack(transform); });
}

bool TransformFeed::add(const tf2_msgs::TFMessage& message, bool is_static) {
  bool cleared = false;
  for (const auto& transform : message.transforms) {
    if (!is_static) {
      if (goesBack(transform)) {
        buffer_.clear();  // keeps static transforms
        newest_.clear();
        cleared = true;
      }
      StampNs& newest = newest_[transform.child_frame_id];
      newest = std::max(newest, static_cast<StampNs>(transform.header.stamp.toNSec()));
    }
    buffer_.setTransform(transform, "tf", is_static);
  }
  return cleared;
}

bool lookupTransform(const tf2::BufferCore& buffer, const std::string& target, const std::string& source,
                     StampNs stamp_ns, Eigen::Isometry3d& transform, std::string& reason) {
  transform = Eigen::Isometry3d::Identity();
  if (target == source) return true;
  ros::Time stamp;
  stamp.fromNSec(static_cast<std::uint64_t>(std::max<StampNs>(stamp_ns, 0)));
  try {
    if (!buffer.canTransform(target, source, stamp, &reason)) return false;
    const auto found = buffer.lookupTransform(target, source, stamp).transform;
    transform.linear() = Eigen::Quaterniond(found.rotation.w, found.rotation.x, found.rotation.y, found.rotation.z)
                             .normalized()
                             .toRotationMatrix();
    transform.translation() = Vec3(found.translation.x, found.translation.y, found.translation.z);
    return transform.matrix().allFinite();
  } catch (const tf2::TransformException& error) {
    reason = error.what();
    return false;
  }
}

void transform(const Eigen::Isometry3d& target_from_source, Positions& positions) {
  if (target_from_source.matrix() == Eigen::Matrix4d::Identity()) return;  // keeps the bits
  for (Vec3& p : positions) p = target_from_source * p;
}

}  // namespace dccd
