// Which voxels of a map a tracked body accounts for: the sensor that made the map saw the body there, not an obstacle.
//
// The rule, voxel by voxel, from one map to the next:
// 1. A voxel of a map that is trusted (octomap_file) is an obstacle.
// 2. A voxel that was not occupied in the map before is own, if at some time between that map's stamp less the lag and
//    this one's a body's surface was within own_voxels_m of it, or its middle was inside of a closed rigid one (no
//    shell); else it is an obstacle.
// 3. An obstacle stays one as long as maps show it; also where it comes back after it vanished within reach of a body,
//    or without having been seen free.
// 4. What is own stays own until a map does not show it.
// 5. What the first map shows within reach, or one that is older than all that is known of the body, is in doubt: no
//    obstacle, but no proof either of a step that touches it, until a map does not show it, or shows it with no body in
//    reach, which makes it an obstacle. After maps that were not looked at all is in doubt that is not an obstacle.
// 6. Where a body is gone, nothing is its own any more.
// 7. A voxel in which the map's maker has seen something, but not often enough for an obstacle, is in doubt, unless a
//    body's surface was within own_voxels_m of it at that time.
#pragma once

#include <cstdint>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <vector>

#include "dccd/step.h"
#include "stream/reach_search.h"

namespace dccd {

/// OwnVoxel::body where a voxel is in doubt by (7). ObstacleMap::own.doubted_surface of a map that is given has these.
constexpr std::uint16_t NOBODY = 0xffff;

/// Not thread-safe.
class OwnVoxelFinder {
 public:
  /// The map without what is own or in doubt, with what is trusted (null: nothing), and both in words. `trusted` has
  /// the map's frame and resolution. Maps come in the order of their stamps; one of another
  /// frame or resolution, or after forget(), is a first one, and so is one after which more than MOST_REMEMBERED
  /// obstacles would be remembered. Where ObstacleMap::known does not tell, what is not
  /// occupied counts as free. Bodies are known at the map's stamp; trust_first: what is in doubt is own.
  ObstacleMap reduce(const ObstacleMap& map, const VoxelSurface* trusted, std::vector<TrackedBody> bodies, double lag_s,
                     bool trust_first);
  void forget();
  /// Why one that came is not given, for the sentence about the gap that it leaves.
  void say(const std::string& why) { why_lost_ = why; }
  /// Whether the body had own voxels of a map that reduce() came to the end of.
  bool forgetBody(std::uint16_t body);
  /// What reduce() made of the last map, by what is own now.
  ObstacleMap reducedAnew(const ObstacleMap& reduced, const VoxelSurface* trusted,
                          const std::vector<TrackedBody>& bodies, bool trust_first);
  /// For a map of this stamp, or a later one: since when the bodies' ways are needed.
  StampNs pathNeededFrom(StampNs now_ns, double lag_s) const;

  /// Larger: more memory, and time for each map, where maps forget what is far from their sensor. Smaller: a large map
  /// that was forgotten as a whole is not told from the bodies when it comes back.
  static constexpr std::size_t MOST_REMEMBERED = std::size_t{1} << 18;

 private:
  std::vector<BodyWay> waysOf(const std::vector<TrackedBody>& bodies, StampNs stamp_ns, double lag_s) const;
  std::vector<ReachedCube> cubesToAsk(const ObstacleMap& map, const VoxelTree& sure, const KeyBox& region);
  std::string missedBefore(const ObstacleMap& map) const;
  /// unknown_yet: bodies of which nothing is known as old as the map.
  void follow(const std::vector<ReachedCube>& cubes, const KnownSpace* known, bool trust_first,
              const std::set<int>& unknown_yet);
  /// The map without what is own or in doubt, with what is trusted.
  ObstacleMap withoutOwn(ObstacleMap map, const VoxelSurface* trusted, const std::vector<TrackedBody>& bodies,
                         bool trust_first);

  std::shared_ptr<const VoxelSurface> before_;  // as it was given; null: none
  StampNs before_ns_ = 0;
  std::string frame_id_;
  std::unordered_map<std::uint64_t, OwnVoxel> own_;  // by the voxel's packed key
  std::vector<OccupiedLeaf> remembered_;             // obstacles by (3) that the last map did not show
  RigidShapes shapes_;                               // of bodies that have been asked about
  std::vector<OccupiedLeaf> seen_;                   // by (7), of the last map
  std::weak_ptr<const VoxelSurface> reduced_;        // of the map before, if it is still there
  std::uint64_t number_ = 0;                         // ObstacleMap::number of the last map
  std::string why_lost_;                             // why one was lost since it, as far as somebody said so
  std::string missed_;         // which came before the map that is looked at, after the last one; empty: none
  std::string doubts_missed_;  // the same, where some doubt is for that reason
};

}  // namespace dccd
