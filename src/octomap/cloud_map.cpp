#include "dccd/cloud_map.h"

#include <cmath>
#include <sstream>
#include <unordered_map>
#include <vector>

#include <octomap/OcTree.h>

#include "octomap/leaf_lists.h"
#include "octomap/map_builder.h"

namespace dccd {
namespace {

using octomap::OcTreeKey;
using octomap::point3d;

// [bytes] As malloc hands them out: a node and its share of the list of its parent's children, of which there is one
// where a node has no sibling; a block of voxels among others.
constexpr std::size_t NODE_BYTES = 112, BLOCK_BYTES = 48;

/// Voxels, each once, as bits of blocks of 4^3: the rays of a camera go through the same ones again and again.
class VoxelSet {
 public:
  void add(const OcTreeKey& key) {
    const std::uint64_t block = (key[0] >> 2) | std::uint64_t(key[1] >> 2) << 16 | std::uint64_t(key[2] >> 2) << 32;
    Recent& recent = recent_[(block ^ block >> 12 ^ block >> 24) % RECENT];
    if (block != recent.block) recent = {block, &blocks_[block]};
    *recent.bits |= std::uint64_t{1} << cellBit(key[0], key[1], key[2]);
  }
  /// Calls visit(key) for each that is not in `without`.
  template <class Visit>
  void forEach(const VoxelSet& without, Visit visit) const {
    for (const auto& [block, all] : blocks_) {
      const auto other = without.blocks_.find(block);
      std::uint64_t bits = other == without.blocks_.end() ? all : all & ~other->second;
      for (; bits != 0; bits &= bits - 1) {
        const auto& cell = CELL_COORDINATES[lowestBit(bits)];
        const auto key = [&](int axis) {
          return static_cast<octomap::key_type>((block >> (16 * axis) & 0x3fff) << 2 | cell[axis]);
        };
        visit(OcTreeKey(key(0), key(1), key(2)));
      }
    }
  }
  std::size_t memoryBytes() const { return blocks_.size() * BLOCK_BYTES; }

 private:
  /// A block that was used lately, found without a search: the elements of an unordered_map do not move.
  struct Recent {
    std::uint64_t block = ~std::uint64_t{0};
    std::uint64_t* bits = nullptr;
  };
  static constexpr std::size_t RECENT = 4096;
  std::unordered_map<std::uint64_t, std::uint64_t> blocks_;
  std::vector<Recent> recent_ = std::vector<Recent>(RECENT);
};

point3d pointOf(const Vec3& p) {
  return {static_cast<float>(p.x()), static_cast<float>(p.y()), static_cast<float>(p.z())};
}

template <class Leaf>
void walk(const octomap::OcTree& tree, const octomap::OcTreeNode& node, const OctreeCube& cube, Leaf& leaf) {
  if (!tree.nodeHasChildren(&node)) return leaf(cube, tree.isNodeOccupied(node));
  for (unsigned i = 0; i < 8; ++i) {
    if (tree.nodeChildExists(&node, i)) walk(tree, *tree.getNodeChild(&node, i), cube.child(static_cast<int>(i)), leaf);
  }
}

}  // namespace

struct CloudMap::Impl {
  octomap::OcTree tree;
  float max_range_m;
  octomap::KeyRay ray;

  explicit Impl(const CloudMapOptions& options) : tree(options.resolution_m) {
    const double longest_m = MOST_RAY_VOXELS * options.resolution_m;
    max_range_m = static_cast<float>(options.max_range_m > 0 ? std::min(options.max_range_m, longest_m) : longest_m);
    tree.setProbHit(options.hit);
    tree.setProbMiss(options.miss);
    tree.setClampingThresMin(options.min);
    tree.setClampingThresMax(options.max);
  }

  /// False where the point lies outside of what a map can span. OctoMap's own call prints that, and casts doubles that
  /// no int can hold.
  bool keyOf(const point3d& point, OcTreeKey& key) const {
    const double half_span_m = 32769 * tree.getResolution();
    for (unsigned axis = 0; axis < 3; ++axis) {
      if (!(std::abs(point(axis)) < half_span_m)) return false;
    }
    return tree.coordToKeyChecked(point, key);
  }
};

CloudMap::CloudMap(const CloudMapOptions& options) : impl_(std::make_unique<Impl>(options)) {}
CloudMap::~CloudMap() = default;

std::size_t CloudMap::memoryBytes() const { return impl_->tree.size() * NODE_BYTES; }

std::vector<std::int8_t> CloudMap::serialized(bool binary) const { return dccd::serialized(impl_->tree, binary); }

void CloudMap::insert(const Vec3& sensor, const Positions& points, std::size_t max_bytes) {
  octomap::OcTree& tree = impl_->tree;
  const point3d origin = pointOf(sensor);
  OcTreeKey key;
  if (!impl_->keyOf(origin, key)) {
    std::ostringstream text;
    text << "the sensor is at (" << sensor.x() << ' ' << sensor.y() << ' ' << sensor.z()
         << ") m, beyond the 65536 voxels of " << tree.getResolution() << " m that a map can span";
    throw OctomapError(text.str());
  }
  VoxelSet free, occupied;
  const auto checkRoom = [&] {
    if (memoryBytes() + free.memoryBytes() + occupied.memoryBytes() <= max_bytes) return;
    throw OctomapError("the octree of all clouds needs more than the " + std::to_string(max_bytes >> 20) +
                       " MB that it may take");
  };
  for (const Vec3& p : points) {
    point3d end = pointOf(p);
    const bool in_range = (end - origin).norm() <= impl_->max_range_m;
    if (!in_range) end = origin + (end - origin).normalized() * impl_->max_range_m;
    if (!impl_->keyOf(end, key) || !tree.computeRayKeys(origin, end, impl_->ray)) continue;
    for (const OcTreeKey& passed : impl_->ray) free.add(passed);
    if (in_range) occupied.add(key);
    checkRoom();
  }
  const auto update = [&](bool is_occupied) {
    return [&, is_occupied](const OcTreeKey& voxel) {
      tree.updateNode(voxel, is_occupied);
      checkRoom();
    };
  };
  free.forEach(occupied, update(false));
  occupied.forEach({}, update(true));
}

DecodedOctomap CloudMap::leaves(const OctomapLimits& limits) const {
  const octomap::OcTree& tree = impl_->tree;
  DecodedOctomap map;
  map.resolution_m = tree.getResolution();
  map.id = tree.getTreeType();
  const auto walkAll = [&](auto&& leaf) {
    if (tree.getRoot()) walk(tree, *tree.getRoot(), OctreeCube(), leaf);
  };
  listLeaves(walkAll, limits, map);
  return map;
}

}  // namespace dccd
