// Where bodies were since the map before, and whether that is known.
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "dccd/tolerances.h"
#include "stream/own_voxels_look.h"

namespace dccd {
namespace {

StampNs inNanoseconds(double s) { return static_cast<StampNs>(std::llround(s * 1e9)); }

/// Whether one that may be of several runs is known between the stamps all the same: no longer than a gap from frame to
/// frame, and no teleport. last: of the map before, where a reset took it away; null: none.
bool goesOn(const MeshStore& frames, const MeshFrame* last, StampNs since_ns, StampNs until_ns) {
  const auto kept = frames.framesWithin(std::numeric_limits<StampNs>::min(), std::numeric_limits<StampNs>::max());
  const MeshFrame* before = last && last->stamp_ns < kept.front()->stamp_ns ? last : nullptr;
  bool is_begun = before && before->stamp_ns >= since_ns;
  for (const auto& frame : kept) {
    is_begun = is_begun || frame->stamp_ns <= since_ns;
    if (before && frame->stamp_ns > since_ns && before->stamp_ns < until_ns) {
      if (secondsBetween(before->stamp_ns, frame->stamp_ns) > tolerance::OWN_GAP_S) return false;
      if (before->positions.size() != frame->positions.size()) return false;
      const double most_m = frames.options().max_vertex_step_m;
      for (std::size_t v = 0; most_m > 0 && v < frame->positions.size(); ++v) {
        if (!((frame->positions[v] - before->positions[v]).norm() <= most_m)) return false;
      }
    }
    before = frame.get();
  }
  return is_begun && before->stamp_ns >= until_ns;
}

}  // namespace

bool OwnVoxelFinder::Look::wasFound(const OccupiedLeaf& voxel) const {
  const std::vector<OccupiedLeaf>* const found = map.known ? map.known->found() : nullptr;
  if (!found) return false;
  const auto isBefore = [](std::uint64_t code, const OccupiedLeaf& leaf) { return code < codeOf(leaf); };
  const auto next = std::upper_bound(found->begin(), found->end(), codeOf(voxel), isBefore);
  if (next == found->begin()) return false;
  const OccupiedLeaf& leaf = *std::prev(next);
  return ((leaf.min.x ^ voxel.min.x) | (leaf.min.y ^ voxel.min.y) | (leaf.min.z ^ voxel.min.z)) / leaf.size == 0;
}

std::vector<ReachedCube> OwnVoxelFinder::Look::reached(const std::vector<OccupiedLeaf>& leaves,
                                                       const std::vector<TrackedBody>& bodies,
                                                       const std::vector<BodyWay>& ways) const {
  const double resolution_m = map.surface->resolution();
  std::vector<ReachedCube> found;
  for (const OccupiedLeaf& leaf : leaves) found.push_back({leaf, ReachedCube::Why::SEEN, leafBox(leaf, resolution_m)});
  if (!found.empty()) searchReach(bodies, ways, map.map_from_fixed, resolution_m, found, &shapes);
  return found;
}

bool OwnVoxelFinder::Look::addBoxOf(const TrackedBody& body, const BodyWay& way) {
  Eigen::AlignedBox3d reached;
  bool turns = false;
  const MeshFrame* last = nullptr;
  for (const MeshStore::Stretch& stretch : way) {
    turns = turns || stretch.to->rigid;
    for (const MeshFrame* frame : {stretch.to.get(), stretch.from.get()}) {
      if (std::exchange(last, frame) == frame) continue;  // where one stretch ends the next one begins
      for (const Vec3& p : frame->positions) {
        if (const Vec3 q = map.map_from_fixed * p; q.allFinite()) reached.extend(q);
      }
    }
  }
  if (reached.isEmpty()) return false;
  // One that turns leaves the box of its ends by less than that one's diagonal.
  const double more_m = body.reach_m + (turns ? reached.diagonal().norm() : 0);
  const Vec3 lo = reached.min().array() - more_m, hi = reached.max().array() + more_m;
  const KeyBox box = VoxelSurface::Impl::of(*map.surface).keysOf(lo.data(), hi.data());
  if (region.lo[0] > region.hi[0]) region = box;
  extend(region, box);
  if (not_yet.count(body.body) > 0) return false;
  boxes.push_back(box);
  return true;
}

StampNs OwnVoxelFinder::pathNeededFrom(StampNs now_ns, double lag_s) const {
  // A map may be older than the one before it, after a clock that went back.
  const StampNs longest_ns = now_ns - inNanoseconds(tolerance::OWN_PATH_S);
  return (before_ ? std::clamp(before_ns_, longest_ns, now_ns) : now_ns) - inNanoseconds(lag_s);
}

std::vector<BodyWay> OwnVoxelFinder::waysOf(const std::vector<TrackedBody>& bodies, StampNs stamp_ns,
                                            double lag_s) const {
  std::vector<BodyWay> ways;
  for (const TrackedBody& body : bodies) {
    const MeshStore& frames = *body.frames;
    if (frames.empty()) {
      ways.emplace_back();
    } else if (body.holds_always) {
      ways.push_back({{frames.newestShared(), frames.newestShared(), 0, 0}});
    } else {
      // What a map older than all frames of the body shows is in doubt, not own: the first place will do.
      const StampNs until_ns = std::max(stamp_ns, frames.oldest().stamp_ns);
      ways.push_back(frames.pathWithin(pathNeededFrom(stamp_ns, lag_s), until_ns));
    }
  }
  return ways;
}

/// Who is asked with whom, and of which bodies it is not known where they were at some time since the map before.
/// Before its first frame a body is nowhere.
void OwnVoxelFinder::findSeams(Look& look, const std::vector<TrackedBody>& bodies, double lag_s) {
  const StampNs since_ns = pathNeededFrom(look.map.stamp_ns, lag_s);
  for (const TrackedBody& body : bodies) {
    BodySet& asked = look.asked_with[body.body];
    asked.add(body.group());
    for (const std::uint16_t other : body.held) asked.add(other);
    const MeshStore& frames = *body.frames;
    if (frames.empty()) {
      look.not_yet.insert(body.body);
      continue;
    }
    const StampNs oldest_ns = frames.oldest().stamp_ns;
    StampNs& first_ns = first_.emplace(body.body, oldest_ns).first->second;
    first_ns = std::min(first_ns, oldest_ns);  // a clock may go back
    if (look.map.stamp_ns < first_ns) look.not_yet.insert(body.body);
    if (look.map.stamp_ns < first_ns || body.holds_always) continue;
    std::uint64_t begin = 0, end = 0;
    const bool is_one_run = frames.lookup(std::max(since_ns, first_ns), &begin) == Lookup::READY &&
                            frames.lookup(look.map.stamp_ns, &end) == Lookup::READY && begin == end;
    const MeshFrame* const last = last_frames_[body.body].get();
    if (is_one_run || goesOn(frames, last, since_ns, look.map.stamp_ns)) continue;
    const bool was_known = known_.count(body.body) > 0;
    (was_known && goesOn(frames, last, before_ns_, look.map.stamp_ns) ? look.lost : look.seamed).insert(body.body);
  }
  known_.clear();
  for (const TrackedBody& body : bodies) {
    if (look.seamed.count(body.body) + look.not_yet.count(body.body) == 0) known_.insert(body.body);
  }
}

/// States live in the map's frame: where that moved among the bodies, or has another name or resolution, they end.
void OwnVoxelFinder::endWhereItMoved(const ObstacleMap& map, const std::vector<TrackedBody>& bodies) {
  const double resolution_m = map.surface->resolution();
  const bool is_other = before_ && (before_->resolution() != resolution_m || frame_id_ != map.frame_id);
  if (is_other) forget();
  if (!before_ || map.map_from_fixed.matrix() == map_from_fixed_.matrix()) return;
  const auto moved_m = [&](const Vec3& p) { return (map.map_from_fixed * p - map_from_fixed_ * p).norm(); };
  double farthest_m = moved_m(Vec3::Zero());
  for (const TrackedBody& body : bodies) {
    if (body.frames->empty()) continue;
    const Positions& at = body.frames->newest().positions;
    for (const Vec3& p : at) farthest_m = std::max(farthest_m, moved_m(p));
  }
  if (!(farthest_m <= tolerance::OWN_FRAME * resolution_m)) forget();
}

}  // namespace dccd
