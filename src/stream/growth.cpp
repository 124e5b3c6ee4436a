#include "stream/growth.h"

#include <algorithm>
#include <unordered_set>

namespace dccd {

bool isOfGroup(const VoxelKey& voxel, const std::unordered_set<std::uint64_t>& voxels) {
  std::vector<std::uint64_t> group{packed(voxel)};
  for (std::size_t i = 0; i < group.size() && group.size() < Growth::GROUP; ++i) {
    anyAround(unpacked(group[i]), [&](std::uint64_t key) {
      const bool is_new = voxels.count(key) > 0 && std::find(group.begin(), group.end(), key) == group.end();
      if (is_new) group.push_back(key);
      return group.size() >= Growth::GROUP;
    });
  }
  return group.size() >= Growth::GROUP;
}

void Growth::add(const OccupiedLeaf& cube, bool is_doubted, StampNs free_ns, StampNs now_ns) {
  if (grown_.size() < MOST) return grown_.push_back({cube, is_doubted, free_ns, now_ns});
  too_many_ns_ = std::max(too_many_ns_, free_ns);
}

void Growth::keep(const VoxelTree& now, const VoxelTree& before, StampNs since_ns, StampNs now_ns) {
  const auto is_over = [&](const Grown& one) {
    constexpr VoxelTree::Coverage NONE = VoxelTree::Coverage::EMPTY;
    return one.free_ns <= since_ns || coverage(now, one.cube) == NONE ||
           (one.added_ns != now_ns && coverage(before, one.cube) == NONE);
  };
  grown_.erase(std::remove_if(grown_.begin(), grown_.end(), is_over), grown_.end());
  if (too_many_ns_ <= since_ns) too_many_ns_ = NEVER_NS;
  voxels_.clear();
  for (const Grown& one : grown_) {
    if (one.cube.size == 1) voxels_.insert(packed(one.cube.min));
  }
}

std::vector<Growth::Seed> Growth::beside(const std::vector<std::uint64_t>& keys, bool is_doubted) const {
  std::vector<Seed> found;
  if (keys.empty() || grown_.empty()) return found;
  KeyBox near = around(unpacked(keys.front()));
  for (const std::uint64_t key : keys) extend(near, around(unpacked(key)));
  const std::unordered_set<std::uint64_t> all(keys.begin(), keys.end());
  for (const Grown& one : grown_) {
    if (one.is_doubted != is_doubted) continue;
    auto take = [&](const OccupiedLeaf& voxel) {
      const bool touches = anyAround(voxel.min, [&](std::uint64_t key) { return all.count(key) > 0; });
      if (touches && (one.cube.size > 1 || isOfGroup(voxel.min, voxels_))) found.push_back({voxel, one.free_ns});
    };
    visitVoxels(one.cube, near, take);
  }
  return found;
}

std::vector<Growth::Seed> Growth::touched(const std::vector<std::uint64_t>& keys, std::vector<Seed> seeds) const {
  std::sort(seeds.begin(), seeds.end(), [](const Seed& a, const Seed& b) { return a.free_ns > b.free_ns; });
  std::vector<Seed> touched;
  if (too_many_ns_ != NEVER_NS) {
    const StampNs free_ns = seeds.empty() ? too_many_ns_ : std::max(too_many_ns_, seeds.front().free_ns);
    for (const std::uint64_t key : keys) touched.push_back({{unpacked(key), 1}, free_ns});
    return touched;
  }
  std::unordered_set<std::uint64_t> left(keys.begin(), keys.end());
  const auto takeAround = [&](Seed from) {
    anyAround(from.voxel.min, [&](std::uint64_t key) {
      if (left.erase(key) > 0) touched.push_back({{unpacked(key), 1}, from.free_ns});
      return false;
    });
  };
  std::size_t next = 0;
  for (const Seed& seed : seeds) {
    takeAround(seed);
    for (; next < touched.size(); ++next) takeAround(touched[next]);
  }
  return touched;
}

}  // namespace dccd
