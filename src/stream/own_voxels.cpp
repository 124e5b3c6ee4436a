#include "stream/own_voxels.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "base/next_surface.h"
#include "dccd/tolerances.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {
namespace {

std::uint64_t packed(const VoxelKey& key) {
  return std::uint64_t{key.x} << 32 | std::uint64_t{key.y} << 16 | std::uint64_t{key.z};
}

/// Whether the map tells that the cube is free.
bool isSeenFree(const KnownSpace* known, const LeafBox& box) {
  if (!known) return true;
  const Eigen::Map<const Vec3> lo(box.lo), hi(box.hi);
  return known->isKnown({0.75 * lo + 0.25 * hi, 0.25 * lo + 0.75 * hi});  // its own voxels, not those it touches
}

VoxelTree treeOf(const std::unordered_map<std::uint64_t, OwnVoxel>& voxels) {
  std::vector<OccupiedLeaf> leaves;
  leaves.reserve(voxels.size());
  for (const auto& one : voxels) leaves.push_back({one.second.key, 1});
  return VoxelTree(leaves);
}

/// Calls visit(voxel) for the finest voxels of a cube within the box.
template <class Visit>
void visitVoxels(const OccupiedLeaf& cube, const KeyBox& box, Visit& visit) {
  if (!meets(cube, box)) return;
  if (cube.size == 1) return visit(cube);
  for (const OccupiedLeaf& part : eighthsOf(cube)) visitVoxels(part, box, visit);
}

StampNs nanoseconds(double s) { return static_cast<StampNs>(std::llround(s * 1e9)); }

/// What the bodies' ways reach at most, in keys of the map; empty where no body is known.
KeyBox reachedKeys(const ObstacleMap& map, const std::vector<TrackedBody>& bodies, const std::vector<BodyWay>& paths) {
  Eigen::AlignedBox3d all;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Eigen::AlignedBox3d reached;
    bool turns = false;
    const MeshFrame* last = nullptr;
    for (const MeshStore::Stretch& stretch : paths[b]) {
      turns = turns || stretch.to->rigid;
      for (const MeshFrame* frame : {stretch.to.get(), stretch.from.get()}) {
        if (std::exchange(last, frame) == frame) continue;  // where one stretch ends the next one begins
        for (const Vec3& p : frame->positions) {
          if (const Vec3 q = map.map_from_fixed * p; q.allFinite()) reached.extend(q);
        }
      }
    }
    if (reached.isEmpty()) continue;
    // One that turns leaves the box of its ends by less than that one's diagonal.
    const double more_m = bodies[b].reach_m + (turns ? reached.diagonal().norm() : 0);
    all.extend(reached.min() - Vec3::Constant(more_m));
    all.extend(reached.max() + Vec3::Constant(more_m));
  }
  if (all.isEmpty()) return {};
  const Vec3 lo = all.min(), hi = all.max();
  return VoxelSurface::Impl::of(*map.surface).keysOf(lo.data(), hi.data());
}

std::string countOf(std::uint64_t count) { return std::to_string(count) + (count == 1 ? " voxel" : " voxels"); }

/// Sets the counts of what is own and what is in doubt, and a sentence of each, by body. missed: doubts_missed_.
void describe(const std::vector<TrackedBody>& bodies, bool trust_first, const std::string& missed, OwnVoxels& own) {
  for (const TrackedBody& body : bodies) {
    std::uint64_t its = 0, doubted = 0;
    for (const OwnVoxel& voxel : *own.voxels) {
      if (voxel.body == body.body) ++(voxel.doubted ? doubted : its);
    }
    own.own += its;
    own.doubted += doubted;
    if (its > 0) {
      own.excluded +=
          (own.excluded.empty() ? "" : ", ") + countOf(its) + " of the map as own of body '" + body.name + "'";
    }
    if (doubted > 0) {
      own.doubt += (own.doubt.empty() ? "" : ", ") + countOf(doubted) + " near body '" + body.name + "'";
    }
  }
  if (trust_first && !own.excluded.empty()) own.excluded += ", by own_voxels_doubt: trust the first map's, too";
  if (!own.doubt.empty()) {
    own.doubt = "the step touches one of " + own.doubt + (own.doubted == 1 ? " that was" : " that were");
    own.doubt += " there in the first map";
    if (!missed.empty()) own.doubt += " after " + missed;
    own.doubt +=
        ", so that nobody can tell the body from an obstacle; give a map without the body as octomap_file, move it "
        "away once, or set own_voxels_doubt: trust";
  }
  const auto isSeen = [](const OwnVoxel& voxel) { return voxel.body == NOBODY; };
  const auto seen = static_cast<std::uint64_t>(std::count_if(own.voxels->begin(), own.voxels->end(), isSeen));
  if (seen == 0) return;
  own.doubted += seen;
  own.doubt += (own.doubt.empty() ? "the step touches one of " : "; or one of ") + countOf(seen) +
               " in which a sensor saw something, but not often enough for an obstacle";
}

}  // namespace

void OwnVoxelFinder::forget() {
  before_ = nullptr;
  own_.clear();
  remembered_.clear();
  seen_.clear();
}

bool OwnVoxelFinder::forgetBody(std::uint16_t body) {
  shapes_.erase(body);
  const std::size_t before = own_.size();
  for (auto one = own_.begin(); one != own_.end();) one = one->second.body == body ? own_.erase(one) : std::next(one);
  return before_ && own_.size() < before;
}

StampNs OwnVoxelFinder::pathNeededFrom(StampNs now_ns, double lag_s) const {
  // A map may be older than the one before it, after a clock that went back.
  const StampNs longest_ns = now_ns - nanoseconds(tolerance::OWN_PATH_S);
  return (before_ ? std::clamp(before_ns_, longest_ns, now_ns) : now_ns) - nanoseconds(lag_s);
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

/// The cubes of which it matters whether a body reached them. Forgets own voxels that the map shows no more, and what
/// was in doubt by its maker: of that the new one is asked for, or taken over where no body is near.
std::vector<ReachedCube> OwnVoxelFinder::cubesToAsk(const ObstacleMap& map, const VoxelTree& sure,
                                                    const KeyBox& region) {
  const VoxelSurface& surface = *map.surface;
  std::vector<ReachedCube> cubes;
  const auto ask = [&](const OccupiedLeaf& leaf, ReachedCube::Why why) {
    cubes.push_back({leaf, why, leafBox(leaf, surface.resolution()), -1});
  };
  const VoxelTree nothing{std::vector<OccupiedLeaf>()}, remembered(remembered_), own = treeOf(own_);
  const VoxelTree &now = VoxelSurface::Impl::of(surface).tree,
                  &before = before_ ? VoxelSurface::Impl::of(*before_).tree : nothing;
  auto appeared = [&](const OccupiedLeaf& voxel) {
    if (cubes.size() < tolerance::MOST_OWN_ASKED) ask(voxel, ReachedCube::Why::APPEARED);
  };
  visitDifference(now, before, [&](const OccupiedLeaf& fresh) {
    if (!meets(fresh, region)) return;
    visitUncovered(sure, fresh, [&](const OccupiedLeaf& unsure) {
      visitUncovered(remembered, unsure, [&](const OccupiedLeaf& part) { visitVoxels(part, region, appeared); });
    });
  });
  visitDifference(before, now, [&](const OccupiedLeaf& gone) {
    visitUncovered(own, gone, [&](const OccupiedLeaf& part) { ask(part, ReachedCube::Why::VANISHED); });
  });
  for (const OccupiedLeaf& leaf : remembered_) {
    visitUncovered(now, leaf, [&](const OccupiedLeaf& part) { ask(part, ReachedCube::Why::REMEMBERED); });
  }
  for (auto one = own_.begin(); one != own_.end();) {
    const OccupiedLeaf leaf{one->second.key, 1};
    const bool shown = coverage(now, leaf) == VoxelTree::Coverage::FULL;
    if (shown && one->second.doubted) ask(leaf, ReachedCube::Why::DOUBTED);
    one = shown ? std::next(one) : own_.erase(one);
  }
  seen_.clear();
  if (!map.own.doubted_surface) return cubes;
  const std::size_t most = cubes.size() + tolerance::MOST_OWN_ASKED;
  auto askSeen = [&](const OccupiedLeaf& voxel) {
    if (!meets(voxel, region) || cubes.size() >= most) return seen_.push_back(voxel);
    ask(voxel, ReachedCube::Why::SEEN);
  };
  for (const OccupiedLeaf& leaf : VoxelSurface::Impl::of(*map.own.doubted_surface).tree.leaves())
    visitUncovered(sure, leaf, askSeen);
  return cubes;
}

/// Says of each cube, by whether a body reached it, what it is from now on: own, in doubt, remembered or none of these.
void OwnVoxelFinder::follow(const std::vector<ReachedCube>& cubes, const KnownSpace* known, bool trust_first,
                            const std::set<int>& unknown_yet) {
  std::vector<OccupiedLeaf> remembered;
  for (const ReachedCube& cube : cubes) {
    const bool reached = cube.body >= 0;
    const std::uint64_t key = packed(cube.leaf.min);
    switch (cube.why) {
      case ReachedCube::Why::APPEARED:
        if (reached)
          own_[key] = {cube.leaf.min, static_cast<std::uint16_t>(cube.body),
                       !trust_first && (!before_ || unknown_yet.count(cube.body) > 0)};
        break;
      case ReachedCube::Why::VANISHED:
      case ReachedCube::Why::REMEMBERED:
        if (reached || !isSeenFree(known, cube.box)) remembered.push_back(cube.leaf);
        break;
      case ReachedCube::Why::DOUBTED:
        if (!reached) own_.erase(key);
        if (reached && trust_first) own_[key].doubted = false;
        break;
      case ReachedCube::Why::SEEN:
        if (!reached) seen_.push_back(cube.leaf);
        break;
    }
  }
  remembered_ = std::move(remembered);  // at once: where memory ends before, the same map comes again
  // One that was not looked at may have shown it free, or before the body came near.
  if (!missed_.empty() && !trust_first) {
    for (auto& one : own_) one.second.doubted = true;
  }
  const bool any_doubted = std::any_of(own_.begin(), own_.end(), [](const auto& one) { return one.second.doubted; });
  if (!missed_.empty()) doubts_missed_ = missed_;
  if (!any_doubted) doubts_missed_.clear();
}

/// Which maps came between the last one and this one, in words; empty: none. After a first one all is in doubt.
std::string OwnVoxelFinder::missedBefore(const ObstacleMap& map) const {
  if (!before_ || map.number <= number_ + 1) return "";
  const std::uint64_t count = map.number - number_ - 1;
  return std::to_string(count) + (count == 1 ? " that was" : " that were") + " not looked at (" +
         (why_lost_.empty() ? "they come faster than they are used; send fewer" : why_lost_) + ")";
}

ObstacleMap OwnVoxelFinder::reduce(const ObstacleMap& map, const VoxelSurface* trusted, std::vector<TrackedBody> bodies,
                                   double lag_s, bool trust_first) {
  const double resolution_m = map.surface->resolution();
  for (TrackedBody& body : bodies) {
    if (body.reach_m == ONE_VOXEL) body.reach_m = resolution_m;
  }
  missed_ = missedBefore(map);
  const bool is_other = before_ && (before_->resolution() != resolution_m || frame_id_ != map.frame_id);
  if (is_other || remembered_.size() > MOST_REMEMBERED) forget();
  const VoxelTree nothing{std::vector<OccupiedLeaf>()};
  const VoxelTree& sure = trusted ? VoxelSurface::Impl::of(*trusted).tree : nothing;
  const auto ways = waysOf(bodies, map.stamp_ns, lag_s);
  std::vector<ReachedCube> cubes = cubesToAsk(map, sure, reachedKeys(map, bodies, ways));
  searchReach(bodies, ways, map.map_from_fixed, resolution_m, cubes, &shapes_);
  std::set<int> unknown_yet;
  for (const TrackedBody& body : bodies) {
    const bool is_older = !body.holds_always && !body.frames->empty() && map.stamp_ns < body.frames->oldest().stamp_ns;
    if (is_older) unknown_yet.insert(body.body);
  }
  follow(cubes, map.known.get(), trust_first, unknown_yet);
  frame_id_ = map.frame_id;
  before_ = map.surface;
  before_ns_ = map.stamp_ns;
  number_ = map.number;
  if (!missed_.empty()) why_lost_.clear();

  ObstacleMap next = map;
  next.own = OwnVoxels();
  next.own.looked_at = static_cast<std::uint64_t>(std::count_if(
      cubes.begin(), cubes.end(), [](const ReachedCube& cube) { return cube.why == ReachedCube::Why::APPEARED; }));
  return withoutOwn(std::move(next), trusted, bodies, trust_first);
}

ObstacleMap OwnVoxelFinder::reducedAnew(const ObstacleMap& reduced, const VoxelSurface* trusted,
                                        const std::vector<TrackedBody>& bodies, bool trust_first) {
  ObstacleMap map = reduced;
  map.surface = before_;
  map.own = OwnVoxels();
  map.own.looked_at = reduced.own.looked_at;
  return withoutOwn(std::move(map), trusted, bodies, trust_first);
}

ObstacleMap OwnVoxelFinder::withoutOwn(ObstacleMap map, const VoxelSurface* trusted,
                                       const std::vector<TrackedBody>& bodies, bool trust_first) {
  const double resolution_m = map.surface->resolution();
  const VoxelTree nothing{std::vector<OccupiedLeaf>()};
  const VoxelTree& sure = trusted ? VoxelSurface::Impl::of(*trusted).tree : nothing;
  std::vector<OwnVoxel> voxels;
  for (const auto& one : own_) voxels.push_back(one.second);
  std::sort(voxels.begin(), voxels.end(), [](const OwnVoxel& a, const OwnVoxel& b) { return a.key < b.key; });
  for (const OccupiedLeaf& leaf : seen_) voxels.push_back({leaf.min, NOBODY, true});
  std::vector<OccupiedLeaf> doubted;
  for (const OwnVoxel& voxel : voxels) {
    if (voxel.doubted) doubted.push_back({voxel.key, 1});
  }
  if (!doubted.empty()) map.own.doubted_surface = VoxelSurface::build(resolution_m, std::move(doubted));
  map.own.voxels = share(std::move(voxels));
  describe(bodies, trust_first, doubts_missed_, map.own);
  if (!own_.empty() || trusted) {
    std::vector<OccupiedLeaf> without = sure.leaves();
    for (const auto& one : own_) {
      visitUncovered(sure, {one.second.key, 1}, [&](const OccupiedLeaf& voxel) { without.push_back(voxel); });
    }
    const auto last = reduced_.lock();
    const std::shared_ptr<const VoxelSurface> given = map.surface;
    map.surface =
        nextSurface(resolution_m, leavesWithout(VoxelSurface::Impl::of(*given).tree, VoxelTree(without), sure.leaves()),
                    last ? *last : *given);
  }
  reduced_ = map.surface;
  return map;
}

}  // namespace dccd
