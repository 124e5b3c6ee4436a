// What grows into a body's reach from outside: it began where no body was.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <limits>
#include <unordered_set>
#include <vector>

#include "dccd/types.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_tree.h"

namespace dccd {

/// Not thread-safe.
class Growth {
 public:
  /// A voxel, and when it was last free.
  struct Seed {
    OccupiedLeaf voxel;
    StampNs free_ns;
  };
  void clear() {  // allocates nothing, unlike a new one
    grown_.clear();
    voxels_.clear();
    too_many_ns_ = NEVER_NS;
  }
  /// It appeared out of reach, or is in doubt. free_ns: when it was last free; now_ns: of the map that shows it so.
  void add(const OccupiedLeaf& cube, bool is_doubted, StampNs free_ns, StampNs now_ns);
  /// Forgets what was free no later than `since_ns`, or was not occupied ever since it was added. now, before: what
  /// this map and the one before it show.
  void keep(const VoxelTree& now, const VoxelTree& before, StampNs since_ns, StampNs now_ns);
  /// Of what is kept the voxels that touch (26 neighbours) one of these, by whether they are in doubt, and belong to at
  /// least GROUP that touch each other: one alone is a sensor's noise. keys: packed.
  std::vector<Seed> beside(const std::vector<std::uint64_t>& keys, bool is_doubted) const;
  /// Which of the voxels touch one of the seeds, or one that does, and when the newest of these seeds was free; all
  /// where some were not kept.
  std::vector<Seed> touched(const std::vector<std::uint64_t>& keys, std::vector<Seed> seeds) const;

  static constexpr std::size_t MOST = std::size_t{1} << 18, GROUP = 4;

 private:
  static constexpr StampNs NEVER_NS = std::numeric_limits<StampNs>::min();
  struct Grown {
    OccupiedLeaf cube;
    bool is_doubted;
    StampNs free_ns, added_ns;
  };
  std::deque<Grown> grown_;
  StampNs too_many_ns_ = NEVER_NS;            // of some that were not kept
  std::unordered_set<std::uint64_t> voxels_;  // of grown_, packed
};

/// Whether the voxel and others of these (packed) are Growth::GROUP or more that touch each other.
bool isOfGroup(const VoxelKey& voxel, const std::unordered_set<std::uint64_t>& voxels);

/// A voxel's key as one number.
inline std::uint64_t packed(const VoxelKey& key) {
  return std::uint64_t{key.x} << 32 | std::uint64_t{key.y} << 16 | std::uint64_t{key.z};
}
inline VoxelKey unpacked(std::uint64_t key) {
  return {static_cast<std::uint16_t>(key >> 32), static_cast<std::uint16_t>(key >> 16),
          static_cast<std::uint16_t>(key)};
}

/// The voxel and those around it, as far as there are keys.
inline KeyBox around(const VoxelKey& key) {
  const auto low = [](std::uint16_t k) { return std::max(0, k - 1); };
  const auto high = [](std::uint16_t k) { return std::min(VoxelTree::KEYS - 1, k + 1); };
  return {{low(key.x), low(key.y), low(key.z)}, {high(key.x), high(key.y), high(key.z)}};
}

/// Whether test(packed key) is true of the voxel or one around it; not asked on once it was.
template <class Test>
bool anyAround(const VoxelKey& key, const Test& test) {
  const KeyBox box = around(key);
  for (int x = box.lo[0]; x <= box.hi[0]; ++x) {
    for (int y = box.lo[1]; y <= box.hi[1]; ++y) {
      for (int z = box.lo[2]; z <= box.hi[2]; ++z) {
        if (test(packed({static_cast<std::uint16_t>(x), static_cast<std::uint16_t>(y), static_cast<std::uint16_t>(z)})))
          return true;
      }
    }
  }
  return false;
}

}  // namespace dccd
