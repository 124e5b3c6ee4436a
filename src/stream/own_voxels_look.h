// What is asked of one map: who is within reach, and what of it follows for a voxel.
#pragma once

#include <algorithm>
#include <map>
#include <set>
#include <unordered_set>
#include <vector>

#include "obstacle/voxel_surface_impl.h"
#include "stream/own_voxels.h"

namespace dccd {

struct OwnVoxelFinder::Look {
  const ObstacleMap& map;
  MapChange change;
  const VoxelTree& sure;
  RigidShapes& shapes;
  bool trust_first, is_gap;
  bool is_blind;                        // the gap is longer than any way that is known
  bool shows_growth;                    // else what was free was so by one map alone: a sensor's first look
  std::set<int> seamed{}, not_yet{};    // bodies of which some of the way is not known; whose first frame is later
  std::set<int> lost{};                 // of which it was known, and is here no more but from the map before on
  std::map<int, BodySet> asked_with{};  // of each body: its group, what it holds or is held by
  std::vector<KeyBox> boxes{};          // of bodies
  KeyBox region{};                      // around all of them
  std::vector<ReachedCube> cubes{};     // of which it matters who reached them
  std::vector<Stated> appeared{};       // what is own or in doubt from now on
  std::unordered_set<std::uint64_t> unknown{};  // packed, of what appeared, and the map before left out
  std::vector<OccupiedLeaf> hidden{};           // obstacles, remembered from now on
  SeenAlone seen_alone{};                       // from now on

  /// Who may go on to account for what these do.
  BodySet askedWith(const BodySet& owners) const {
    BodySet found;
    for (const std::uint16_t owner : owners) {
      for (const std::uint16_t body : asked_with.at(owner)) found.add(body);
    }
    return found;
  }
  bool mayBeNear() const { return !seamed.empty() || !lost.empty(); }
  /// Who may account for what is occupied there.
  BodySet ownersOf(const ReachedCube& cube) const {
    BodySet owners = is_gap ? cube.always : cube.near;
    owners.removeIf([&](int body) { return is_blind || seamed.count(body) > 0; });
    return owners;
  }
  /// Whether something was found in all of the voxel since the map before. Of a map that does not tell: no.
  bool wasFound(const OccupiedLeaf& voxel) const;
  bool tellsFound() const { return !is_blind && map.known && map.known->found(); }
  VoxelEvent occupied(const ReachedCube& cube, const BodySet& owners) const {
    if (!owners.empty()) return VoxelEvent::OCCUPIED_WITH_OWNER;
    if (!cube.near.empty()) return VoxelEvent::OCCUPIED_WITH_OTHER;
    if (mayBeNear()) return VoxelEvent::OCCUPIED_AT_SEAM;
    if (!tellsFound()) return VoxelEvent::OCCUPIED_ALONE;
    return wasFound(cube.leaf) ? VoxelEvent::FOUND_ALONE : VoxelEvent::UNFOUND_ALONE;
  }
  VoxelEvent free(const ReachedCube& cube, const BodySet& owners) const {
    BodySet near = cube.near;
    near.removeIf([&](int body) { return not_yet.count(body) > 0; });
    if (near.empty() && !mayBeNear()) return VoxelEvent::FREE_ALONE;
    return owners.empty() ? VoxelEvent::FREE_WITH_OTHER : VoxelEvent::FREE_WITH_OWNER;
  }
  /// What the body's way reaches at most. False: it is nowhere, or not there yet.
  bool addBoxOf(const TrackedBody& body, const BodyWay& way);
  /// The cubes, and whether some body came near: one is enough.
  std::vector<ReachedCube> reached(const std::vector<OccupiedLeaf>& leaves, const std::vector<TrackedBody>& bodies,
                                   const std::vector<BodyWay>& ways) const;
  void ask(const OccupiedLeaf& leaf, ReachedCube::Why why, const BodySet& asked = {}) {
    cubes.push_back({leaf, why, leafBox(leaf, map.surface->resolution()), asked});
  }
};

}  // namespace dccd
