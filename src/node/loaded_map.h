// A map on its way from its message to its place.
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dccd/step.h"

namespace dccd {

/// Clouds of one source that came and are not in the map, or in part: the octree is as if the sensor had not looked.
struct MissedClouds {
  std::uint64_t count = 0;
  std::string newest{};  ///< why it is not
};

/// A decoded map in its own frame: map_from_fixed is not known yet. An empty frame_id is the fixed frame; without a
/// stamp the latest transform is taken. One that is trusted, octomap_file's, is used together with a live one.
struct LoadedMap : ObstacleMap {
  std::string hint;                    ///< what looks like a mistake in what it was made of; empty: nothing does
  std::string slow;                    ///< that its making takes too long, and what to do; empty: it does not
  StampNs receipt_ns = 0;              ///< when what it was made of came, by the clock of stamps; 0: nobody knows
  bool is_late = false;                ///< a map with a later stamp came before it
  std::vector<MissedClouds> missed{};  ///< by MonitorConfig::clouds, since the start; empty: it does not tell
  StampNs first_ns = 0;                ///< the earliest stamp of the clouds that it is made of; 0: of none
  /// Of the clouds that it is made of: the frames by which they were placed, and TransformFeed::staticSince() then.
  std::map<std::string, std::uint64_t> placed_by{};
};

}  // namespace dccd
