#include "dccd/cloud_map.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <sstream>
#include <unordered_map>
#include <utility>
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
  CloudMapOptions options;
  octomap::OcTree tree;
  double fill_m, clear_m;  // how far away points fill, and rays clear
  std::vector<OccupiedLeaf> doubtful;
  octomap::KeyRay ray;

  explicit Impl(const CloudMapOptions& of) : options(of), tree(of.resolution_m) {
    fill_m = options.max_range_m > 0 ? options.max_range_m : std::numeric_limits<double>::infinity();
    clear_m = std::min(fill_m, MOST_RAY_VOXELS * options.resolution_m);
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
const std::vector<OccupiedLeaf>& CloudMap::doubtful() const { return impl_->doubtful; }

std::vector<std::int8_t> CloudMap::serialized(bool binary) const { return dccd::serialized(impl_->tree, binary); }

SeenCounts CloudMap::insert(const SensorView& view, std::size_t max_bytes) {
  octomap::OcTree& tree = impl_->tree;
  const CloudMapOptions& options = impl_->options;
  const Vec3 sensor = view.map_from_sensor.translation();
  const point3d origin = pointOf(sensor);
  OcTreeKey key;
  const auto refuse = [&](const char* what, const Vec3& at) {
    std::ostringstream text;
    text << what << " (" << at.x() << ' ' << at.y() << ' ' << at.z() << ") m, beyond the 65536 voxels of "
         << tree.getResolution() << " m that a map can span";
    throw OctomapError(text.str());
  };
  if (!impl_->keyOf(origin, key)) refuse("the sensor is at", sensor);
  VoxelSet free, occupied;
  const auto checkRoom = [&] {
    if (memoryBytes() + free.memoryBytes() + occupied.memoryBytes() <= max_bytes) return;
    throw OctomapError("the octree of all clouds needs more than the " + std::to_string(max_bytes >> 20) +
                       " MB that it may take");
  };
  SeenCounts counts;
  counts.is_picture = view.depth_m != nullptr;
  counts.cleared = view.clears;
  counts.no_return_cleared = view.clears && options.no_return_clears && counts.is_picture;
  const auto isInBox = [&](const Vec3& p) {
    return !options.box ||
           ((p.array() >= options.box->min.array()).all() && (p.array() <= options.box->max.array()).all());
  };
  std::vector<Vec3> fills;
  std::vector<std::pair<Vec3, bool>> rays;
  for (std::size_t i = 0; i < view.width * view.height; ++i) {
    Vec3 p;
    if (view.depth_m) {
      const Pinhole& lens = view.pinhole;
      const double z = static_cast<double>(view.depth_m[i]);
      const Vec3 way((static_cast<double>(i % view.width) - lens.cx) / lens.fx,
                     (static_cast<double>(i / view.width) - lens.cy) / lens.fy, 1);
      if (!(z > 0)) {
        ++(z <= 0 && std::isfinite(z) ? counts.near : counts.nothing);
        continue;
      }
      if (std::isinf(z)) {
        ++counts.no_return;
        if (counts.no_return_cleared) rays.emplace_back(view.map_from_sensor * (way * (2 * impl_->clear_m)), false);
        continue;
      }
      p = way * z;
    } else {
      p = Vec3(view.xyz[3 * i], view.xyz[3 * i + 1], view.xyz[3 * i + 2]);
      if (!p.allFinite()) {
        ++(p.array().isInf().any() ? counts.no_return : counts.nothing);
        continue;
      }
    }
    const double depth = p.norm();
    if (p.isZero(0) || depth < options.min_range_m) {
      ++counts.near;
      continue;
    }
    const Vec3 at = view.map_from_sensor * p;
    const bool is_far = depth > impl_->fill_m, is_in = isInBox(at);
    ++(is_far ? counts.far : is_in ? counts.filled : counts.outside);
    if (!is_far && is_in) {
      if (!impl_->keyOf(pointOf(at), key)) refuse("a point lies at", at);
      fills.push_back(at);
    }
    rays.emplace_back(at, depth <= impl_->clear_m);
  }
  for (const Vec3& p : fills) {
    if (impl_->keyOf(pointOf(p), key)) occupied.add(key);
  }
  for (const auto& [to, ends] : rays) {
    if (!view.clears) break;
    const point3d end = ends ? pointOf(to) : pointOf(sensor + (to - sensor).normalized() * impl_->clear_m);
    if (!impl_->keyOf(end, key) || !tree.computeRayKeys(origin, end, impl_->ray)) continue;
    for (const OcTreeKey& passed : impl_->ray) free.add(passed);
    if (!ends) free.add(key);
    checkRoom();
  }
  std::vector<std::pair<std::uint64_t, OccupiedLeaf>> doubtful;
  for (const OccupiedLeaf& leaf : impl_->doubtful) doubtful.emplace_back(codeOf(leaf), leaf);
  const auto update = [&](bool is_occupied) {
    return [&, is_occupied](const OcTreeKey& voxel) {
      if (options.box &&
          !isInBox(Vec3(tree.keyToCoord(voxel[0]), tree.keyToCoord(voxel[1]), tree.keyToCoord(voxel[2]))))
        return;
      const octomap::OcTreeNode* node = tree.updateNode(voxel, is_occupied);
      const OccupiedLeaf leaf{{voxel[0], voxel[1], voxel[2]}, 1};
      const std::uint64_t code = codeOf(leaf);
      doubtful.erase(std::remove_if(doubtful.begin(), doubtful.end(), [&](const auto& d) { return d.first == code; }),
                     doubtful.end());
      if (is_occupied && !tree.isNodeOccupied(node)) doubtful.emplace_back(code, leaf);
      checkRoom();
    };
  };
  free.forEach(occupied, update(false));
  occupied.forEach({}, update(true));
  std::sort(doubtful.begin(), doubtful.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  impl_->doubtful.clear();
  for (const auto& [code, leaf] : doubtful) impl_->doubtful.push_back(leaf);
  return counts;
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
