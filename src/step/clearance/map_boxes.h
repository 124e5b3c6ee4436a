// The map's tree of occupied leaves as the search for distances wants it.
#pragma once

#include <cstdint>
#include <vector>

#include "obstacle/voxel_surface_impl.h"
#include "step/clearance/hull_pair.h"
#include "step/clearance/step_box.h"

namespace dccd {

class MapBoxes {
 public:
  /// A node of a level, or (LEAF_LEVEL) a leaf.
  static constexpr std::uint32_t LEAF_LEVEL = VoxelTree::LEVELS;
  static std::uint32_t name(std::uint32_t level, std::uint32_t index) { return level << 28 | index; }

  explicit MapBoxes(const VoxelSurface& surface) : map_(surface.impl()) {}
  bool empty() const { return map_.tree.leaves().empty(); }
  std::uint32_t root() const { return name(VoxelTree::LEVELS - 1, 0); }
  bool isLeaf(std::uint32_t node) const { return node >> 28 == LEAF_LEVEL; }
  const OccupiedLeaf& leaf(std::uint32_t node) const { return map_.tree.leaves()[node & 0x0fffffffu]; }
  LeafBox leafBox(std::uint32_t node) const { return dccd::leafBox(leaf(node), map_.resolution_m); }

  StepBox box(std::uint32_t node) const {
    if (isLeaf(node)) {
      const LeafBox cube = leafBox(node);
      return still(cube.lo, cube.hi);
    }
    const int level = static_cast<int>(node >> 28);
    const std::uint32_t index = node & 0x0fffffffu;
    const VoxelTree::Node& n = map_.tree.nodes(level)[index];
    const std::uint64_t cells = n.full | n.child;
    double lo[3], hi[3];
    for (int axis = 0; axis < 3; ++axis) {
      int first = 0, last = 3;
      while ((cells & RANGE_MASKS[axis][first][first]) == 0) ++first;
      while ((cells & RANGE_MASKS[axis][last][last]) == 0) --last;
      const std::int64_t origin = std::int64_t{map_.tree.nodeCell(level, index)[axis]} << (2 * (level + 1));
      lo[axis] = voxelPlane(origin + (std::int64_t{first} << (2 * level)), map_.resolution_m);
      hi[axis] = voxelPlane(origin + (std::int64_t{last + 1} << (2 * level)), map_.resolution_m);
    }
    return still(lo, hi);
  }

  template <class F>
  void forChildren(std::uint32_t node, F&& f) const {
    const std::uint32_t level = node >> 28;
    const VoxelTree::Node& n = map_.tree.nodes(static_cast<int>(level))[node & 0x0fffffffu];
    for (std::uint64_t leaves = n.start; leaves != 0; leaves &= leaves - 1) {
      f(name(LEAF_LEVEL, n.leafAt(lowestBit(leaves))));
    }
    for (std::uint64_t children = n.child; children != 0; children &= children - 1) {
      f(name(level - 1, n.childAt(lowestBit(children))));
    }
  }
  template <class F>
  void forItems(std::uint32_t leaf, F&& f) const {
    f(leaf);
  }
  StepBox itemBox(std::uint32_t leaf) const { return box(leaf); }
  MovingHull itemHull(std::uint32_t leaf) const {
    const LeafBox cube = leafBox(leaf);
    return MovingHull::box(cube.lo, cube.hi);
  }

 private:
  static StepBox still(const double* lo, const double* hi) {
    StepBox box;
    for (int end = 0; end < 2; ++end) {
      std::copy(lo, lo + 3, box.lo[end]);
      std::copy(hi, hi + 3, box.hi[end]);
    }
    return box;
  }

  const VoxelSurface::Impl& map_;
};

}  // namespace dccd
