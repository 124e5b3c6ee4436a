#include "node/frames_at_rest.h"

#include <algorithm>
#include <vector>

#include <Eigen/Geometry>

#include "input/short_text.h"

namespace dccd {

namespace {

/// At most, of points within reach of the frame's origin.
double pointsMoved(const Eigen::Isometry3d& from, const Eigen::Isometry3d& to, double reach_m) {
  if (from.matrix() == to.matrix()) return 0;
  const Eigen::Isometry3d way = from.inverse() * to;
  return way.translation().norm() + Eigen::AngleAxisd(way.linear()).angle() * reach_m;
}

}  // namespace

FramesAtRest::Word FramesAtRest::look(const FrameTracks& tracks, const std::string& frame, const std::string& reference,
                                      StampNs from_ns, StampNs to_ns, double reach_m) {
  std::map<std::string, Rest>& rests = rests_[frame];
  if (!reference.empty() && reference != frame) rests.try_emplace(reference);
  Word word;
  for (auto& [name, rest] : rests) {
    const StampNs since_ns = rest.first ? std::min(rest.until_ns, from_ns) : from_ns;
    const std::vector<Knot> knots = tracks.between(name, frame, since_ns, to_ns, Silence::STANDS);
    if (knots.empty()) word.unknown = "tf does not tell any more where it is in '" + shortText(name, MAX_NAME) + "'";
    for (const Knot& knot : knots) {
      if (!knot.why_unknown.empty()) {
        word.unknown = knot.why_unknown;
        continue;
      }
      if (!rest.first) rest.first = knot.pose;
      rest.moved_m = std::max(rest.moved_m, pointsMoved(*rest.first, knot.pose, reach_m));
    }
    rest.until_ns = to_ns;
    if (word.reference.empty() || rest.moved_m > word.moved_m) {
      word.reference = name;
      word.moved_m = rest.moved_m;
    }
  }
  return word;
}

}  // namespace dccd
