// A step: all that its answer follows from, but the options.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "dccd/body.h"
#include "dccd/known_space.h"
#include "dccd/voxel_surface.h"

namespace dccd {

/// A finest voxel of a map that a tracked body accounts for.
struct OwnVoxel {
  VoxelKey key;
  std::uint16_t body = 0;
  bool doubted = false;  ///< it was there in the first map: body or obstacle, nobody can tell
};

/// What was taken out of a map since it is a body's own (doc/algorithm.md, "Own voxels").
struct OwnVoxels {
  std::uint64_t looked_at = 0;  ///< voxels near to bodies of which it was asked
  std::uint64_t own = 0, doubted = 0;
  std::string excluded, doubt;  ///< both in words; empty: there are none, or of doubted ones the step touches none
  // Not recorded.
  std::shared_ptr<const std::vector<OwnVoxel>> voxels{};  ///< for display; null: none
  std::shared_ptr<const VoxelSurface> doubted_surface{};  ///< of those in doubt; null: there are none
};

/// The map of a step. None: surface null. Valid and empty: a surface without leaves.
struct ObstacleMap {
  std::shared_ptr<const VoxelSurface> surface;
  StampNs stamp_ns = 0;
  Eigen::Isometry3d map_from_fixed = Eigen::Isometry3d::Identity();  ///< at the map's stamp, held for the whole step
  std::string frame_id;                                              ///< the name of its frame, for sentences
  std::string problem{};                                             ///< why there is none, for the reason of NO_MAP
  std::shared_ptr<const KnownSpace> known{};                         ///< what it has seen; null: it does not tell
  std::int64_t arrival_ns = 0;                                       ///< of its message, by any clock
  bool trusted = false;                                              ///< nothing of it is ever a body's own
  std::string missed{};  ///< why nobody looked at maps that came before it, or at it; empty: each was looked at
  OwnVoxels own{};       ///< what was taken out of it
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

}  // namespace dccd
