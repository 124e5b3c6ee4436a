// What KnownSpace holds: the tree of all known leaves.
#pragma once

#include <optional>
#include <vector>

#include "dccd/known_space.h"
#include "obstacle/voxel_tree.h"

namespace dccd {

struct KnownSpace::Impl {
  static const VoxelTree& treeOf(const KnownSpace& known) { return known.impl_->tree; }

  Impl(double resolution, const std::vector<OccupiedLeaf>& leaves) : resolution_m(resolution), tree(leaves) {}

  double resolution_m;
  VoxelTree tree;
  std::optional<std::vector<OccupiedLeaf>> found;
};

}  // namespace dccd
