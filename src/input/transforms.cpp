#include "input/transforms.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <sstream>
#include <utility>

#include <geometry_msgs/TransformStamped.h>
#include <ros/serialization.h>
#include <tf2/exceptions.h>
#include <Eigen/Geometry>
#include <boost/make_shared.hpp>

#include "input/short_text.h"

namespace dccd {

namespace {

// tf2 follows no longer chain.
constexpr std::size_t MAX_CHAIN = 1000;
constexpr std::size_t LEAST_TRANSFORM = 76;  // bytes of one without names

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

TransformFeed::TransformFeed(tf2::BufferCore& buffer)
    : buffer_(buffer), max_kept_(static_cast<std::size_t>(MAX_KEPT * buffer.getCacheLength().toSec() / 10)) {}

const TransformFeed::Frame* TransformFeed::frameOf(const std::string& name) const {
  const auto found = frames_.find(name);
  return found == frames_.end() ? nullptr : &found->second;
}

/// Null: there are too many frames.
TransformFeed::Frame* TransformFeed::roomFor(const std::string& name) {
  const auto known = frames_.find(name);
  if (known != frames_.end()) return &known->second;
  if (frames_.size() >= MAX_FRAMES) return nullptr;
  Frame& frame = frames_[name];
  frame.name = name;
  return &frame;
}

const std::string* TransformFeed::senderOf(const std::string& name) {
  return &*senders_.insert(senders_.size() < MAX_SENDERS || senders_.count(name) > 0 ? name : std::string()).first;
}

TransformFeed::Jump TransformFeed::jumpOf(const geometry_msgs::TransformStamped& transform,
                                          const std::string& sender) const {
  const Frame* frame = frameOf(unslashed(transform.child_frame_id));
  if (!frame || frame->sent.empty()) return Jump::NONE;
  const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
  const auto newest = std::prev(frame->sent.end()), at_stamp = frame->sent.find(stamp_ns);
  const bool is_far = stamp_ns < newest->first - JUMP_BACK_NS;
  if (!is_far && (at_stamp == frame->sent.end() || at_stamp == newest)) return Jump::NONE;
  if (is_far) {
    const auto its_newest = frame->newest.find(sender);
    const bool went_back = its_newest != frame->newest.end() && stamp_ns < its_newest->second - JUMP_BACK_NS;
    return went_back ? Jump::LOOP : Jump::TWO_SENDERS;
  }
  const Pose &before = at_stamp->second.pose, now = poseOf(transform.transform);
  const bool is_there = at_stamp->second.parent == frameOf(unslashed(transform.header.frame_id)) &&
                        before.translation == now.translation && before.rotation.coeffs() == now.rotation.coeffs();
  if (is_there) return Jump::NONE;
  return *at_stamp->second.sender == sender ? Jump::LOOP : Jump::TWO_SENDERS;
}

/// What was sent of one that moves. tf2 forgets all frames or none.
void TransformFeed::forget(Frame& frame) {
  kept_count_ -= frame.sent.size();
  frame.sent.clear();
  frame.is_cut = frame.is_apart = has_apart_ = true;
}

void TransformFeed::forgetAllOf(const std::string& sender) {
  const auto isIts = [&](const auto& named) {
    return named.second.sent.empty() || named.second.newest.count(sender) > 0;
  };
  if (std::all_of(frames_.begin(), frames_.end(), isIts)) return clear();
  for (auto& named : frames_) {
    const auto its_newest = named.second.newest.find(sender);
    if (its_newest == named.second.newest.end()) continue;
    its_newest->second = 0;
    forget(named.second);
  }
}

/// Else it is kept, and those are forgotten that the buffer forgets with it.
bool TransformFeed::isRepeated(const geometry_msgs::TransformStamped& transform, const Sent& sent, Frame& frame) {
  const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
  const auto newest = frame.newest.try_emplace(*sent.sender, stamp_ns).first;
  newest->second = std::max(newest->second, stamp_ns);
  const auto [at, is_new] = frame.sent.emplace(stamp_ns, sent);
  if (!is_new) return true;
  const auto next = std::next(at);
  const bool passed_over = next == frame.sent.end() ? std::exchange(frame.passed_over, false) : next->second.gap;
  const bool lost = std::exchange(frame.lost, lost_) != lost_;
  at->second.gap = passed_over || lost;
  const auto old =
      frame.sent.lower_bound(frame.sent.rbegin()->first - static_cast<StampNs>(buffer_.getCacheLength().toNSec()));
  const std::size_t before = frame.sent.size();
  frame.is_cut = frame.is_cut || old != frame.sent.begin();
  frame.sent.erase(frame.sent.begin(), old);
  kept_count_ += 1 + frame.sent.size() - before;
  return false;
}

/// Keeps static transforms.
void TransformFeed::clear() {
  buffer_.clear();
  for (auto& named : frames_) {
    named.second.sent.clear();
    named.second.newest.clear();
    named.second.is_cut = named.second.is_apart = named.second.passed_over = false;
  }
  kept_count_ = 0;
  has_apart_ = false;
  ++times_forgotten_;
}

bool TransformFeed::clears(const tf2_msgs::TFMessage& message, bool is_static, const std::string& sender) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return !is_static && std::any_of(message.transforms.begin(), message.transforms.end(), [&](const auto& transform) {
    return problemOf(transform).empty() && jumpOf(transform, sender) == Jump::LOOP;
  });
}

void TransformFeed::leaveOut(const geometry_msgs::TransformStamped& transform, const std::string& problem) {
  ++unusable_;
  const std::string child = shortText(unslashed(transform.child_frame_id), MAX_NAME);
  const bool known = told_.count(child) > 0;
  if (!known && told_.size() >= MAX_TOLD) return;
  const std::string text = "transforms of '" + child + "' are left out: " + problem;
  // A frame that has had usable ones is not in want of a place.
  const Frame* frame = frameOf(unslashed(transform.child_frame_id));
  if (!known && !(frame && frame->is_static)) only_unusable_[child] = text;
  if (told_.insert(child).second) complaints_.push_back(text);
}

tf2_msgs::TFMessage::ConstPtr TransformFeed::read(const std::string& topic, std::vector<std::uint8_t> bytes) {
  using ros::serialization::IStream;
  const auto size = static_cast<std::uint32_t>(bytes.size());
  try {
    std::uint32_t count = 0;
    IStream(bytes.data(), size).next(count);
    // roscpp makes room for as many as there are said to be before it reads the first.
    if (count > size / LEAST_TRANSFORM) ros::serialization::throwStreamOverrun();
    const auto message = boost::make_shared<tf2_msgs::TFMessage>();
    IStream stream(bytes.data(), size);
    ros::serialization::deserialize(stream, *message);
    return message;
  } catch (const ros::serialization::StreamOverrunException&) {
    const std::lock_guard<std::mutex> lock(mutex_);
    ++unusable_;
    if (told_.insert(topic).second) complaints_.push_back("a message on " + topic + " is damaged and left out");
  }
  lose(topic == "/tf_static");
  return nullptr;
}

void TransformFeed::lose(bool is_static) {
  const std::lock_guard<std::mutex> lock(mutex_);
  is_static ? ++times_forgotten_ : ++lost_;
}

std::string TransformFeed::noTransform(const std::string& from, const std::string& to, const std::string& why) const {
  const std::string unusable = onlyUnusable();
  return "no transform from '" + from + "' to " + to + ": " + shortText(why) +
         (unusable.empty() ? "" : "; " + shortText(unusable));
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

bool TransformFeed::add(const tf2_msgs::TFMessage& message, bool is_static, const std::string& sender) {
  const std::lock_guard<std::mutex> lock(mutex_);
  bool cleared = false;
  for (const auto& transform : message.transforms) {
    if (const std::string problem = problemOf(transform); !problem.empty()) {
      leaveOut(transform, problem);
      passOver(transform);
      continue;
    }
    if (!only_unusable_.empty()) only_unusable_.erase(unslashed(transform.child_frame_id));
    const Frame* parent = roomFor(unslashed(transform.header.frame_id));
    Frame* frame = roomFor(unslashed(transform.child_frame_id));
    if (!parent || !frame) {
      passOver(transform);
      continue;
    }
    ++change_;
    const Sent sent{parent, poseOf(transform.transform), senderOf(sender)};
    if (!frame->is_static) frame->is_static = is_static;
    if (*frame->is_static != is_static) {
      if (!isThere(*frame, sent)) dispute(transform, *frame);
      continue;
    }
    if (is_static) {
      if (frame->fixed.parent && !isSame(frame->fixed, sent, tolerance::SAME_PLACE)) ++times_forgotten_;
      frame->fixed = sent;
    } else {
      const Jump jump = jumpOf(transform, *sent.sender);
      const bool is_full = kept_count_ >= max_kept_;
      cleared = cleared || is_full || jump != Jump::NONE;
      if (is_full) clear();
      if (jump == Jump::TWO_SENDERS) forget(*frame);
      if (jump == Jump::LOOP) forgetAllOf(*sent.sender);
      if (isRepeated(transform, sent, *frame)) {
        const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
        if (!isSame(frame->sent.at(stamp_ns), sent, tolerance::SAME_PLACE)) passOver(transform);
        continue;
      }
      if (frame->is_apart) continue;
    }
    buffer_.setTransform(transform, "tf", is_static);
  }
  return cleared;
}

/// Where the frame was last, as far as that is told from the path of a step.
bool TransformFeed::isThere(const Frame& frame, const Sent& sent) {
  if (!*frame.is_static && frame.sent.empty()) return false;
  return isSame(*frame.is_static ? frame.fixed : frame.sent.rbegin()->second, sent, tolerance::RIGID_PATH_M);
}

/// tolerance: of translation [m] and rotation [rad].
bool TransformFeed::isSame(const Sent& a, const Sent& b, double tolerance) {
  return a.parent == b.parent && (a.pose.translation - b.pose.translation).norm() <= tolerance &&
         a.pose.rotation.angularDistance(b.pose.rotation) <= tolerance;
}

/// It came and is not used: where the frame was around its stamp nobody knows.
void TransformFeed::passOver(const geometry_msgs::TransformStamped& transform) {
  const auto known = frames_.find(unslashed(transform.child_frame_id));
  if (known == frames_.end()) return;
  Frame& frame = known->second;
  if (frame.is_static.value_or(false)) ++times_forgotten_;
  ++change_;
  const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
  const auto at = frame.sent.find(stamp_ns), next = frame.sent.upper_bound(stamp_ns);
  if (at != frame.sent.end()) at->second.gap = true;
  (next == frame.sent.end() ? frame.passed_over : next->second.gap) = true;
}

/// On the way that was found last, or as far as it goes; null: none.
const TransformFeed::Frame* TransformFeed::firstApart() const {
  for (const Chain* chain : {&from_target_, &from_source_}) {
    const auto found = std::find_if(chain->begin(), chain->end(), [](const Frame* frame) { return frame->is_apart; });
    if (found != chain->end()) return *found;
  }
  return nullptr;
}

/// For good, as for tf2 a frame stays what it was first.
void TransformFeed::dispute(const geometry_msgs::TransformStamped& transform, Frame& frame) {
  frame.is_disputed = has_disputed_ = true;
  leaveOut(transform, "it is on /tf and, elsewhere, on /tf_static; stop one of the two and start the monitor anew");
}

/// On the way that was found last; null: none.
const TransformFeed::Frame* TransformFeed::disputedOnWay() const {
  if (!has_disputed_) return nullptr;
  for (const Chain* chain : {&from_target_, &from_source_}) {
    const auto end = std::prev(chain->end());
    const auto found = std::find_if(chain->begin(), end, [](const Frame* frame) { return frame->is_disputed; });
    if (found != end) return *found;
  }
  return nullptr;
}

/// Its rotation has the length 1.
TransformFeed::Pose TransformFeed::poseOf(const geometry_msgs::Transform& transform) {
  const auto& q = transform.rotation;
  const auto& p = transform.translation;
  return {Eigen::Quaterniond(q.w, q.x, q.y, q.z).normalized(), Vec3(p.x, p.y, p.z)};
}

/// Where the frame's parent has it: a transform of this very stamp as it was sent, else what tf2 says.
const TransformFeed::Sent& TransformFeed::sentAt(const Frame& frame, StampNs stamp_ns) const {
  if (!frame.is_static || *frame.is_static) return frame.fixed;
  if (frame.asked_change == change_ && frame.asked_ns == stamp_ns) return frame.asked;
  frame.asked = Sent();
  const bool is_newest = !frame.sent.empty() && frame.sent.rbegin()->first == stamp_ns;  // most of the time
  const auto at = is_newest ? std::prev(frame.sent.end()) : frame.sent.find(stamp_ns);
  std::string parent;
  if (at != frame.sent.end()) {
    frame.asked = at->second;
  } else if (frame.is_apart) {
    frame.asked = between(frame, stamp_ns);
  } else if (buffer_._getParent(frame.name, toTime(stamp_ns), parent)) {
    frame.asked = {frameOf(parent), poseOf(buffer_.lookupTransform(parent, frame.name, toTime(stamp_ns)).transform)};
  }
  frame.asked_change = change_;
  frame.asked_ns = stamp_ns;
  return frame.asked;
}

/// As tf2 has it between two stamps; nowhere between those of two publishers, whose clocks may be apart.
TransformFeed::Sent TransformFeed::between(const Frame& frame, StampNs stamp_ns) {
  const auto next = frame.sent.upper_bound(stamp_ns);
  if (next == frame.sent.begin() || next == frame.sent.end()) return {};
  const Sent &one = std::prev(next)->second, &other = next->second;
  if (one.sender != other.sender) return {};
  if (one.parent != other.parent) return one;
  const StampNs from_ns = std::prev(next)->first;
  const double share = static_cast<double>(stamp_ns - from_ns) / static_cast<double>(next->first - from_ns);
  return {one.parent,
          {one.pose.rotation.slerp(share, other.pose.rotation).normalized(),
           (1 - share) * one.pose.translation + share * other.pose.translation},
          one.sender};
}

const TransformFeed::Frame* TransformFeed::newestParentOf(const Frame& frame) {
  return frame.sent.empty() ? frame.fixed.parent : frame.sent.rbegin()->second.parent;
}

/// The first of one that moves after the stamp. Most of the time that is none, or one of the newest.
std::map<StampNs, TransformFeed::Sent>::const_iterator TransformFeed::after(const Frame& frame, StampNs stamp_ns) {
  auto found = frame.sent.end();
  for (int newest = 0; newest < 4 && found != frame.sent.begin(); ++newest) {
    if (std::prev(found)->first <= stamp_ns) return found;
    --found;
  }
  return frame.sent.upper_bound(stamp_ns);
}

/// As tf2 takes it between two stamps with other parents: the one before. Of what it does not know, the nearest.
const TransformFeed::Frame* TransformFeed::parentAt(const Frame& frame, StampNs stamp_ns) {
  if (frame.sent.empty()) return frame.fixed.parent;
  const auto next = after(frame, stamp_ns);
  return (next == frame.sent.begin() ? next : std::prev(next))->second.parent;
}

/// Both chains, up to where the two meet. False: they do not.
template <class ParentOf>
bool TransformFeed::findWay(const std::string& target, const std::string& source, ParentOf parentOf) const {
  const auto climb = [&](const std::string& name, Chain& chain) {
    chain.clear();
    for (const Frame* at = frameOf(name); at && chain.size() <= MAX_CHAIN; at = parentOf(*at)) chain.push_back(at);
  };
  climb(target, from_target_);
  climb(source, from_source_);
  const auto meeting =
      std::find_first_of(from_source_.begin(), from_source_.end(), from_target_.begin(), from_target_.end());
  if (meeting == from_source_.end()) return false;
  from_target_.erase(std::find(from_target_.begin(), from_target_.end(), *meeting) + 1, from_target_.end());
  from_source_.erase(meeting + 1, from_source_.end());
  return true;
}

/// By what sentAt() found last.
TransformFeed::Pose TransformFeed::poseAlong(const Chain& chain) {
  Pose sum;
  for (std::size_t i = 0; i + 1 < chain.size(); ++i) {
    const Frame& frame = *chain[i];
    const Pose& one = *frame.is_static ? frame.fixed.pose : frame.asked.pose;
    sum.translation = one.translation + one.rotation * sum.translation;
    sum.rotation = one.rotation * sum.rotation;
  }
  return sum;
}

bool TransformFeed::lookup(const std::string& target, const std::string& source, StampNs stamp_ns,
                           Eigen::Isometry3d& transform, std::string& reason) const {
  transform = Eigen::Isometry3d::Identity();
  if (target == source) return true;
  const std::lock_guard<std::mutex> lock(mutex_);
  try {
    const auto isDisputed = [&] {
      const Frame* const frame = disputedOnWay();
      if (frame) reason = "'" + shortText(frame->name, MAX_NAME) + "' is on /tf and, elsewhere, on /tf_static";
      return frame != nullptr;
    };
    if (has_disputed_ && findWay(target, source, newestParentOf) && isDisputed()) return false;
    // What tf2 knows of such a frame is out of date.
    const bool is_way = has_apart_ && findWay(target, source, newestParentOf);
    const Frame* const apart = has_apart_ ? firstApart() : nullptr;
    if (apart && is_way && stamp_ns <= 0) {
      StampNs newest_ns = std::numeric_limits<StampNs>::max();
      forEachKeptOnWay([&](const Frame& frame) { newest_ns = std::min(newest_ns, frame.sent.rbegin()->first); });
      stamp_ns = newest_ns;
    }
    Pose of_target, of_source;
    // The newest common transform is tf2's to find, and so is the reason why there is none.
    if (stamp_ns > 0 && findWay(target, source, [&](const Frame& f) { return sentAt(f, stamp_ns).parent; })) {
      if (isDisputed()) return false;
      of_target = poseAlong(from_target_);
      of_source = poseAlong(from_source_);
    } else if (apart) {
      reason = "nothing is known of '" + shortText(apart->name, MAX_NAME) +
               "' then; what was sent before is forgotten, as the stamps of ";
      for (const auto& [sender, newest_ns] : apart->newest) {
        reason += (sender == apart->newest.begin()->first ? "'" : "' and '") + shortText(sender, MAX_NAME);
      }
      reason += apart->newest.size() > 1 ? "', which both send it, are apart" : "' went back";
      return false;
    } else {
      for (const std::string* name : {&target, &source}) {
        reason = frameNameProblem(*name);
        if (reason.empty()) continue;
        reason = "'" + shortText(*name, MAX_NAME) + "' is no frame's name: " + reason;
        return false;
      }
      if (!buffer_.canTransform(target, source, toTime(stamp_ns), &reason)) return false;
      of_source = poseOf(buffer_.lookupTransform(target, source, toTime(stamp_ns)).transform);
    }
    const Eigen::Quaterniond back = of_target.rotation.conjugate();
    transform.linear() = (back * of_source.rotation).normalized().toRotationMatrix();
    transform.translation() = back * (of_source.translation - of_target.translation);
    return transform.matrix().allFinite();
  } catch (const tf2::TransformException& error) {
    reason = error.what();
    return false;
  }
}

/// With each frame that moves on the way that was found last.
template <class Take>
void TransformFeed::forEachKeptOnWay(Take take) const {
  for (const Chain* chain : {&from_target_, &from_source_}) {
    for (std::size_t i = 0; i + 1 < chain->size(); ++i) {
      if (!(*chain)[i]->sent.empty()) take(*(*chain)[i]);
    }
  }
}

std::vector<StampNs> TransformFeed::stampsBetween(const std::string& target, const std::string& source, StampNs from_ns,
                                                  StampNs to_ns, std::vector<NewParent>& changes) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<StampNs> stamps;
  // The way at the end, then the one that was there before its last change, and so on.
  for (StampNs end_ns = to_ns; end_ns > from_ns;) {
    if (!findWay(target, source, [&](const Frame& frame) { return parentAt(frame, end_ns); })) break;
    const std::tuple question(change_, from_ns, end_ns);
    NewParent last{from_ns, nullptr, nullptr, nullptr};
    forEachKeptOnWay([&](const Frame& frame) {
      if (frame.none_between == question) return;
      const std::size_t found_before = stamps.size();
      const Frame *const parent = parentAt(frame, end_ns), *before = nullptr;
      StampNs since_ns = from_ns;
      auto one = after(frame, end_ns);
      bool has_gap =
          one != frame.sent.end() && one != frame.sent.begin() && one->second.gap && std::prev(one)->first < end_ns;
      while (one != frame.sent.begin()) {
        --one;
        has_gap = has_gap || (one->second.gap && one->first > from_ns && one != frame.sent.begin());
        before = one->second.parent;
        if (before != parent) break;
        since_ns = one->first;
        if (since_ns <= from_ns) break;
        if (since_ns < to_ns) stamps.push_back(since_ns);
      }
      if (has_gap) changes.push_back({end_ns, &frame.name, nullptr, nullptr});
      const bool has_all = since_ns <= from_ns || (before == parent && !frame.is_cut);
      if (has_all && !has_gap && stamps.size() == found_before) frame.none_between = question;
      if (has_all || since_ns <= last.stamp_ns) return;
      last = {since_ns, &frame.name, before == parent ? nullptr : &before->name, &parent->name};
    });
    if (!last.frame) break;
    changes.push_back(last);
    end_ns = last.stamp_ns - 1;
  }
  std::sort(stamps.begin(), stamps.end());
  stamps.erase(std::unique(stamps.begin(), stamps.end()), stamps.end());
  return stamps;
}

std::optional<StampNs> TransformFeed::firstStamp(const std::string& target, const std::string& source) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::optional<StampNs> first;
  if (!findWay(target, source, newestParentOf)) return first;
  forEachKeptOnWay([&](const Frame& frame) {
    first = std::max(first.value_or(frame.sent.begin()->first), frame.sent.begin()->first);
  });
  return first;
}

void transform(const Eigen::Isometry3d& target_from_source, Positions& positions) {
  if (target_from_source.matrix() == Eigen::Matrix4d::Identity()) return;  // keeps the bits
  for (Vec3& p : positions) p = target_from_source * p;
}

Positions transformed(const Eigen::Isometry3d& target_from_source, const Positions& positions) {
  if (target_from_source.matrix() == Eigen::Matrix4d::Identity()) return positions;
  Positions out(positions.size());
  for (std::size_t v = 0; v < out.size(); ++v) out[v] = target_from_source * positions[v];
  return out;
}

}  // namespace dccd
