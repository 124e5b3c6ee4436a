// What is asked of tf: poses at a stamp, from what TransformFeed kept of what was sent.
#include <algorithm>
#include <iterator>
#include <limits>

#include <tf2/LinearMath/Quaternion.h>
#include <Eigen/Geometry>

#include "input/short_text.h"
#include "input/transform_tracks.h"
#include "input/transforms.h"

namespace dccd {

namespace {

// tf2 follows no longer chain.
constexpr std::size_t MAX_CHAIN = 1000;
// Between two transforms that are further apart a frame may have gone anywhere. Frames that move slowly come once a
// second.
constexpr StampNs LONGEST_HOLE_NS = 2'000'000'000;

}  // namespace

/// On the way that was found last, or as far as it goes; null: none.
const TransformFeed::Frame* TransformFeed::firstApart() const {
  for (const Chain* chain : {&from_target_, &from_source_}) {
    const auto found = std::find_if(chain->begin(), chain->end(), [](const Frame* frame) { return frame->is_apart; });
    if (found != chain->end()) return *found;
  }
  return nullptr;
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

/// Where the frame's parent has it: a transform of this very stamp as it was sent, else between two.
const TransformFeed::Sent& TransformFeed::sentAt(const Frame& frame, StampNs stamp_ns) const {
  if (!frame.is_static || *frame.is_static) return frame.fixed;
  if (frame.asked_change == change_ && frame.asked_ns == stamp_ns) return frame.asked;
  const auto at = find(frame.sent, stamp_ns);
  frame.asked = at != frame.sent.end() ? at->second : between(frame, stamp_ns);
  frame.asked.pose.rotation.normalize();
  frame.asked_change = change_;
  frame.asked_ns = stamp_ns;
  return frame.asked;
}

/// As tf2 has it between two stamps, bit for bit; of a frame of which something was forgotten nowhere between those of
/// two publishers, whose clocks may be apart.
TransformFeed::Sent TransformFeed::between(const Frame& frame, StampNs stamp_ns) {
  const auto next = after(frame.sent, stamp_ns);
  if (next == frame.sent.begin() || next == frame.sent.end()) return {};
  const auto& [from_ns, one] = *std::prev(next);
  const auto& [to_ns, other] = *next;
  if (frame.is_apart && one.sender != other.sender) return {};
  if (one.parent != other.parent) return one;
  const double share =
      ros::Duration().fromNSec(stamp_ns - from_ns).toSec() / ros::Duration().fromNSec(to_ns - from_ns).toSec();
  const auto turn = [](const Sent& sent) {
    const Eigen::Quaterniond& q = sent.pose.rotation;
    return tf2::Quaternion(q.x(), q.y(), q.z(), q.w());
  };
  const tf2::Quaternion turned = tf2::slerp(turn(one), turn(other), share);
  return {one.parent,
          {{turned.w(), turned.x(), turned.y(), turned.z()},
           (1 - share) * one.pose.translation + share * other.pose.translation},
          one.sender};
}

const TransformFeed::Frame* TransformFeed::newestParentOf(const Frame& frame) {
  return frame.sent.empty() ? frame.fixed.parent : frame.sent.rbegin()->second.parent;
}

/// As tf2 takes it between two stamps with other parents: the one before. Of what it does not know, the nearest.
const TransformFeed::Frame* TransformFeed::parentAt(const Frame& frame, StampNs stamp_ns) {
  if (frame.sent.empty()) return frame.fixed.parent;
  const auto next = after(frame.sent, stamp_ns);
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
  const auto isDisputed = [&] {
    const Frame* const frame = disputedOnWay();
    if (frame) reason = "'" + shortText(frame->name, MAX_NAME) + "' is on /tf and, elsewhere, on /tf_static";
    return frame != nullptr;
  };
  if (has_disputed_ && findWay(target, source, newestParentOf) && isDisputed()) return false;
  if (stamp_ns <= 0 && findWay(target, source, newestParentOf)) stamp_ns = newestOnWay();
  if (!findWay(target, source, [&](const Frame& f) { return sentAt(f, stamp_ns).parent; })) {
    reason = whyNoWay(target, source, stamp_ns);
    return false;
  }
  if (isDisputed()) return false;
  const Pose of_target = poseAlong(from_target_), of_source = poseAlong(from_source_);
  const Eigen::Quaterniond back = of_target.rotation.conjugate();
  transform.linear() = (back * of_source.rotation).normalized().toRotationMatrix();
  transform.translation() = back * (of_source.translation - of_target.translation);
  return transform.matrix().allFinite();
}

std::string TransformFeed::whyNoWay(const std::string& target, const std::string& source, StampNs stamp_ns) const {
  const auto quoted = [](const std::string& name) { return "'" + shortText(name, MAX_NAME) + "'"; };
  for (const std::string* name : {&target, &source}) {
    const std::string problem = frameNameProblem(*name);
    if (!problem.empty()) return quoted(*name) + " is no frame's name: " + problem;
  }
  const bool is_way = findWay(target, source, newestParentOf);
  if (const Frame* const apart = has_apart_ ? firstApart() : nullptr) {
    std::string reason =
        "nothing is known of " + quoted(apart->name) + " then; what was sent before is forgotten, as the stamps of ";
    for (const auto& [sender, newest_ns] : apart->newest) {
      reason += (sender == apart->newest.begin()->first ? "'" : "' and '") + shortText(sender, MAX_NAME);
    }
    return reason + (apart->newest.size() > 1 ? "', which both send it, are apart" : "' went back");
  }
  for (const std::string* name : {&target, &source}) {
    if (!frameOf(*name)) return "tf has no frame " + quoted(*name);
  }
  if (!is_way) return "tf does not join the two";
  std::string reason = "tf joined them otherwise then";
  forEachKeptOnWay([&](const Frame& frame) {
    const StampNs first_ns = frame.sent.front().first, newest_ns = frame.sent.back().first;
    if (newest_ns < stamp_ns)
      reason = "the newest transform of " + quoted(frame.name) + " is of " + secondsOf(newest_ns);
    if (first_ns > stamp_ns) reason = "tf keeps nothing of " + quoted(frame.name) + " before " + secondsOf(first_ns);
  });
  return reason;
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

/// The most there is where none moves.
StampNs TransformFeed::newestOnWay() const {
  StampNs newest_ns = std::numeric_limits<StampNs>::max();
  forEachKeptOnWay([&](const Frame& frame) { newest_ns = std::min(newest_ns, frame.sent.back().first); });
  return newest_ns;
}

std::optional<StampNs> TransformFeed::newestStamp(const std::string& target, const std::string& source) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const StampNs newest_ns = findWay(target, source, newestParentOf) ? newestOnWay() : 0;
  return newest_ns > 0 && newest_ns < std::numeric_limits<StampNs>::max() ? std::optional(newest_ns) : std::nullopt;
}

std::optional<TransformFeed::Ahead> TransformFeed::mostAhead(const std::string& target,
                                                             const std::string& source) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::optional<Ahead> most;
  if (!findWay(target, source, newestParentOf)) return most;
  forEachKeptOnWay([&](const Frame& frame) {
    const std::optional<double> seconds = frame.lead.seconds();
    if (seconds && (!most || *seconds > most->seconds)) most = Ahead{frame.name, *seconds};
  });
  return most;
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
      const auto next = after(frame.sent, end_ns);
      auto one = next;
      const auto followsGap = [&](auto sample) {
        return sample != frame.sent.begin() &&
               (sample->second.gap || sample->first - std::prev(sample)->first > LONGEST_HOLE_NS);
      };
      bool has_gap = one != frame.sent.end() && followsGap(one) && std::prev(one)->first < end_ns;
      while (one != frame.sent.begin()) {
        --one;
        has_gap = has_gap || (one->first > from_ns && followsGap(one));
        before = one->second.parent;
        if (before != parent) break;
        since_ns = one->first;
        if (since_ns <= from_ns) break;
        if (since_ns < to_ns) stamps.push_back(since_ns);
      }
      if (has_gap) changes.push_back({end_ns, &frame.name, nullptr, nullptr});
      const bool is_leaving = next != frame.sent.end() && next->second.parent != parent &&
                              std::prev(next)->first < end_ns && end_ns == to_ns;
      if (is_leaving) {
        const StampNs last_ns = std::prev(next)->first;
        changes.push_back({next->first, &frame.name, &parent->name, &next->second.parent->name, last_ns});
      }
      const bool has_all = since_ns <= from_ns || (before == parent && !frame.is_cut);
      if (has_all && !has_gap && !is_leaving && stamps.size() == found_before) frame.none_between = question;
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

std::string TransformFeed::doubtNextTo(const std::string& target, const std::string& source, StampNs stamp_ns) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::string doubt;
  if (!findWay(target, source, [&](const Frame& frame) { return parentAt(frame, stamp_ns); })) return doubt;
  forEachKeptOnWay([&](const Frame& frame) {
    const auto next = after(frame.sent, stamp_ns);
    if (next == frame.sent.begin() || !doubt.empty()) return;
    const auto at = std::prev(next);
    const bool is_sent = at->first == stamp_ns, has_next = next != frame.sent.end();
    const std::string name = "frame '" + shortText(frame.name, MAX_NAME) + "'";
    if (is_sent && at->second.gap) {
      doubt = "a transform of " + name + " came that is not used";
    } else if (!is_sent && has_next && at->second.parent != next->second.parent) {
      doubt = name + " changed its parent";
    }
    const auto first = at == frame.sent.begin() ? at : std::prev(at);
    const auto end = has_next && std::next(next) != frame.sent.end() ? std::next(next, 2) : frame.sent.end();
    const auto isAnothers = [&](const auto& sample) { return sample.second.sender != at->second.sender; };
    if (std::any_of(first, end, isAnothers)) doubt = "transforms of " + name + " came from two publishers";
  });
  return doubt;
}

std::uint64_t TransformFeed::staticSince(const std::string& target, const std::string& source) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::uint64_t since = 0;
  if (!findWay(target, source, newestParentOf)) return since;
  for (const Chain* chain : {&from_target_, &from_source_}) {
    for (std::size_t i = 0; i + 1 < chain->size(); ++i) since = std::max(since, (*chain)[i]->fixed_since);
  }
  return since;
}

std::string TransformFeed::rootOf(const std::string& name) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  const Frame *const frame = frameOf(name), *root = frame;
  for (std::size_t i = 0; root && i < MAX_CHAIN && newestParentOf(*root); ++i) root = newestParentOf(*root);
  return root == frame ? std::string() : root->name;
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
