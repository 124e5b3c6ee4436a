#include "node/map_memory.h"

#include <algorithm>
#include <string>

#include "base/map_limits.h"
#include "dccd/tolerances.h"

namespace dccd {
namespace {

using namespace tolerance;

/// [bytes] While it is built at most, and once it is.
struct Need {
  std::size_t most = 0, kept = 0;
};

std::size_t built(std::size_t leaves, std::size_t nodes) {
  return std::max<std::size_t>(leaves * MAP_LEAF_SORTING, leaves * MAP_LEAF_BUILDING + nodes * MAP_NODE_BUILDING);
}

Need needOf(const OctomapCounts& counts, bool with_known) {
  const std::size_t surface = counts.occupied * MAP_LEAF_IN_SURFACE + counts.occupied_nodes * MAP_NODE;
  if (!with_known) return {built(counts.occupied, counts.occupied_nodes), surface};
  const std::size_t all = counts.occupied + counts.free;
  const std::size_t known = all * MAP_LEAF_IN_TREE + counts.known_nodes * MAP_NODE;
  const std::size_t most = std::max<std::size_t>(counts.occupied * MAP_LEAF_LISTED + built(all, counts.known_nodes),
                                                 known + built(counts.occupied, counts.occupied_nodes));
  return {most, known + surface};
}

std::string inMegabytes(std::size_t bytes) { return std::to_string((bytes + (1 << 20) - 1) >> 20) + " MB"; }

}  // namespace

std::size_t MapMemory::accept(const OctomapCounts& counts) const {
  const bool clouds = config_.takesClouds();
  const std::size_t room = config_.max_map_bytes / 8 * (clouds ? 3 : 5), held = *held_;
  const Need need = needOf(counts, config_.needsKnownSpace());
  // The map in use and the one that follows. Where steps leave voxels out, also what remains of each of them.
  std::size_t least = need.most + 2 * need.kept;
  // Log-odds of this map and of the one before, and where it found something.
  if (config_.ownsVoxels()) least += counts.occupied * (3 * MAP_LEAF_LISTED + 2 * sizeof(float));
  const bool excludes = !config_.monitor.detector.exclude_boxes.empty();
  for (int copies = excludes + config_.ownsVoxels(); copies > 0; --copies) {
    least += built(counts.occupied, counts.occupied_nodes) + need.kept + MAX_ADDED_LEAVES * MAP_LEAF_ADDED;
  }
  if (clouds) least += built(counts.occupied, counts.occupied_nodes) + need.kept;  // with what was seen too seldom
  const std::size_t wanted = std::max(least, need.most + held);
  if (wanted <= room) return (room - wanted) / MAP_LEAF_ADDED;
  throw OctomapError("octomap data hold " + std::to_string(counts.occupied) + " occupied and " +
                     std::to_string(counts.free) + " free leaves, which need " + inMegabytes(wanted) +
                     " where there is room for " + inMegabytes(room) + (clouds ? ", three" : ", five") +
                     " eighths of max_map_mb " + inMegabytes(config_.max_map_bytes) +
                     (least <= room ? "; maps that are still held take " + inMegabytes(held) : ""));
}

}  // namespace dccd
