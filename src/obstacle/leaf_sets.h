// Cubes of voxels as sets: what of some is not in others.
#pragma once

#include <array>
#include <vector>

#include "dccd/voxel_surface.h"
#include "obstacle/voxel_tree.h"

namespace dccd {

/// The eight cubes of half its size that a cube of more than one voxel consists of.
inline std::array<OccupiedLeaf, 8> eighthsOf(const OccupiedLeaf& cube) {
  std::array<OccupiedLeaf, 8> parts;
  const std::uint32_t half = cube.size / 2;
  for (std::uint32_t i = 0; i < 8; ++i) {
    parts[i].size = half;
    parts[i].min.x = static_cast<std::uint16_t>(cube.min.x + (i & 1) * half);
    parts[i].min.y = static_cast<std::uint16_t>(cube.min.y + (i >> 1 & 1) * half);
    parts[i].min.z = static_cast<std::uint16_t>(cube.min.z + (i >> 2) * half);
  }
  return parts;
}

inline VoxelTree::Coverage coverage(const VoxelTree& tree, const OccupiedLeaf& cube) {
  return tree.coverage(cube.min.x, cube.min.y, cube.min.z, static_cast<std::int32_t>(cube.size));
}

/// Calls visit(part) for the parts of a cube that no leaf of the tree covers, as large ones as there are.
template <class Visit>
void visitUncovered(const VoxelTree& tree, const OccupiedLeaf& cube, Visit&& visit) {
  const VoxelTree::Coverage covered = coverage(tree, cube);
  if (covered == VoxelTree::Coverage::FULL) return;
  if (covered == VoxelTree::Coverage::EMPTY) {
    visit(cube);
  } else {
    for (const OccupiedLeaf& part : eighthsOf(cube)) visitUncovered(tree, part, visit);
  }
}

/// What of the leaves no leaf of the tree covers.
inline std::vector<OccupiedLeaf> leavesWithout(const std::vector<OccupiedLeaf>& leaves, const VoxelTree& tree) {
  std::vector<OccupiedLeaf> left;
  left.reserve(leaves.size());
  for (const OccupiedLeaf& leaf : leaves) {
    visitUncovered(tree, leaf, [&](const OccupiedLeaf& part) { left.push_back(part); });
  }
  return left;
}

}  // namespace dccd
