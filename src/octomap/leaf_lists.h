// The leaves of an octree, wherever it comes from, as lists: counted first, so that what is too much is known before
// anything is allocated.
#pragma once

#include <cstdint>
#include <string>

#include "base/octomap_decode.h"
#include "obstacle/voxel_bits.h"
#include "obstacle/voxel_tree.h"

namespace dccd {

/// A cube of the octree: its smallest key, that key's Morton code, and its depth, the root's being 0.
struct OctreeCube {
  std::uint32_t x = 0, y = 0, z = 0;
  int depth = 0;
  std::uint64_t code = 0;
  std::uint32_t size() const { return 65536u >> depth; }
  /// The first code behind those of its voxels.
  std::uint64_t end() const { return code + (std::uint64_t{1} << 3 * (16 - depth)); }
  OctreeCube child(unsigned index) const {
    const std::uint32_t half = size() / 2;
    return {x + (index & 1 ? half : 0), y + (index & 2 ? half : 0), z + (index & 4 ? half : 0), depth + 1,
            code + (std::uint64_t{index} << 3 * (15 - depth))};
  }
  bool holds(const OccupiedLeaf& leaf) const {
    return ((leaf.min.x ^ x) | (leaf.min.y ^ y) | (leaf.min.z ^ z)) >> (16 - depth) == 0;
  }
  OccupiedLeaf leaf() const {
    return {{static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), static_cast<std::uint16_t>(z)}, size()};
  }
};

/// How many nodes a VoxelTree of leaves has that come in Morton order: a block of 4^(level + 1) voxels a side is one
/// where a smaller leaf lies in it, and such leaves follow each other.
class NodeCounter {
 public:
  void add(const OccupiedLeaf& leaf) {
    const int own = VoxelTree::levelOfSize(leaf.size);
    for (int level = own; level < VoxelTree::LEVELS; ++level) {
      if (level >= last_level_ && shareNode(leaf, last_, level)) break;  // and so it is with those above
      ++count_;
    }
    last_ = leaf;
    last_level_ = own;
  }
  std::size_t count() const { return count_; }

 private:
  OccupiedLeaf last_;
  int last_level_ = VoxelTree::LEVELS;  // of no leaf
  std::size_t count_ = 0;
};

/// Throws OctomapError for a map that is too large.
inline void checkLimits(const OctomapCounts& counts, const OctomapLimits& limits) {
  if (counts.occupied + counts.free > limits.max_leaves) {
    throw OctomapError("octomap data hold " + std::to_string(counts.occupied + counts.free) +
                       " leaves, more than the limit of " + std::to_string(limits.max_leaves));
  }
  if (limits.accept) limits.accept(counts);
}

/// `walk(leaf)` calls leaf(cube, log_odds) for each leaf in Morton order, the same each time. A log-odds of 0 or more
/// is occupied. Throws OctomapError where the limits are exceeded.
template <class Walk>
void listLeaves(const Walk& walk, const OctomapLimits& limits, bool has_log_odds, DecodedOctomap& map) {
  OctomapCounts counts;
  NodeCounter occupied_nodes, known_nodes;
  walk([&](const OctreeCube& cube, float log_odds) {
    const bool occupied = log_odds >= 0;
    ++(occupied ? counts.occupied : counts.free);
    if (occupied) occupied_nodes.add(cube.leaf());
    known_nodes.add(cube.leaf());
  });
  counts.occupied_nodes = occupied_nodes.count();
  counts.known_nodes = known_nodes.count();
  checkLimits(counts, limits);
  map.occupied.reserve(counts.occupied);
  if (limits.free_leaves) map.free.reserve(counts.free);
  const bool keeps_odds = limits.log_odds && has_log_odds;
  if (keeps_odds) map.log_odds.reserve(counts.occupied);
  walk([&](const OctreeCube& cube, float log_odds) {
    const bool occupied = log_odds >= 0;
    if (occupied && keeps_odds) map.log_odds.push_back(log_odds);
    if (occupied || limits.free_leaves) (occupied ? map.occupied : map.free).push_back(cube.leaf());
  });
}

}  // namespace dccd
