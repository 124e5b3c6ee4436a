#include "base/cloud_map.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <string>

#include "dccd/tolerances.h"
#include "octomap/leaf_lists.h"
#include "octomap/map_builder.h"
#include "octomap/octree_update.h"
#include "octomap/view_reading.h"

namespace dccd {
namespace {

// [bytes] As malloc hands it out: a node and its share of the list of its parent's children, of which there is one
// where a node has no sibling; and of two lists of leaves, as long as one is made of the other.
constexpr std::size_t NODE_BYTES = 112 + 2 * (sizeof(OccupiedLeaf) + 1);
constexpr std::size_t MORE_NODES = 256;  // than UpdateLimits say, at most

OctomapCounts countsOf(const TreeLeaves& leaves, bool with_free) {
  OctomapCounts counts{leaves.occupied.size(), leaves.free.size()};
  NodeCounter occupied, known;
  for (const OccupiedLeaf& leaf : leaves.occupied) occupied.add(leaf);
  counts.occupied_nodes = occupied.count();
  auto one = leaves.occupied.begin(), other = leaves.free.begin();
  while (with_free && (one != leaves.occupied.end() || other != leaves.free.end())) {
    const bool is_one = other == leaves.free.end() || (one != leaves.occupied.end() && codeOf(*one) < codeOf(*other));
    known.add(is_one ? *one++ : *other++);
  }
  counts.known_nodes = known.count();
  return counts;
}

[[noreturn]] void noRoom(std::size_t max_bytes) {
  throw OctomapError("the octree of all clouds needs more than the " + std::to_string(max_bytes >> 20) +
                     " MB that it may take");
}

/// Where nothing is cleared.
struct Blind {
  Seen look(const OctreeCube&) const { return Seen::NONE; }
  bool crosses(const OctreeCube&) const { return false; }
};

}  // namespace

struct CloudMap::Impl {
  CloudTree tree;
  ViewLimits limits;
  KeyBox box;
  TreeLeaves leaves, next_leaves;
  ViewReader reader;

  explicit Impl(const CloudMapOptions& options) : tree(options.resolution_m) {
    tree.setProbHit(tolerance::MAP_HIT);
    tree.setProbMiss(tolerance::MAP_MISS);
    tree.setClampingThresMin(tolerance::MAP_LEAST);
    tree.setClampingThresMax(tolerance::MAP_MOST);
    limits.resolution_m = options.resolution_m;
    limits.voxels_per_m = 1 / options.resolution_m;
    limits.near_m = options.min_range_m;
    limits.fill_m = options.max_range_m > 0 ? options.max_range_m : std::numeric_limits<double>::infinity();
    limits.clear_m = std::min(limits.fill_m, MOST_RAY_VOXELS * options.resolution_m);
    limits.no_return_clears = options.no_return_clears;
    limits.lo.setConstant(-std::numeric_limits<double>::infinity());
    limits.hi = -limits.lo;
    if (options.box) {
      constexpr double ROUNDING = 1e-6;  // a box's sides are often planes of the grid
      limits.lo = (limits.voxels(options.box->min).array() + ROUNDING).floor();
      limits.hi = (limits.voxels(options.box->max).array() - ROUNDING).ceil();
    }
    for (int axis = 0; axis < 3; ++axis) {
      box.lo[axis] = static_cast<std::int32_t>(std::clamp(limits.lo[axis], 0.0, 65536.0));
      box.hi[axis] = static_cast<std::int32_t>(std::clamp(limits.hi[axis], 0.0, 65536.0)) - 1;
    }
  }

  template <class Look>
  void update(Look& look, std::size_t max_bytes) {
    const std::size_t taken = reader.memoryBytes() + MORE_NODES * NODE_BYTES;
    const std::size_t nodes = max_bytes > taken ? (max_bytes - taken) / NODE_BYTES : 0;
    next_leaves.clear();
    OctreeUpdate<Look> update(tree, leaves, reader.ends, look, {box, nodes}, next_leaves);
    update.run();
    std::swap(leaves, next_leaves);
    if (update.isFull()) noRoom(max_bytes);
  }
};

CloudMap::CloudMap(const CloudMapOptions& options) : impl_(std::make_unique<Impl>(options)) {}
CloudMap::~CloudMap() = default;

std::size_t CloudMap::memoryBytes() const { return impl_->tree.size() * NODE_BYTES + impl_->reader.memoryBytes(); }

const std::vector<OccupiedLeaf>& CloudMap::doubtful() const { return impl_->leaves.doubtful; }

std::vector<OccupiedLeaf> CloudMap::doubtfulNow() const {
  const std::vector<OccupiedLeaf>&doubtful = impl_->leaves.doubtful, &found = impl_->leaves.found;
  std::vector<OccupiedLeaf> now;
  const auto isBefore = [](const OccupiedLeaf& a, const OccupiedLeaf& b) { return codeOf(a) < codeOf(b); };
  std::set_intersection(doubtful.begin(), doubtful.end(), found.begin(), found.end(), std::back_inserter(now),
                        isBefore);
  return now;
}

std::vector<std::int8_t> CloudMap::serialized(bool binary) const { return dccd::serialized(impl_->tree, binary); }

SeenCounts CloudMap::insert(const SensorView& view, std::size_t max_bytes) {
  const SeenCounts counts = impl_->reader.read(view, impl_->limits, max_bytes / 2);
  if (counts.cleared && !counts.is_picture && impl_->reader.rays.isFull()) noRoom(max_bytes);
  Blind blind;
  if (!counts.cleared) {
    impl_->update(blind, max_bytes);
  } else if (counts.is_picture) {
    impl_->update(impl_->reader.picture, max_bytes);
  } else {
    impl_->update(impl_->reader.rays, max_bytes);
  }
  return counts;
}

DecodedOctomap CloudMap::leaves(const OctomapLimits& limits) const {
  DecodedOctomap map;
  map.resolution_m = impl_->tree.getResolution();
  map.id = impl_->tree.getTreeType();
  const TreeLeaves& leaves = impl_->leaves;
  checkLimits(countsOf(leaves, limits.free_leaves), limits);
  map.occupied = leaves.occupied;
  if (limits.free_leaves) map.free = leaves.free;
  if (limits.log_odds) map.found = leaves.found;
  return map;
}

}  // namespace dccd
