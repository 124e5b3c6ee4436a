#include "input/transform_tracks.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "dccd/tolerances.h"
#include "input/short_text.h"

namespace dccd {

namespace {

Knot unknownAt(StampNs stamp_ns, std::string why) { return {stamp_ns, Eigen::Isometry3d::Identity(), std::move(why)}; }

/// How tf has it before the change is as good as unknown: what carried the frame until then may have gone anywhere
/// after it was last sent.
Knot unknownBefore(const TransformFeed::NewParent& change) {
  const std::string name = "'" + shortText(*change.frame, MAX_NAME) + "'";
  if (!change.now) {
    return unknownAt(change.stamp_ns - 1,
                     "a transform of frame " + name +
                         " came that cannot be used, or that has it elsewhere at a stamp that it had already, or none "
                         "came for more than 2 s");
  }
  if (!change.before) {
    return unknownAt(change.stamp_ns - 1,
                     "tf keeps nothing of frame " + name + " before " + secondsOf(change.stamp_ns));
  }
  return unknownAt(change.stamp_ns - 1, "frame " + name + " changed its parent from '" +
                                            shortText(*change.before, MAX_NAME) + "' to '" +
                                            shortText(*change.now, MAX_NAME) + "' at " + secondsOf(change.stamp_ns));
}

/// A sample with the new parent is there, or one with the old.
bool isKnownAt(StampNs stamp_ns, const TransformFeed::NewParent& change) {
  return change.now && (change.stamp_ns <= stamp_ns || stamp_ns <= change.last_ns);
}

}  // namespace

std::string secondsOf(StampNs stamp_ns) {
  std::ostringstream text;
  text << stamp_ns / 1'000'000'000 << '.' << std::setw(9) << std::setfill('0') << stamp_ns % 1'000'000'000 << " s";
  return text.str();
}

std::string noTransformAt(StampNs stamp_ns) { return "no transform of its frame at " + secondsOf(stamp_ns); }

void TransformTracks::look(const std::string& target, const std::string& source, StampNs stamp_ns, Silence silence,
                           bool is_middle, std::vector<Knot>& knots) const {
  Knot knot{stamp_ns};
  knot.is_middle = is_middle;
  std::string unused;
  if (transforms_.lookup(target, source, stamp_ns, knot.pose, unused)) {
    knots.push_back(std::move(knot));
  } else if (silence == Silence::UNKNOWN) {
    knots.push_back(unknownAt(stamp_ns, noTransformAt(stamp_ns)));
  }
}

/// Joint by joint a chain goes otherwise than from one pose to the other: it may bend at each stamp of tf, and the
/// middle between two of these tells how far.
std::vector<Knot> TransformTracks::between(const std::string& target_name, const std::string& source_name,
                                           StampNs from_ns, StampNs to_ns, Silence silence) const {
  const std::string &target = target_name.empty() ? fixed_frame_ : target_name,
                    &source = source_name.empty() ? fixed_frame_ : source_name;
  std::vector<Knot> knots;
  if (target == source) return knots;
  std::vector<TransformFeed::NewParent> changes;
  const StampNs room_ns = from_ns == to_ns ? 1 : 0;  // of a moment, what is next to it
  std::vector<StampNs> stamps = transforms_.stampsBetween(target, source, from_ns - room_ns, to_ns + room_ns, changes);
  if (stamps.size() > tolerance::MOST_POSES_A_STEP) {
    return {unknownAt(to_ns, "more than " + std::to_string(tolerance::MOST_POSES_A_STEP) + " transforms")};
  }
  if (from_ns == to_ns) stamps.clear();
  look(target, source, from_ns, silence, false, knots);
  StampNs before_ns = from_ns;
  if (from_ns < to_ns) stamps.push_back(to_ns);
  for (const StampNs stamp_ns : stamps) {
    std::vector<Knot> sample;
    look(target, source, stamp_ns, silence, false, sample);
    const bool is_known = !sample.empty() && sample.front().why_unknown.empty();  // else that is enough to say
    if (is_known && stamp_ns - before_ns > 1) {
      look(target, source, before_ns + (stamp_ns - before_ns) / 2, silence, true, knots);
    }
    knots.insert(knots.end(), sample.begin(), sample.end());
    before_ns = stamp_ns;
  }
  if (silence == Silence::STANDS && (knots.empty() || knots.back().stamp_ns < to_ns)) {
    Knot newest{to_ns};
    std::string unused;
    if (transforms_.lookup(target, source, 0, newest.pose, unused)) knots.push_back(std::move(newest));
  }
  for (const TransformFeed::NewParent& change : changes) {
    if (from_ns == to_ns && isKnownAt(to_ns, change)) continue;
    knots.push_back(unknownBefore(change));
    knots.back().stamp_ns = std::min(knots.back().stamp_ns, to_ns);
  }
  const auto isBefore = [](const Knot& a, const Knot& b) { return a.stamp_ns < b.stamp_ns; };
  std::stable_sort(knots.begin(), knots.end(), isBefore);
  return knots;
}

std::string TransformTracks::doubtAt(const std::string& target, const std::string& source, StampNs stamp_ns) const {
  if (target == source) return {};
  std::vector<TransformFeed::NewParent> changes;
  transforms_.stampsBetween(target, source, stamp_ns - 1, stamp_ns + 1, changes);
  const auto unknown = std::find_if(changes.begin(), changes.end(), [&](const TransformFeed::NewParent& change) {
    return !isKnownAt(stamp_ns, change);
  });
  return unknown == changes.end() ? std::string() : unknownBefore(*unknown).why_unknown;
}

}  // namespace dccd
