#include "input/transforms.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <sstream>
#include <utility>

#include <geometry_msgs/TransformStamped.h>
#include <ros/serialization.h>
#include <Eigen/Geometry>
#include <boost/make_shared.hpp>

#include "input/short_text.h"

namespace dccd {

namespace {

constexpr std::size_t LEAST_TRANSFORM = 76;  // bytes of one without names

/// A name as tf2 takes it. Nearly all are taken as they are, and not copied.
class Unslashed {
 public:
  explicit Unslashed(const std::string& name) : name_(name) {
    if (hasSlash()) rest_ = name.substr(1);
  }
  const std::string& get() const { return hasSlash() ? rest_ : name_; }

 private:
  const std::string& name_;
  std::string rest_;
  bool hasSlash() const { return !name_.empty() && name_[0] == '/'; }
};

/// Of what tf2 would refuse with a line on the console, each time that it comes; empty: it can be used.
std::string problemOf(const geometry_msgs::TransformStamped& transform) {
  const auto& p = transform.transform.translation;
  const auto& q = transform.transform.rotation;
  const Unslashed child_name(transform.child_frame_id), parent_name(transform.header.frame_id);
  const std::string &child = child_name.get(), &parent = parent_name.get();
  if (const std::string problem = frameNameProblem(child); !problem.empty()) return "child_frame_id: " + problem;
  if (const std::string problem = frameNameProblem(parent); !problem.empty()) return "frame_id: " + problem;
  if (child == parent) return "it is its own parent";
  const double norm2 = q.x * q.x + q.y * q.y + q.z * q.z + q.w * q.w;
  const bool is_finite = std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z);
  if (is_finite && std::abs(norm2 - 1) < tolerance::TF_QUATERNION_NORM) return {};  // false with a NaN
  std::ostringstream text;                                                          // which takes as long as all else
  if (!is_finite) {
    text << "its translation (" << p.x << ' ' << p.y << ' ' << p.z << ") is not finite";
    return text.str();
  }
  text << "its rotation x y z w (" << q.x << ' ' << q.y << ' ' << q.z << ' ' << q.w << ") has the length "
       << std::sqrt(norm2) << "; publish a quaternion of length 1";
  return text.str();
}

}  // namespace

TransformFeed::TransformFeed(double kept_s)
    : kept_ns_(std::llround(1e9 * kept_s)), max_kept_(static_cast<std::size_t>(MAX_KEPT * kept_s / 10)) {}

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

TransformFeed::Jump TransformFeed::jumpOf(const Frame* frame, StampNs stamp_ns, const Sent& now,
                                          const std::string& sender) const {
  if (!frame || frame->sent.empty()) return Jump::NONE;
  const StampNs newest_ns = frame->sent.rbegin()->first;
  if (stamp_ns >= newest_ns) {  // nearly always: it is not looked for among thousands
    // It leaps over all that was forgotten when stamps went back: two streams under one name.
    const bool leaps = newest_ns < frame->forgotten_ns - JUMP_BACK_NS && stamp_ns > frame->forgotten_ns;
    return leaps ? Jump::TWO_SENDERS : Jump::NONE;
  }
  if (stamp_ns < newest_ns - JUMP_BACK_NS) {
    const auto its_newest = frame->newest.find(sender);
    const bool went_back = its_newest != frame->newest.end() && stamp_ns < its_newest->second - JUMP_BACK_NS;
    return went_back ? Jump::LOOP : Jump::TWO_SENDERS;
  }
  const auto at_stamp = find(frame->sent, stamp_ns);
  if (at_stamp == frame->sent.end()) return Jump::NONE;
  if (isSame(at_stamp->second, now, tolerance::SAME_PLACE)) return Jump::NONE;
  return *at_stamp->second.sender == sender ? Jump::LOOP : Jump::TWO_SENDERS;
}

void TransformFeed::emptied(Frame& frame) {
  if (!frame.sent.empty()) frame.forgotten_ns = frame.sent.rbegin()->first;
  ++frame.times_forgotten;
  frame.sent.clear();
  frame.lead = {};
}

/// What was sent of one that moves.
void TransformFeed::forget(Frame& frame) {
  kept_count_ -= frame.sent.size();
  emptied(frame);
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

/// What was forgotten since time began anew the last time is of this one, as far as it has come: tf may be early.
void TransformFeed::beginAnew(StampNs stamp_ns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  const auto isOfBefore = [&](const Frame& frame) {
    return !frame.sent.empty() && frame.times_forgotten == frame.forgotten_before &&
           frame.sent.rbegin()->first > stamp_ns + JUMP_BACK_NS;
  };
  ++change_;
  if (std::all_of(frames_.begin(), frames_.end(),
                  [&](const auto& named) { return named.second.sent.empty() || isOfBefore(named.second); })) {
    clear();
  }
  for (auto& named : frames_) {
    Frame& frame = named.second;
    if (isOfBefore(frame)) {
      frame.newest.clear();
      forget(frame);
    }
    frame.forgotten_before = frame.times_forgotten;
  }
}

/// Else it is kept, and those are forgotten that are too old beside it.
bool TransformFeed::isRepeated(const geometry_msgs::TransformStamped& transform, const Sent& sent, Frame& frame) {
  const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
  const auto newest = frame.newest.try_emplace(*sent.sender, stamp_ns).first;
  newest->second = std::max(newest->second, stamp_ns);
  if (find(frame.sent, stamp_ns) != frame.sent.end()) return true;
  const auto at = frame.sent.insert(after(frame.sent, stamp_ns), {stamp_ns, sent}), next = std::next(at);
  const bool passed_over = next == frame.sent.end() ? std::exchange(frame.passed_over, false) : next->second.gap;
  const bool lost = std::exchange(frame.lost, lost_) != lost_;
  at->second.gap = passed_over || lost;
  ++kept_count_;
  const StampNs oldest_ns = frame.sent.rbegin()->first - kept_ns_;
  for (; frame.sent.begin()->first < oldest_ns; frame.is_cut = true) frame.sent.pop_front(), --kept_count_;
  return false;
}

/// Keeps static transforms.
void TransformFeed::clear() {
  for (auto& named : frames_) {
    emptied(named.second);
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
    if (!problemOf(transform).empty()) return false;
    const Sent now{frameOf(Unslashed(transform.header.frame_id).get()), poseOf(transform.transform)};
    return jumpOf(frameOf(Unslashed(transform.child_frame_id).get()),
                  static_cast<StampNs>(transform.header.stamp.toNSec()), now, sender) == Jump::LOOP;
  });
}

void TransformFeed::leaveOut(const geometry_msgs::TransformStamped& transform, const std::string& problem) {
  ++unusable_;
  const std::string child = shortText(Unslashed(transform.child_frame_id).get(), MAX_NAME);
  const bool known = told_.count(child) > 0;
  if (!known && told_.size() >= MAX_TOLD) return;
  const std::string text = "transforms of '" + child + "' are left out: " + problem;
  // A frame that has had usable ones is not in want of a place.
  const Frame* frame = frameOf(Unslashed(transform.child_frame_id).get());
  if (!known && !(frame && frame->is_static)) only_unusable_[child] = text;
  if (told_.insert(child).second) problems_.push_back(text);
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
    if (told_.insert(topic).second) problems_.push_back("a message on " + topic + " is damaged and left out");
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

std::vector<std::string> TransformFeed::takeProblems() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(problems_, {});
}

bool TransformFeed::add(const tf2_msgs::TFMessage& message, bool is_static, const std::string& sender,
                        StampNs arrival_ns) {
  const std::lock_guard<std::mutex> lock(mutex_);
  bool cleared = false;
  const std::string& its_sender = *senderOf(sender);
  for (const auto& transform : message.transforms) {
    if (const std::string problem = problemOf(transform); !problem.empty()) {
      leaveOut(transform, problem);
      passOver(transform);
      continue;
    }
    if (!only_unusable_.empty()) only_unusable_.erase(Unslashed(transform.child_frame_id).get());
    const Frame* parent = roomFor(Unslashed(transform.header.frame_id).get());
    Frame* frame = roomFor(Unslashed(transform.child_frame_id).get());
    if (!parent || !frame) {
      passOver(transform);
      continue;
    }
    ++change_;
    const Sent sent{parent, poseOf(transform.transform), &its_sender};
    if (!frame->is_static) frame->is_static = is_static;
    if (*frame->is_static != is_static) {
      if (!isThere(*frame, sent)) dispute(transform, *frame);
      continue;
    }
    if (is_static) {
      if (frame->fixed.parent && !isSame(frame->fixed, sent, tolerance::SAME_PLACE)) {
        ++times_forgotten_;
        frame->fixed_since = change_;
      }
      frame->fixed = sent;
      frame->fixed.pose.rotation.normalize();
    } else {
      const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
      const Jump jump = jumpOf(frame, stamp_ns, sent, its_sender);
      frame->lead.add(stamp_ns, arrival_ns);
      const bool hides_later = jump != Jump::NONE && frame->sent.rbegin()->first <= stamp_ns + JUMP_BACK_NS;
      const bool is_full = kept_count_ >= max_kept_;
      cleared = cleared || is_full || jump != Jump::NONE;
      if (is_full) clear();
      if (jump == Jump::TWO_SENDERS) forget(*frame);
      if (jump == Jump::LOOP) forgetAllOf(*sent.sender);
      if (isRepeated(transform, sent, *frame)) {
        if (!isSame(find(frame->sent, stamp_ns)->second, sent, tolerance::SAME_PLACE)) passOver(transform);
        continue;
      }
      // What was sent for a time after this one is forgotten. Up to the next one nobody knows where the frame went.
      frame->passed_over = frame->passed_over || hides_later;
    }
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
  const auto known = frames_.find(Unslashed(transform.child_frame_id).get());
  if (known == frames_.end()) return;
  Frame& frame = known->second;
  ++change_;
  if (frame.is_static.value_or(false)) {
    ++times_forgotten_;
    frame.fixed_since = change_;
  }
  const StampNs stamp_ns = static_cast<StampNs>(transform.header.stamp.toNSec());
  const auto at = find(frame.sent, stamp_ns), next = after(frame.sent, stamp_ns);
  if (at != frame.sent.end()) at->second.gap = true;
  (next == frame.sent.end() ? frame.passed_over : next->second.gap) = true;
}

/// For good, as for tf2 a frame stays what it was first.
void TransformFeed::dispute(const geometry_msgs::TransformStamped& transform, Frame& frame) {
  frame.is_disputed = has_disputed_ = true;
  leaveOut(transform, "it is on /tf and, elsewhere, on /tf_static; stop one of the two and start the monitor anew");
}

/// As it was sent: its rotation has nearly the length 1.
TransformFeed::Pose TransformFeed::poseOf(const geometry_msgs::Transform& transform) {
  const auto& q = transform.rotation;
  const auto& p = transform.translation;
  return {Eigen::Quaterniond(q.w, q.x, q.y, q.z), Vec3(p.x, p.y, p.z)};
}

}  // namespace dccd
