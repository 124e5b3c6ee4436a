// The map's tree of occupied leaves as the search for distances wants it: with boxes as tight as what is occupied.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "obstacle/voxel_surface_impl.h"
#include "step/clearance/hull_pair.h"
#include "step/clearance/step_box.h"

namespace dccd {

class DCCD_HIDDEN MapBoxes {
 public:
  /// Made once for each map.
  void set(std::shared_ptr<const VoxelSurface> surface);

  std::uint32_t root() const { return name(VoxelTree::LEVELS - 1, 0); }
  bool isLeaf(std::uint32_t node) const { return node >> 28 == LEAF_LEVEL; }
  StepBox box(std::uint32_t node) const { return isLeaf(node) ? itemBox(node) : boxes_[node >> 28][node & NUMBER]; }
  template <class F>
  void forChildren(std::uint32_t node, F&& f) const {
    const std::uint32_t level = node >> 28;
    const VoxelTree::Node& n = tree().nodes(static_cast<int>(level))[node & NUMBER];
    for (std::uint64_t leaves = n.start; leaves != 0; leaves &= leaves - 1) {
      f(name(LEAF_LEVEL, n.leafAt(lowestBit(leaves))));
    }
    for (std::uint64_t children = n.child; children != 0; children &= children - 1) {
      f(name(level - 1, n.childAt(lowestBit(children))));
    }
  }
  static constexpr std::uint32_t LEAF = 1;
  Reach itemReach(std::uint32_t item, const Turning& along) const { return itemBox(item).reach(along); }
  Reach leafReach(std::uint32_t leaf, const Turning& along) const { return itemReach(leaf, along); }
  std::uint32_t first(std::uint32_t leaf) const { return leaf; }
  std::uint32_t count(std::uint32_t) const { return 1; }

  const OccupiedLeaf& leaf(std::uint32_t item) const { return tree().leaves()[item & NUMBER]; }
  LeafBox leafBox(std::uint32_t item) const { return dccd::leafBox(leaf(item), surface_->resolution()); }
  StepBox itemBox(std::uint32_t item) const {
    const LeafBox cube = leafBox(item);
    return StepBox::still(cube.lo, cube.hi);
  }
  MovingHull itemHull(std::uint32_t item) const {
    const LeafBox cube = leafBox(item);
    return MovingHull::box(cube.lo, cube.hi);
  }

 private:
  // A node of a level, or a leaf: four bits for the level, 28 for its number there.
  static constexpr std::uint32_t LEAF_LEVEL = VoxelTree::LEVELS, NUMBER = 0x0fffffff;
  static std::uint32_t name(std::uint32_t level, std::uint32_t number) { return level << 28 | number; }
  const VoxelTree& tree() const { return VoxelSurface::Impl::of(*surface_).tree; }

  std::shared_ptr<const VoxelSurface> surface_;
  std::array<std::vector<StepBox>, VoxelTree::LEVELS> boxes_;
};

}  // namespace dccd
