#include "ros/transforms.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include <geometry_msgs/TransformStamped.h>
#include <tf2/exceptions.h>

#include "ros/short_text.h"

namespace dccd {

namespace {

std::string unslashed(const std::string& name) { return !name.empty() && name[0] == '/' ? name.substr(1) : name; }

/// Of what tf2 would refuse with a line on the console, each time that it comes; empty: it can be used.
std::string problemOf(const geometry_msgs::TransformStamped& transform) {
  const auto& p = transform.transform.translation;
  const auto& q = transform.transform.rotation;
  const std::string child = unslashed(transform.child_frame_id), parent = unslashed(transform.header.frame_id);
  if (const std::string problem = frameNameProblem(child); !problem.empty()) return "child_frame_id: " + problem;
  if (const std::string problem = frameNameProblem(parent); !problem.empty()) return "frame_id: " + problem;
  if (child == parent) return "it is its own parent";
  std::ostringstream text;
  if (!std::isfinite(p.x) || !std::isfinite(p.y) || !std::isfinite(p.z)) {
    text << "its translation (" << p.x << ' ' << p.y << ' ' << p.z << ") is not finite";
    return text.str();
  }
  const double norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
  if (std::abs(norm2 - 1) < tolerance::TF_QUATERNION_NORM) return {};  // false with a NaN
  text << "its rotation x y z w (" << q.x << ' ' << q.y << ' ' << q.z << ' ' << q.w << ") has the length "
       << std::sqrt(norm2) << "; publish a quaternion of length 1";
  return text.str();
}

}  // namespace

bool TransformFeed::goesBack(const geometry_msgs::TransformStamped& transform) const {
  const auto known = kept_.find(transform.child_frame_id);
  return known != kept_.end() &&
         static_cast<StampNs>(transform.header.stamp.toNSec()) < *known->second.rbegin() - JUMP_BACK_NS;
}

bool TransformFeed::hasRoomFor(const geometry_msgs::TransformStamped& transform) {
  for (const std::string* name : {&transform.header.frame_id, &transform.child_frame_id}) {
    if (names_.count(*name) > 0) continue;
    if (names_.size() >= MAX_FRAMES) return false;
    names_.insert(*name);
  }
  return true;
}

/// Else its stamp is noted, and those are forgotten that the buffer forgets with it.
bool TransformFeed::isRepeated(const geometry_msgs::TransformStamped& transform) {
  const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
  std::set<StampNs>& kept = kept_[transform.child_frame_id];
  if (!kept.insert(stamp_ns).second) return true;
  const auto old = kept.lower_bound(*kept.rbegin() - static_cast<StampNs>(buffer_.getCacheLength().toNSec()));
  const std::size_t before = kept.size();
  kept.erase(kept.begin(), old);
  kept_count_ += 1 + kept.size() - before;
  return false;
}

/// Keeps static transforms.
void TransformFeed::clear() {
  buffer_.clear();
  kept_.clear();
  kept_count_ = 0;
}

bool TransformFeed::clears(const tf2_msgs::TFMessage& message, bool is_static) const {
  return !is_static && std::any_of(message.transforms.begin(), message.transforms.end(),
                                   [&](const auto& transform) { return goesBack(transform); });
}

void TransformFeed::leaveOut(const geometry_msgs::TransformStamped& transform, const std::string& problem) {
  ++unusable_;
  const std::string child = shortText(unslashed(transform.child_frame_id), MAX_NAME);
  const std::lock_guard<std::mutex> lock(told_mutex_);
  const bool known = told_.count(child) > 0;
  if (!known && told_.size() >= MAX_TOLD) return;
  const std::string text = "transforms of '" + child + "' are left out: " + problem;
  // A frame that has had usable ones is not in want of a place.
  if (!known && static_.count(transform.child_frame_id) == 0) only_unusable_[child] = text;
  if (told_.insert(child).second) complaints_.push_back(text);
}

/// A usable one came.
void TransformFeed::forgive(const std::string& child) {
  const std::lock_guard<std::mutex> lock(told_mutex_);
  if (!only_unusable_.empty()) only_unusable_.erase(unslashed(child));
}

std::string TransformFeed::onlyUnusable() const {
  const std::lock_guard<std::mutex> lock(told_mutex_);
  std::string text;
  for (const auto& [child, problem] : only_unusable_) text += (text.empty() ? "" : "; ") + problem;
  return text;
}

std::vector<std::string> TransformFeed::takeComplaints() {
  const std::lock_guard<std::mutex> lock(told_mutex_);
  return std::exchange(complaints_, {});
}

bool TransformFeed::add(const tf2_msgs::TFMessage& message, bool is_static) {
  bool cleared = false;
  for (const auto& transform : message.transforms) {
    if (const std::string problem = problemOf(transform); !problem.empty()) {
      leaveOut(transform, problem);
      continue;
    }
    forgive(transform.child_frame_id);
    if (!hasRoomFor(transform)) continue;
    if (!static_.emplace(transform.child_frame_id, is_static).first->second) {
      if (goesBack(transform) || kept_count_ >= MAX_KEPT) {
        clear();
        cleared = true;
      }
      if (isRepeated(transform)) continue;
    }
    buffer_.setTransform(transform, "tf", is_static);
  }
  return cleared;
}

bool lookupTransform(const tf2::BufferCore& buffer, const std::string& target, const std::string& source,
                     StampNs stamp_ns, Eigen::Isometry3d& transform, std::string& reason) {
  transform = Eigen::Isometry3d::Identity();
  if (target == source) return true;
  for (const std::string* name : {&target, &source}) {
    reason = frameNameProblem(*name);
    if (reason.empty()) continue;
    reason = "'" + shortText(*name, MAX_NAME) + "' is no frame's name: " + reason;
    return false;
  }
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
