// A sparse tree of 64-way nodes over cubes of voxels. Level 0 nodes have 4 voxels a side, level l nodes 4^(l+1); a leaf
// is a run of bits of one node, so pruned leaves of any power-of-two size cost what a single voxel costs.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "dccd/voxel_surface.h"
#include "obstacle/voxel_bits.h"

namespace dccd {

/// A closed range of voxel keys, each within 0 to 65535.
struct KeyBox {
  std::array<std::int32_t, 3> lo{0, 0, 0};
  std::array<std::int32_t, 3> hi{-1, -1, -1};
};

/// In the order of these codes the leaves of a node follow each other.
inline std::uint64_t codeOf(const OccupiedLeaf& leaf) { return mortonCode(leaf.min.x, leaf.min.y, leaf.min.z); }

/// Whether both lie in the same node of the level. Most leaves follow one of which that is so, and need no code.
inline bool shareNode(const OccupiedLeaf& a, const OccupiedLeaf& b, int level) {
  return ((a.min.x ^ b.min.x) | (a.min.y ^ b.min.y) | (a.min.z ^ b.min.z)) >> (2 * (level + 1)) == 0;
}

class VoxelTree {
 public:
  static constexpr int LEVELS = 8;
  /// The level whose nodes have leaves of this size: 4^level or 2 * 4^level; the root leaf fills a root node.
  static int levelOfSize(std::uint32_t size) { return std::min(static_cast<int>(lowestBit(size)) / 2, LEVELS - 1); }
  static constexpr std::int32_t KEYS = 65536;
  static constexpr std::uint32_t NONE = 0xffffffffu;

  struct Node {
    std::uint64_t full = 0;     ///< cells covered by a leaf of this node
    std::uint64_t start = 0;    ///< first cell of each of those leaves
    std::uint64_t child = 0;    ///< cells that are a node of the level below
    std::uint64_t edges = 0;    ///< cells at which, or in whose node, a convex edge of their leaf may lie
    std::uint64_t corners = 0;  ///< the same of its exposed corners
    std::uint32_t first_leaf = 0;
    std::uint32_t first_child = 0;
    std::uint32_t leafAt(unsigned bit) const {
      return first_leaf + bitCount(start & ((std::uint64_t{2} << bit) - 1)) - 1;
    }
    std::uint32_t childAt(unsigned bit) const { return first_child + rankBelow(child, bit); }
  };

  enum class Coverage : std::uint8_t { EMPTY, PARTIAL, FULL };

  /// Leaves may come in any order. Throws std::invalid_argument naming the leaf when a size is no power of two up to
  /// 65536, a key is no multiple of its size, or two leaves overlap.
  explicit VoxelTree(const std::vector<OccupiedLeaf>& leaves);

  /// How a tree differs from one before it. What it has in common with that keeps its edges and corners.
  struct Change {
    struct Block {
      std::array<std::uint16_t, 3> cell;  ///< of a node of level 0, in units of the node
      std::uint64_t voxels;               ///< those that are occupied by its small leaves in one of the two trees alone
      std::uint32_t node;                 ///< in this tree; or NONE
      std::uint32_t before;               ///< in the tree before: it, or where it is new the node that comes next
      bool is_new;
    };
    std::vector<Block> blocks;                ///< with other small leaves
    std::vector<std::uint32_t> large_before;  ///< of each leaf of the levels above, the same leaf; or NONE
    std::vector<OccupiedLeaf> large;          ///< larger leaves that only one of the two has
  };
  /// The same tree, made of the one before it, where the leaves come in Morton order as a decoded map's do: then they
  /// are taken. Where they do not, or cannot make a tree: nothing.
  static std::optional<VoxelTree> following(std::vector<OccupiedLeaf>& leaves, const VoxelTree& before, Change& change);

  /// In the tree's order: by level, then by Morton code.
  const std::vector<OccupiedLeaf>& leaves() const { return leaves_; }
  const std::vector<Node>& nodes(int level) const { return levels_[level].nodes; }
  /// Where convex edges and corners of the node's own leaves lie, for queries that want nothing else.
  void setFeatureCells(int level, std::uint32_t node, std::uint64_t edges, std::uint64_t corners);
  /// The same of one cell.
  void setFeatureCell(std::uint32_t node, unsigned bit, bool edge, bool corner);
  /// Once they are set for all nodes: tells the nodes above.
  void raiseFeatureCells();
  /// Keys of what is occupied, the upper ones exclusive. False: nothing is.
  bool occupiedKeys(std::array<std::int32_t, 3>& lo, std::array<std::int32_t, 3>& hi) const;
  /// Node coordinates, in units of the node's own size.
  const std::array<std::uint16_t, 3>& nodeCell(int level, std::uint32_t node) const {
    return levels_[level].cells[node];
  }
  std::uint32_t firstLeafOfLevel(int level) const { return first_leaf_of_level_[level]; }
  /// Leaves of a node of level 0: from its first one on, up to this.
  std::uint32_t leafEnd(std::uint32_t node) const {
    return node + 1 < levels_[0].nodes.size() ? levels_[0].nodes[node + 1].first_leaf : first_leaf_of_level_[1];
  }
  std::size_t memoryBytes() const;

  /// The node of `level` >= 1 with these node coordinates, or NONE. Out of range coordinates give NONE.
  std::uint32_t find(int level, std::int32_t x, std::int32_t y, std::int32_t z) const;

  /// How far the aligned cube of `size` (a power of two) voxels with smallest key (x, y, z) is occupied.
  Coverage coverage(std::int32_t x, std::int32_t y, std::int32_t z, std::int32_t size) const;

  /// Calls visit(leaf index) once for every leaf with a voxel in the box, in an order fixed by the tree, as long as it
  /// returns true.
  template <class Visit>
  void visitLeaves(const KeyBox& box, Visit&& visit) const;
  /// Only those with a cell of theirs in the box that may hold a convex edge, or a corner.
  template <class Visit>
  void visitLeavesWithEdges(const KeyBox& box, Visit&& visit) const;
  template <class Visit>
  void visitLeavesWithCorners(const KeyBox& box, Visit&& visit) const;

  /// What the box reaches.
  struct Reached {
    bool leaf = false, edge = false, corner = false;
  };
  Reached reached(const KeyBox& box) const;
  /// Does it span less than a node of level 1 along each axis?
  static bool isSmall(const KeyBox& box) {
    return box.hi[0] - box.lo[0] < 16 && box.hi[1] - box.lo[1] < 16 && box.hi[2] - box.lo[2] < 16;
  }
  bool reachesLeaf(const KeyBox& box) const;

 private:
  VoxelTree() = default;
  struct Level {
    std::vector<Node> nodes;
    std::vector<std::array<std::uint16_t, 3>> cells;
    std::vector<std::uint32_t> table;  ///< open addressing; NONE where free; empty on level 0
    int table_shift = 0;
  };

  // voxel_tree_following.cpp
  bool takeLevels(std::vector<OccupiedLeaf>& leaves, bool small);
  std::uint32_t commonBlocks(const VoxelTree& before, std::uint32_t node, std::uint32_t& leaf) const;
  bool followBlocks(const VoxelTree& before, Change& change, std::vector<std::uint64_t>& prefixes);
  void placeBlocks(const VoxelTree& before, const std::vector<Node>& changed, const Change& change);
  bool followLarge(const VoxelTree& before, Change& change) const;

  /// False, and nothing is taken, where leaves do not come in Morton order, as a decoded map's do.
  bool takeSorted(const std::vector<OccupiedLeaf>& leaves);
  /// counts: of the leaves of each level.
  void setLevels(const std::array<std::uint32_t, LEVELS>& counts);
  /// Sorts them by level, in their order; once the levels are set.
  void takeByLevel(const std::vector<OccupiedLeaf>& leaves);
  std::size_t countNodes(int level, const std::vector<std::uint64_t>& prefixes) const;
  void buildLevel(int level, std::vector<std::uint64_t>& prefixes);
  void buildTable(Level& level);

  /// Calls visit(leaf) for each leaf whose cells are in the box and in `wanted` of their node.
  template <class Wanted, class Visit>
  void visitWanted(const KeyBox& box, Wanted wanted, Visit& visit) const;
  /// Calls visit(node, bits) for each node with leaves in the box, bits being their cells there, until it returns true.
  /// Of each node it looks only at the cells in visit.wanted(node).
  template <class Visit>
  bool visitNodes(const KeyBox& box, Visit&& visit) const;
  template <class Visit>
  bool descend(int level, const Node& node, const std::array<std::int32_t, 3>& origin, const KeyBox& box,
               Visit& visit) const;
  /// The same of a node of level 1, which the box must reach, without recursion.
  template <class Visit>
  bool visitSmall(const Node& node, const std::array<std::int32_t, 3>& origin, const KeyBox& box, Visit& visit) const;
  /// The node's cells that the box reaches, each side clipped.
  static std::uint64_t boxBits(int level, const std::array<std::int32_t, 3>& origin, const KeyBox& box);

  static std::size_t hash(std::uint64_t packed, int shift) {
    return static_cast<std::size_t>(packed * 0x9e3779b97f4a7c15u >> shift);
  }
  static std::uint64_t pack(std::uint32_t x, std::uint32_t y, std::uint32_t z) {
    return std::uint64_t{x} << 32 | std::uint64_t{y} << 16 | z;
  }

  std::array<Level, LEVELS> levels_;
  std::array<std::uint32_t, LEVELS + 1> first_leaf_of_level_{};
  std::uint32_t levels_with_leaves_ = 0;  ///< bit l: some leaf belongs to level l
  std::vector<OccupiedLeaf> leaves_;
};

inline void VoxelTree::setFeatureCell(std::uint32_t node, unsigned bit, bool edge, bool corner) {
  Node& n = levels_[0].nodes[node];
  const std::uint64_t others = ~(std::uint64_t{1} << bit);
  n.edges = (n.edges & others) | std::uint64_t{edge} << bit;
  n.corners = (n.corners & others) | std::uint64_t{corner} << bit;
}

inline std::uint32_t VoxelTree::find(int level, std::int32_t x, std::int32_t y, std::int32_t z) const {
  const Level& l = levels_[level];
  if (l.table.empty()) return NONE;
  const std::uint32_t mask = static_cast<std::uint32_t>(l.table.size() - 1);
  // Coordinates below 0 are in no slot: they hash to wherever their bits lead, and no cell compares equal.
  const auto bits = [](std::int32_t coordinate) { return static_cast<std::uint32_t>(coordinate); };
  for (std::size_t slot = hash(pack(bits(x), bits(y), bits(z)), l.table_shift);; slot = (slot + 1) & mask) {
    const std::uint32_t node = l.table[slot];
    if (node == NONE) return NONE;
    const std::array<std::uint16_t, 3>& cell = l.cells[node];
    if (cell[0] == x && cell[1] == y && cell[2] == z) return node;
  }
}

inline std::uint64_t VoxelTree::boxBits(int level, const std::array<std::int32_t, 3>& origin, const KeyBox& box) {
  std::uint64_t bits = ~std::uint64_t{0};
  for (int axis = 0; axis < 3; ++axis) {
    std::int32_t lo = (box.lo[axis] - origin[axis]) >> (2 * level);
    std::int32_t hi = (box.hi[axis] - origin[axis]) >> (2 * level);
    lo = lo < 0 ? 0 : lo;
    hi = hi > 3 ? 3 : hi;
    if (lo > hi) return 0;
    bits &= RANGE_MASKS[axis][lo][hi];
  }
  return bits;
}

template <class Visit>
bool VoxelTree::descend(int level, const Node& node, const std::array<std::int32_t, 3>& origin, const KeyBox& box,
                        Visit& visit) const {
  const std::uint64_t bits = boxBits(level, origin, box) & visit.wanted(node);
  if ((node.full & bits) != 0 && visit(node, node.full & bits)) return true;
  for (std::uint64_t children = node.child & bits; children != 0; children &= children - 1) {
    const unsigned bit = lowestBit(children);
    std::array<std::int32_t, 3> child_origin;
    for (int axis = 0; axis < 3; ++axis) {
      child_origin[axis] = origin[axis] + (CELL_COORDINATES[bit][axis] << (2 * level));
    }
    if (descend(level - 1, levels_[level - 1].nodes[node.childAt(bit)], child_origin, box, visit)) return true;
  }
  return false;
}

template <class Visit>
bool VoxelTree::visitSmall(const Node& node, const std::array<std::int32_t, 3>& origin, const KeyBox& box,
                           Visit& visit) const {
  std::int32_t lo[3], hi[3];
  std::uint64_t bits = visit.wanted(node);
  for (int axis = 0; axis < 3; ++axis) {
    lo[axis] = std::max(box.lo[axis] - origin[axis], 0);
    hi[axis] = std::min(box.hi[axis] - origin[axis], 15);
    bits &= RANGE_MASKS[axis][lo[axis] >> 2][hi[axis] >> 2];
  }
  if ((node.full & bits) != 0 && visit(node, node.full & bits)) return true;
  for (std::uint64_t children = node.child & bits; children != 0; children &= visit.wanted(node) & (children - 1)) {
    const unsigned bit = lowestBit(children);
    const Node& child = levels_[0].nodes[node.childAt(bit)];
    std::uint64_t cells = child.full & visit.wanted(child);
    for (int axis = 0; axis < 3; ++axis) {
      const std::int32_t first = 4 * CELL_COORDINATES[bit][axis];
      cells &= RANGE_MASKS[axis][std::max(lo[axis] - first, 0)][std::min(hi[axis] - first, 3)];
    }
    if (cells != 0 && visit(child, cells)) return true;
  }
  return false;
}

template <class Visit>
bool VoxelTree::visitNodes(const KeyBox& box, Visit&& visit) const {
  if (levels_with_leaves_ < 4 && isSmall(box)) {  // the common case: small box, small leaves
    for (std::int32_t z = box.lo[2] >> 4; z <= box.hi[2] >> 4; ++z) {
      for (std::int32_t y = box.lo[1] >> 4; y <= box.hi[1] >> 4; ++y) {
        for (std::int32_t x = box.lo[0] >> 4; x <= box.hi[0] >> 4; ++x) {
          const std::uint32_t index = find(1, x, y, z);
          if (index != NONE && visitSmall(levels_[1].nodes[index], {x << 4, y << 4, z << 4}, box, visit)) return true;
        }
      }
    }
    return false;
  }
  // Start where the box spans two nodes an axis at most; above that only the leaves of the nodes themselves matter.
  int start = 1;
  const auto spans = [&box](int level, int axis) {
    const int shift = 2 * (level + 1);
    return (box.hi[axis] >> shift) - (box.lo[axis] >> shift);
  };
  while (start < LEVELS - 1 && (spans(start, 0) > 1 || spans(start, 1) > 1 || spans(start, 2) > 1)) ++start;
  for (int level = start; level < LEVELS; ++level) {
    if (level > start && !(levels_with_leaves_ >> level & 1)) continue;
    const int shift = 2 * (level + 1);
    for (std::int32_t z = box.lo[2] >> shift; z <= box.hi[2] >> shift; ++z) {
      for (std::int32_t y = box.lo[1] >> shift; y <= box.hi[1] >> shift; ++y) {
        for (std::int32_t x = box.lo[0] >> shift; x <= box.hi[0] >> shift; ++x) {
          const std::uint32_t index = find(level, x, y, z);
          if (index == NONE) continue;
          const Node& node = levels_[level].nodes[index];
          const std::array<std::int32_t, 3> origin{x << shift, y << shift, z << shift};
          if (level == start) {
            if (descend(level, node, origin, box, visit)) return true;
          } else {
            const std::uint64_t bits = node.full & boxBits(level, origin, box) & visit.wanted(node);
            if (bits != 0 && visit(node, bits)) return true;
          }
        }
      }
    }
  }
  return false;
}

template <class Wanted, class Visit>
void VoxelTree::visitWanted(const KeyBox& box, Wanted wanted, Visit& visit) const {
  struct Leaves {
    Wanted wanted;
    Visit& visit;
    bool operator()(const Node& node, std::uint64_t bits) {
      std::uint32_t last = NONE;
      for (; bits != 0; bits &= bits - 1) {
        const std::uint32_t leaf = node.leafAt(lowestBit(bits));
        if (leaf != last && !visit(leaf)) return true;
        last = leaf;
      }
      return false;
    }
  };
  visitNodes(box, Leaves{wanted, visit});
}

template <class Visit>
void VoxelTree::visitLeaves(const KeyBox& box, Visit&& visit) const {
  visitWanted(
      box, [](const Node&) { return ~std::uint64_t{0}; }, visit);
}

template <class Visit>
void VoxelTree::visitLeavesWithEdges(const KeyBox& box, Visit&& visit) const {
  visitWanted(
      box, [](const Node& node) { return node.edges; }, visit);
}

template <class Visit>
void VoxelTree::visitLeavesWithCorners(const KeyBox& box, Visit&& visit) const {
  visitWanted(
      box, [](const Node& node) { return node.corners; }, visit);
}

inline VoxelTree::Reached VoxelTree::reached(const KeyBox& box) const {
  struct Kinds {
    Reached found;
    /// Whatever has something that was not found yet.
    std::uint64_t wanted(const Node& node) const {
      return (found.leaf ? 0 : ~std::uint64_t{0}) | (found.edge ? 0 : node.edges) | (found.corner ? 0 : node.corners);
    }
    bool operator()(const Node& node, std::uint64_t bits) {
      found.leaf = true;
      found.edge = found.edge || (bits & node.edges) != 0;
      found.corner = found.corner || (bits & node.corners) != 0;
      return found.corner && found.edge;
    }
  };
  Kinds kinds;
  visitNodes(box, kinds);
  return kinds.found;
}

inline bool VoxelTree::reachesLeaf(const KeyBox& box) const {
  struct Any {
    std::uint64_t wanted(const Node&) const { return ~std::uint64_t{0}; }
    bool operator()(const Node&, std::uint64_t) const { return true; }
  };
  return visitNodes(box, Any());
}

}  // namespace dccd
