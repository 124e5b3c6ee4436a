// Which voxels of a map a tracked body accounts for: the sensor that made the map saw the body there, not an obstacle.
// The rule is the table of stream/voxel_states.h, voxel by voxel from one map to the next. Beside it:
// - What appears within reach and touches what grew from outside is in doubt (stream/growth.h). So is what is own
//   beside such a voxel, or one that came out of reach, a reach and a voxel deep, while maps show both: it may hold
//   more.
// - A voxel of a map that is trusted (octomap_file) is an obstacle.
// - Where a body is gone, nothing is its own any more.
// - A voxel in which the map's maker has seen something, but not often enough for an obstacle, is in doubt, unless a
//   body's surface was within own_voxels_m of it at that time. Seen so in two maps it was not free.
// What has no state here follows from the map before: what was occupied is an obstacle, what it showed as free is free,
// and of what it left out nothing is known.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include "dccd/step.h"
#include "stream/growth.h"
#include "stream/reach_search.h"
#include "stream/unseen_space.h"
#include "stream/voxel_states.h"

namespace dccd {

/// OwnVoxel::body where the map's maker doubts it. ObstacleMap::own.doubted_surface of a map that is given has these,
/// and `seen` those in which the newest view of some sensor saw something, be it more.
constexpr std::uint16_t NOBODY = 0xffff;

/// Not thread-safe.
class OwnVoxelFinder {
 public:
  /// The map without what is own or in doubt, with what is trusted (null: nothing), and both in words. `trusted` has
  /// the map's frame and resolution. Maps come in the order of their stamps. One of another frame or resolution, or
  /// whose frame moved, or after forget(), is a first one, and so is one after which more than MOST_REMEMBERED cubes
  /// would be remembered that it does not show. Where ObstacleMap::known does not tell, what is not occupied counts as
  /// free. Bodies are known at the map's stamp; trust_first: what is first seen with a body near is its own.
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
  /// A voxel that is OWN, LEFT, LEFT_SEEN or in DOUBT.
  struct Stated {
    VoxelKey key;
    VoxelState state;
    BodySet owners;       // of what is in doubt: who was near, for the sentence
    bool shown = true;    // the last map did
    bool grew = false;    // it came from outside of every reach: own voxels beside it may hold more of it
    StampNs left_ns = 0;  // since when it is LEFT or LEFT_SEEN
  };
  /// What a map's maker saw, not often enough for an obstacle, with nobody within reach: packed, and whether in more
  /// than one map. One is a sensor's noise where a body comes next; what was seen again is there, whoever comes.
  using SeenAlone = std::unordered_map<std::uint64_t, bool>;
  /// Of one map.
  struct Look;
  /// Bodies that were there, their ways up to it, and whether some other place of theirs was not known.
  struct PastLook {
    StampNs stamp_ns;
    std::vector<TrackedBody> bodies;
    std::vector<BodyWay> ways;
    bool may_be_near;
  };

  void endWhereItMoved(const ObstacleMap& map, const std::vector<TrackedBody>& bodies);
  std::vector<BodyWay> waysOf(const std::vector<TrackedBody>& bodies, StampNs stamp_ns, double lag_s) const;
  void findSeams(Look& look, const std::vector<TrackedBody>& bodies, double lag_s);
  void listChanges(Look& look);
  void listSeen(Look& look);
  void seeAlone(const OccupiedLeaf& voxel, Look& look);
  bool wasSeenAgain(const OccupiedLeaf& voxel) const;
  void appear(const ReachedCube& cube, Look& look);
  void follow(const ReachedCube& cube, Look& look);
  std::vector<OccupiedLeaf> unknownOf(std::vector<OccupiedLeaf> left_out, const Look& look) const;
  void listLeftOut(Look& look) const;
  void askUnseen(Look& look, const std::vector<TrackedBody>& there, const std::vector<BodyWay>& ways_there);
  void stateWhatAppeared(Look& look, const std::vector<TrackedBody>& bodies, const std::vector<BodyWay>& ways);
  std::vector<Growth::Seed> renewed(std::vector<Growth::Seed> grown, const Look& look) const;
  void listEntered(const Look& look, const std::vector<TrackedBody>& bodies, std::vector<OccupiedLeaf> from);
  /// Which maps came between the last one and this one, in words.
  std::string gapBefore(const ObstacleMap& map) const;
  /// The map without what is own or in doubt, with what is trusted.
  ObstacleMap withoutOwn(ObstacleMap map, const VoxelSurface* trusted, const std::vector<TrackedBody>& bodies,
                         bool trust_first);
  std::vector<OccupiedLeaf> seenInGroups(const std::vector<OccupiedLeaf>& seen_now) const;

  std::shared_ptr<const VoxelSurface> before_;      // as it was given; null: none
  std::shared_ptr<const KnownSpace> known_before_;  // null: what is not occupied there is free
  StampNs before_ns_ = 0, before_last_ns_ = 0;      // the stamps of the last two maps
  std::string frame_id_;
  Eigen::Isometry3d map_from_fixed_ = Eigen::Isometry3d::Identity();  // of the first map
  std::unordered_map<std::uint64_t, Stated> stated_;                  // by the voxel's packed key
  std::deque<PastLook> past_;                                         // of the last OWN_GAP_S, and the one before these
  UnseenSpace unseen_;
  Growth growth_;
  std::unordered_set<std::uint64_t> entered_;       // of the last map: OWN, packed, and in doubt in it
  std::unordered_set<std::uint64_t> entered_from_;  // of the last map: obstacles, packed, that came beside OWN
  std::vector<OccupiedLeaf> remembered_;            // obstacles that the last map did not show, nor showed as free
  std::map<std::uint16_t, StampNs> first_;          // of each body, its first frame that is known of
  std::map<std::uint16_t, std::shared_ptr<const MeshFrame>> last_frames_;  // of each, not after the last map
  std::set<std::uint16_t> known_;              // bodies whose way up to the last map was known
  RigidShapes shapes_;                         // of bodies that have been asked about
  std::vector<OccupiedLeaf> seen_;             // of the last map: in doubt for its maker
  SeenAlone seen_alone_;                       // of the last map
  std::weak_ptr<const VoxelSurface> reduced_;  // of the map before, if it is still there
  std::uint64_t number_ = 0;                   // ObstacleMap::number of the last map
  std::string why_lost_;                       // why one was lost since it, as far as somebody said so
  std::string gap_;                            // before the map that put some voxel in doubt; empty: none
};

}  // namespace dccd
