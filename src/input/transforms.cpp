#include "input/transforms.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include <geometry_msgs/TransformStamped.h>
#include <tf2/exceptions.h>
#include <Eigen/Geometry>

#include "input/short_text.h"

namespace dccd {

namespace {

// tf2 follows no longer chain.
constexpr std::size_t MAX_CHAIN = 1000;

ros::Time toTime(StampNs stamp_ns) {
  ros::Time time;
  time.fromNSec(static_cast<std::uint64_t>(std::max<StampNs>(stamp_ns, 0)));
  return time;
}

/// As tf2 takes a name.
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
  const auto known = kept_.find(unslashed(transform.child_frame_id));
  return known != kept_.end() &&
         static_cast<StampNs>(transform.header.stamp.toNSec()) < known->second.rbegin()->first - JUMP_BACK_NS;
}

bool TransformFeed::hasRoomFor(const geometry_msgs::TransformStamped& transform) {
  for (const std::string* name : {&transform.header.frame_id, &transform.child_frame_id}) {
    if (names_.count(*name) > 0) continue;
    if (names_.size() >= MAX_FRAMES) return false;
    names_.insert(*name);
  }
  return true;
}

/// Else it is kept, and those are forgotten that the buffer forgets with it.
bool TransformFeed::isRepeated(const geometry_msgs::TransformStamped& transform) {
  const auto& p = transform.transform.translation;
  const auto& q = transform.transform.rotation;
  std::map<StampNs, Pose>& kept = kept_[unslashed(transform.child_frame_id)];
  const Pose pose{Eigen::Quaterniond(q.w, q.x, q.y, q.z), Vec3(p.x, p.y, p.z)};
  if (!kept.emplace(static_cast<StampNs>(transform.header.stamp.toNSec()), pose).second) return true;
  const auto old = kept.lower_bound(kept.rbegin()->first - static_cast<StampNs>(buffer_.getCacheLength().toNSec()));
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
  const std::lock_guard<std::mutex> lock(mutex_);
  return !is_static && std::any_of(message.transforms.begin(), message.transforms.end(),
                                   [&](const auto& transform) { return goesBack(transform); });
}

void TransformFeed::leaveOut(const geometry_msgs::TransformStamped& transform, const std::string& problem) {
  ++unusable_;
  const std::string child = shortText(unslashed(transform.child_frame_id), MAX_NAME);
  const bool known = told_.count(child) > 0;
  if (!known && told_.size() >= MAX_TOLD) return;
  const std::string text = "transforms of '" + child + "' are left out: " + problem;
  // A frame that has had usable ones is not in want of a place.
  if (!known && static_.count(transform.child_frame_id) == 0) only_unusable_[child] = text;
  if (told_.insert(child).second) complaints_.push_back(text);
}

std::string TransformFeed::onlyUnusable() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::string text;
  for (const auto& [child, problem] : only_unusable_) text += (text.empty() ? "" : "; ") + problem;
  return text;
}

std::vector<std::string> TransformFeed::takeComplaints() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(complaints_, {});
}

bool TransformFeed::add(const tf2_msgs::TFMessage& message, bool is_static) {
  const std::lock_guard<std::mutex> lock(mutex_);
  bool cleared = false;
  for (const auto& transform : message.transforms) {
    if (const std::string problem = problemOf(transform); !problem.empty()) {
      leaveOut(transform, problem);
      continue;
    }
    if (!only_unusable_.empty()) only_unusable_.erase(unslashed(transform.child_frame_id));
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

std::pair<TransformFeed::Chain, TransformFeed::Chain> TransformFeed::chains(const std::string& target,
                                                                            const std::string& source,
                                                                            StampNs stamp_ns) const {
  const ros::Time time = toTime(stamp_ns);
  const auto upFrom = [&](const std::string& frame) {
    Chain chain{frame};
    std::string parent;
    while (chain.size() <= MAX_CHAIN && buffer_._getParent(chain.back(), time, parent)) chain.push_back(parent);
    return chain;
  };
  Chain from_target = upFrom(target), from_source = upFrom(source);
  const auto meeting =
      std::find_first_of(from_source.begin(), from_source.end(), from_target.begin(), from_target.end());
  if (meeting == from_source.end()) return {};
  from_target.erase(std::find(from_target.begin(), from_target.end(), *meeting) + 1, from_target.end());
  from_source.erase(meeting + 1, from_source.end());
  return {std::move(from_target), std::move(from_source)};
}

TransformFeed::Pose TransformFeed::poseAlong(const Chain& chain, StampNs stamp_ns) const {
  Pose sum;
  for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
    const auto sent = kept_.find(chain[i]);
    const auto at = sent == kept_.end() ? std::map<StampNs, Pose>::const_iterator() : sent->second.find(stamp_ns);
    Pose one;
    if (sent != kept_.end() && at != sent->second.end()) {
      one = at->second;
    } else {
      const auto found = buffer_.lookupTransform(chain[i + 1], chain[i], toTime(stamp_ns)).transform;
      one.rotation = Eigen::Quaterniond(found.rotation.w, found.rotation.x, found.rotation.y, found.rotation.z);
      one.translation = Vec3(found.translation.x, found.translation.y, found.translation.z);
    }
    one.rotation.normalize();
    sum.translation = one.translation + one.rotation * sum.translation;
    sum.rotation = one.rotation * sum.rotation;
  }
  return sum;
}

bool TransformFeed::lookup(const std::string& target, const std::string& source, StampNs stamp_ns,
                           Eigen::Isometry3d& transform, std::string& reason) const {
  transform = Eigen::Isometry3d::Identity();
  if (target == source) return true;
  for (const std::string* name : {&target, &source}) {
    reason = frameNameProblem(*name);
    if (reason.empty()) continue;
    reason = "'" + shortText(*name, MAX_NAME) + "' is no frame's name: " + reason;
    return false;
  }
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    if (!buffer_.canTransform(target, source, toTime(stamp_ns), &reason)) return false;
    // The newest common transform is tf2's to find.
    const auto [from_target, from_source] =
        stamp_ns > 0 ? chains(target, source, stamp_ns) : std::pair<Chain, Chain>({target}, {source, target});
    const Pose of_target = poseAlong(from_target, stamp_ns), of_source = poseAlong(from_source, stamp_ns);
    const Eigen::Quaterniond back = of_target.rotation.conjugate();
    transform.linear() = (back * of_source.rotation).normalized().toRotationMatrix();
    transform.translation() = back * (of_source.translation - of_target.translation);
    return transform.matrix().allFinite();
  } catch (const tf2::TransformException& error) {
    reason = error.what();
    return false;
  }
}

/// With those that are kept of each frame on the way.
template <class Take>
void TransformFeed::forEachKept(const std::string& target, const std::string& source, Take take) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const auto [from_target, from_source] = chains(target, source, 0);
    for (const Chain* chain : {&from_target, &from_source}) {
      for (std::size_t i = 0; i + 1 < chain->size(); ++i) {
        const auto kept = kept_.find((*chain)[i]);
        if (kept != kept_.end() && !kept->second.empty()) take(kept->second);
      }
    }
  } catch (const tf2::TransformException&) {  // a frame that nobody has named yet
  }
}

std::vector<StampNs> TransformFeed::stampsBetween(const std::string& target, const std::string& source, StampNs from_ns,
                                                  StampNs to_ns) const {
  std::vector<StampNs> stamps;
  forEachKept(target, source, [&](const std::map<StampNs, Pose>& kept) {
    for (auto it = kept.upper_bound(from_ns); it != kept.end() && it->first < to_ns; ++it) stamps.push_back(it->first);
  });
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  return stamps;
}

std::optional<StampNs> TransformFeed::firstStamp(const std::string& target, const std::string& source) const {
  std::optional<StampNs> first;
  forEachKept(target, source, [&](const std::map<StampNs, Pose>& kept) {
    first = std::max(first.value_or(kept.begin()->first), kept.begin()->first);
  });
  return first;
}

void transform(const Eigen::Isometry3d& target_from_source, Positions& positions) {
  if (target_from_source.matrix() == Eigen::Matrix4d::Identity()) return;  // keeps the bits
  for (Vec3& p : positions) p = target_from_source * p;
}

}  // namespace dccd
