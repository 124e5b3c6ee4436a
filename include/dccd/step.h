// A step: all that its answer follows from, but the options.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "dccd/body.h"
#include "dccd/export.h"
#include "dccd/known_space.h"
#include "dccd/voxel_surface.h"

namespace dccd {

/// A finest voxel of a map that a tracked body accounts for.
struct OwnVoxel {
  VoxelKey key;
  std::uint16_t body = 0;
  bool doubted = false;  ///< body or obstacle, no look has told
};

/// What was taken out of a map since it is a body's own (doc/algorithm.md, "Own voxels").
struct OwnVoxels {
  std::uint64_t looked_at = 0;  ///< voxels near to bodies of which it was asked
  std::uint64_t own = 0, doubted = 0;
  std::string excluded, doubt;  ///< both in words; empty: there are none, or of doubted ones the step touches none
  // Not recorded.
  std::shared_ptr<const std::vector<OwnVoxel>> voxels{};  ///< for display; null: none
  std::shared_ptr<const VoxelSurface> doubted_surface{};  ///< of those in doubt; null: there are none
  /// Of these what the newest view of some sensor saw, with no body near, but not often enough for an obstacle, in four
  /// voxels or more that touch each other: distances are taken to it, too.
  std::shared_ptr<const std::vector<OccupiedLeaf>> seen{};  ///< null: none
};

/// The map of a step. None: surface null. Valid and empty: a surface without leaves.
struct ObstacleMap {
  std::shared_ptr<const VoxelSurface> surface;
  StampNs stamp_ns = 0;
  Eigen::Isometry3d map_from_fixed = Eigen::Isometry3d::Identity();  ///< when the step begins
  std::string frame_id;                                              ///< the name of its frame, for sentences
  std::string problem{};                                             ///< why there is none, for the reason of NO_MAP
  std::shared_ptr<const KnownSpace> known{};                         ///< what it has seen; null: it does not tell
  std::int64_t arrival_ns = 0;                                       ///< of its message, by any clock
  bool trusted = false;                                              ///< nothing of it is ever a body's own
  /// In the order in which maps came, whatever became of them: between two without a gap none is missing. 0: it is the
  /// one after the last.
  std::uint64_t number = 0;
  OwnVoxels own{};  ///< what was taken out of it
  /// Where its frame goes from there, as that of a body that turns: fixed_from_map, ascending, the last one where the
  /// step ends (u = 1). Empty: it stays.
  std::vector<Waypoint> way{};

  /// map_from_fixed at the fraction u of the step.
  DCCD_EXPORT Eigen::Isometry3d fromFixedAt(double u) const;
};

struct Step {
  std::vector<Body> bodies;
  ObstacleMap map;
  StampNs start_ns = 0, stamp_ns = 0;
  std::uint64_t sequence = 0;  ///< of the clock body's frames, from 1; 0: of no stream
  /// Turning bodies go from pose_t0 this many times as far as to pose_t1; t1 is where they end. Two poses alone tell no
  /// turn of more than a half, which predictions may be.
  double pose_scale = 1;
  std::string off_path;  ///< why the bodies' paths are not those that were seen, in words; empty: they are

  double duration_s() const { return secondsBetween(start_ns, stamp_ns); }
};

// --- contacts that a task brings about: they are found, listed, counted and marked like all others, and no alarm ---

/// One of the two that are expected to meet.
struct ExpectedPartner {
  std::uint16_t body = 0;       ///< index into the bodies; OBSTACLE_BODY: the map
  std::vector<Index> vertices;  ///< only features all of whose vertices are among these; empty: anywhere on the body
  std::string set;              ///< what these vertices are called, for people; empty: they have no name
  friend bool operator==(const ExpectedPartner& a, const ExpectedPartner& b) {
    return a.body == b.body && a.vertices == b.vertices && a.set == b.set;
  }
};

/// A contact is expected where everything of it that one expectation names is in that: one partner holds the one
/// feature, the other partner the other one. Which comes first has no meaning; the same body twice is one with itself.
struct Expectation {
  std::array<ExpectedPartner, 2> partners;
  std::string phase;  ///< of the task, for people; empty: in all of them
  friend bool operator==(const Expectation& a, const Expectation& b) {
    return a.partners == b.partners && a.phase == b.phase;
  }
};

/// A sentence for each: "cloth ('hem', 30 vertices) with finger in phase 'carry'".
DCCD_EXPORT std::vector<std::string> describe(const std::vector<Expectation>& expected,
                                              const std::vector<Body>& bodies);

}  // namespace dccd
