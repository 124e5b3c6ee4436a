// Where a full octomap tells that its sensor found something since the map before.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "base/octomap_decode.h"
#include "dccd/types.h"

namespace dccd {

/// Not thread-safe.
class MapOdds {
 public:
  /// The occupied leaves whose log-odds rose since the map before, or stand at the most that both have; nothing where
  /// one of them does not tell, or they are no two of the same maker: another frame or resolution, or no later stamp.
  /// This map is then the one before.
  std::optional<std::vector<OccupiedLeaf>> foundIn(const DecodedOctomap& map, const std::string& frame_id,
                                                   StampNs stamp_ns);

 private:
  DecodedOctomap last_;  // what is occupied, with log-odds
  std::string frame_id_;
  StampNs stamp_ns_ = 0;
};

}  // namespace dccd
