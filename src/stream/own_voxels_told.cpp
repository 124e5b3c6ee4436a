// What becomes of a map without what is a body's own, and what is said of it.
#include <algorithm>
#include <unordered_set>
#include <utility>

#include "base/next_surface.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"
#include "stream/own_voxels.h"

namespace dccd {
namespace {

std::string countOf(std::uint64_t count) { return std::to_string(count) + (count == 1 ? " voxel" : " voxels"); }

/// Sets the counts of what is own and what is in doubt, and a sentence of each, by body. gap: before the map that put
/// some in doubt, in words.
void describe(const std::vector<TrackedBody>& bodies, bool trust_first, bool tells_free, const std::string& gap,
              OwnVoxels& own) {
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
  if (!own.excluded.empty() && !tells_free) own.excluded += ", by a map that shows nothing as free";
  if (!own.excluded.empty() && trust_first)
    own.excluded += ", by own_voxels_doubt: trust what is first seen there, too";
  if (!own.doubt.empty()) {
    own.doubt = "the step touches one of " + own.doubt + " that no look has told from an obstacle";
    if (!gap.empty()) own.doubt += ", after " + gap;
    own.doubt +=
        "; let the camera see the place once without the body, give a map without it as octomap_file, or set "
        "own_voxels_doubt: trust";
  }
  const auto isSeen = [](const OwnVoxel& voxel) { return voxel.body == NOBODY; };
  const auto seen = static_cast<std::uint64_t>(std::count_if(own.voxels->begin(), own.voxels->end(), isSeen));
  if (seen == 0) return;
  own.doubted += seen;
  own.doubt += (own.doubt.empty() ? "the step touches one of " : "; or one of ") + countOf(seen) +
               " in which a sensor saw something, but not often enough for an obstacle";
}

}  // namespace

ObstacleMap OwnVoxelFinder::reducedAnew(const ObstacleMap& reduced, const VoxelSurface* trusted,
                                        const std::vector<TrackedBody>& bodies, bool trust_first) {
  ObstacleMap map = reduced;
  map.surface = before_;
  map.own = OwnVoxels();
  map.own.looked_at = reduced.own.looked_at;
  map.own.seen = reduced.own.seen;
  return withoutOwn(std::move(map), trusted, bodies, trust_first);
}

/// What is in doubt and was seen just now, without what a sensor's stray points may have made: fewer than Growth::GROUP
/// voxels that touch each other.
std::vector<OccupiedLeaf> OwnVoxelFinder::seenInGroups(const std::vector<OccupiedLeaf>& seen_now) const {
  std::unordered_set<std::uint64_t> now, keys;
  for (const OccupiedLeaf& voxel : seen_now) now.insert(packed(voxel.min));
  for (const OccupiedLeaf& voxel : seen_)
    if (now.count(packed(voxel.min)) > 0) keys.insert(packed(voxel.min));
  std::vector<OccupiedLeaf> found;
  for (const OccupiedLeaf& voxel : seen_)
    if (keys.count(packed(voxel.min)) > 0 && isOfGroup(voxel.min, keys)) found.push_back(voxel);
  return found;
}

ObstacleMap OwnVoxelFinder::withoutOwn(ObstacleMap map, const VoxelSurface* trusted,
                                       const std::vector<TrackedBody>& bodies, bool trust_first) {
  const double resolution_m = map.surface->resolution();
  const VoxelTree nothing{std::vector<OccupiedLeaf>()};
  const VoxelTree& sure = trusted ? VoxelSurface::Impl::of(*trusted).tree : nothing;
  std::vector<OwnVoxel> voxels;
  for (const auto& [key, voxel] : stated_) {
    if (!voxel.shown) continue;
    const bool is_own = voxel.state == VoxelState::OWN && entered_.count(key) == 0;
    voxels.push_back({voxel.key, *voxel.owners.begin(), !is_own});
  }
  std::sort(voxels.begin(), voxels.end(), [](const OwnVoxel& a, const OwnVoxel& b) { return a.key < b.key; });
  std::vector<OccupiedLeaf> without = sure.leaves();
  for (const OwnVoxel& voxel : voxels) {
    visitUncovered(sure, {voxel.key, 1}, [&](const OccupiedLeaf& own) { without.push_back(own); });
  }
  for (const OccupiedLeaf& leaf : seen_) voxels.push_back({leaf.min, NOBODY, true});
  std::vector<OccupiedLeaf> doubted;
  for (const OwnVoxel& voxel : voxels) {
    if (voxel.doubted) doubted.push_back({voxel.key, 1});
  }
  map.own.doubted_surface = doubted.empty() ? nullptr : VoxelSurface::build(resolution_m, std::move(doubted));
  std::vector<OccupiedLeaf> seen;
  if (map.own.seen) seen = seenInGroups(*map.own.seen);
  map.own.seen = seen.empty() ? nullptr : share(std::move(seen));
  map.own.voxels = share(std::move(voxels));
  describe(bodies, trust_first, map.known != nullptr, gap_, map.own);
  if (!without.empty()) {
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
