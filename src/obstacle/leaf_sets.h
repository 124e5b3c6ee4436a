// Cubes of voxels as sets: what of some is not in others.
#pragma once

#include <algorithm>
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

/// Whether some voxel of the cube is in the box, and whether all are.
inline bool meets(const OccupiedLeaf& cube, const KeyBox& box) {
  const std::int32_t lo[3] = {cube.min.x, cube.min.y, cube.min.z}, size = static_cast<std::int32_t>(cube.size);
  for (int a = 0; a < 3; ++a) {
    if (lo[a] > box.hi[a] || lo[a] + size <= box.lo[a]) return false;
  }
  return true;
}
inline bool isInside(const OccupiedLeaf& cube, const KeyBox& box) {
  const std::int32_t lo[3] = {cube.min.x, cube.min.y, cube.min.z}, size = static_cast<std::int32_t>(cube.size);
  for (int a = 0; a < 3; ++a) {
    if (lo[a] < box.lo[a] || lo[a] + size - 1 > box.hi[a]) return false;
  }
  return true;
}

/// Makes the box hold the other one, too.
inline void extend(KeyBox& box, const KeyBox& other) {
  for (std::size_t a = 0; a < 3; ++a) {
    box.lo[a] = std::min(box.lo[a], other.lo[a]);
    box.hi[a] = std::max(box.hi[a], other.hi[a]);
  }
}

/// Calls visit(voxel) for the finest voxels of a cube within the box.
template <class Visit>
void visitVoxels(const OccupiedLeaf& cube, const KeyBox& box, Visit& visit) {
  if (!meets(cube, box)) return;
  if (cube.size == 1) return visit(cube);
  for (const OccupiedLeaf& part : eighthsOf(cube)) visitVoxels(part, box, visit);
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

/// What the other tree has where a node of level 1 lies.
struct Beside {
  const VoxelTree::Node* node = nullptr;  ///< null: it is covered all alike
  bool covered = false;
};
inline Beside besideNode(const VoxelTree& tree, std::uint32_t index, const VoxelTree& other) {
  const std::array<std::uint16_t, 3>& at = tree.nodeCell(1, index);
  const std::uint32_t found = other.find(1, at[0], at[1], at[2]);
  if (found != VoxelTree::NONE) return {&other.nodes(1)[found], false};
  return {nullptr, other.coverage(16 * at[0], 16 * at[1], 16 * at[2], 16) == VoxelTree::Coverage::FULL};
}

/// All voxels that there are.
constexpr KeyBox ALL_KEYS{{0, 0, 0}, {VoxelTree::KEYS - 1, VoxelTree::KEYS - 1, VoxelTree::KEYS - 1}};

/// Calls visit(part) for what of the tree's leaves the other tree does not cover: voxels of small leaves, and of others
/// parts as large as there are. What does not meet the box may be left out.
template <class Visit>
void visitDifference(const VoxelTree& tree, const VoxelTree& other, Visit&& visit, const KeyBox& box = ALL_KEYS) {
  for (std::uint32_t p = 0; p < tree.nodes(1).size(); ++p) {
    const VoxelTree::Node& parent = tree.nodes(1)[p];
    const std::array<std::uint16_t, 3>& at = tree.nodeCell(1, p);
    const auto key_of = [&](std::size_t axis) { return static_cast<std::uint16_t>(16 * at[axis]); };
    if (!meets(OccupiedLeaf{{key_of(0), key_of(1), key_of(2)}, 16}, box)) continue;
    const Beside beside = besideNode(tree, p, other);
    if (beside.covered) continue;
    for (std::uint64_t children = parent.child; children != 0; children &= children - 1) {
      const unsigned block = lowestBit(children);
      std::uint64_t bits = tree.nodes(0)[parent.childAt(block)].full;
      if (beside.node && (beside.node->full >> block & 1)) continue;
      if (beside.node && (beside.node->child >> block & 1)) bits &= ~other.nodes(0)[beside.node->childAt(block)].full;
      for (; bits != 0; bits &= bits - 1) {
        const auto &of_block = CELL_COORDINATES[block], &of_voxel = CELL_COORDINATES[lowestBit(bits)];
        const auto key = [&](std::size_t axis) {
          return static_cast<std::uint16_t>(16 * at[axis] + 4 * of_block[axis] + of_voxel[axis]);
        };
        visit(OccupiedLeaf{{key(0), key(1), key(2)}, 1});
      }
    }
  }
  for (std::size_t leaf = tree.firstLeafOfLevel(1); leaf < tree.leaves().size(); ++leaf) {
    if (meets(tree.leaves()[leaf], box)) visitUncovered(other, tree.leaves()[leaf], visit);
  }
}

/// What of the tree's leaves no leaf of `without` covers, and the leaves of `more`, which have nothing in common with
/// that; in the order in which nextSurface() takes leaves fast.
inline std::vector<OccupiedLeaf> leavesWithout(const VoxelTree& tree, const VoxelTree& without,
                                               const std::vector<OccupiedLeaf>& more) {
  std::vector<OccupiedLeaf> left, parts = more;
  left.reserve(tree.leaves().size() + more.size());
  const auto cut = [&](const OccupiedLeaf& leaf) {
    visitUncovered(without, leaf, [&](const OccupiedLeaf& part) {
      (part.size == leaf.size || leaf.size == 2 ? left : parts).push_back(part);
    });
  };
  const auto& nodes = tree.nodes(0);
  for (std::uint32_t p = 0; p < tree.nodes(1).size(); ++p) {
    const VoxelTree::Node& parent = tree.nodes(1)[p];
    const Beside beside = besideNode(tree, p, without);
    for (std::uint64_t children = beside.covered ? 0 : parent.child; children != 0; children &= children - 1) {
      const unsigned block = lowestBit(children);
      const std::uint32_t n = parent.childAt(block);
      const auto first = tree.leaves().begin() + nodes[n].first_leaf;
      const auto end = tree.leaves().begin() + tree.leafEnd(n);
      if (beside.node && (beside.node->full >> block & 1)) continue;
      if (beside.node && (beside.node->child >> block & 1)) {
        std::for_each(first, end, cut);
      } else {
        left.insert(left.end(), first, end);
      }
    }
  }
  std::for_each(tree.leaves().begin() + tree.firstLeafOfLevel(1), tree.leaves().end(), cut);
  const auto isBefore = [](const OccupiedLeaf& a, const OccupiedLeaf& b) {
    const int level = VoxelTree::levelOfSize(a.size), other = VoxelTree::levelOfSize(b.size);
    if (level != other) return level < other;
    return codeOf(a) < codeOf(b);
  };
  if (parts.empty()) return left;
  std::sort(parts.begin(), parts.end(), isBefore);
  std::vector<OccupiedLeaf> all(left.size() + parts.size());
  std::merge(left.begin(), left.end(), parts.begin(), parts.end(), all.begin(), isBefore);
  return all;
}

}  // namespace dccd
