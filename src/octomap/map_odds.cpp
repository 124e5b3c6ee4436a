#include "octomap/map_odds.h"

#include <algorithm>
#include <utility>

#include "dccd/voxel_surface.h"
#include "obstacle/voxel_tree.h"

namespace dccd {
namespace {

float mostOf(const std::vector<float>& odds) { return odds.empty() ? 0 : *std::max_element(odds.begin(), odds.end()); }

std::uint64_t endOf(const OccupiedLeaf& leaf) {
  return codeOf(leaf) + std::uint64_t{leaf.size} * leaf.size * leaf.size;
}

}  // namespace

std::optional<std::vector<OccupiedLeaf>> MapOdds::foundIn(const DecodedOctomap& map, const std::string& frame_id,
                                                          StampNs stamp_ns) {
  const bool follows = !map.log_odds.empty() && !last_.log_odds.empty() && stamp_ns > stamp_ns_ &&
                       frame_id == frame_id_ && map.resolution_m == last_.resolution_m;
  std::vector<OccupiedLeaf> found;
  const float most = mostOf(map.log_odds), most_before = mostOf(last_.log_odds);
  std::size_t b = 0;
  for (std::size_t i = 0; follows && i < map.occupied.size(); ++i) {
    const OccupiedLeaf& leaf = map.occupied[i];
    const std::uint64_t code = codeOf(leaf);
    while (b < last_.occupied.size() && endOf(last_.occupied[b]) <= code) ++b;
    // Of what was divided, or is, each part had or has values of its own: only the most tells of all of them.
    const bool was_there = b < last_.occupied.size() && codeOf(last_.occupied[b]) < endOf(leaf);
    const bool was_it = was_there && last_.occupied[b].size >= leaf.size;
    const bool rose = !was_there || (was_it && map.log_odds[i] > last_.log_odds[b]);
    if (rose || (map.log_odds[i] == most && most == most_before)) found.push_back(leaf);
  }
  last_.occupied = map.occupied;
  last_.log_odds = map.log_odds;
  last_.resolution_m = map.resolution_m;
  frame_id_ = frame_id;
  stamp_ns_ = stamp_ns;
  if (!follows) return std::nullopt;
  return found;
}

}  // namespace dccd
