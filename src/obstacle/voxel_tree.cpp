#include "obstacle/voxel_tree.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "dccd/tolerances.h"
#include "obstacle/radix_sort.h"

namespace dccd {
namespace {

std::string describe(const OccupiedLeaf& leaf) {
  return "leaf at key (" + std::to_string(leaf.min.x) + ", " + std::to_string(leaf.min.y) + ", " +
         std::to_string(leaf.min.z) + ") of size " + std::to_string(leaf.size);
}

void checkLeaf(const OccupiedLeaf& leaf) {
  const std::uint32_t size = leaf.size;
  if (size == 0 || size > static_cast<std::uint32_t>(VoxelTree::KEYS) || (size & (size - 1)) != 0) {
    throw std::invalid_argument(describe(leaf) + ": the size is not a power of two from 1 to 65536");
  }
  if (((leaf.min.x | leaf.min.y | leaf.min.z) & (size - 1)) != 0) {
    throw std::invalid_argument(describe(leaf) + ": the key is not a multiple of the size");
  }
}

struct CodedLeaf {
  std::uint64_t code;
  std::uint32_t index;
};

// What is allocated below, leaf by leaf and node by node. While leaves are sorted: the list, the order (twice while the
// radix sort runs), then the sorted list and the leaves; then list and leaves. A node: itself, its cell, a table of two
// to four entries, and the codes of two levels while it is built.
static_assert(tolerance::MAP_LEAF_LISTED == sizeof(OccupiedLeaf), "");
static_assert(tolerance::MAP_LEAF_SORTING >= sizeof(OccupiedLeaf) + 2 * sizeof(CodedLeaf) &&
                  tolerance::MAP_LEAF_SORTING >= 2 * sizeof(OccupiedLeaf) + sizeof(CodedLeaf),
              "");
static_assert(tolerance::MAP_LEAF_BUILDING >= 2 * sizeof(OccupiedLeaf), "");
static_assert(tolerance::MAP_LEAF_IN_TREE == sizeof(OccupiedLeaf), "");
static_assert(tolerance::MAP_NODE >=
                  sizeof(VoxelTree::Node) + sizeof(std::array<std::uint16_t, 3>) + 4 * sizeof(std::uint32_t),
              "");
static_assert(tolerance::MAP_NODE_BUILDING >= tolerance::MAP_NODE + 2 * sizeof(std::uint64_t), "");

/// Of a list that is two in Morton order, one behind the other, as what is occupied and what is free: both in one. Of
/// others the leaves in some order.
std::vector<OccupiedLeaf> merged(const std::vector<OccupiedLeaf>& leaves) {
  std::vector<OccupiedLeaf> list;
  list.reserve(leaves.size());
  const auto isAfter = [](const OccupiedLeaf& a, const OccupiedLeaf& b) { return codeOf(a) > codeOf(b); };
  const auto last = std::adjacent_find(leaves.begin(), leaves.end(), isAfter);
  auto one = leaves.begin();
  const auto middle = last == leaves.end() ? last : last + 1;
  for (auto other = middle; other != leaves.end(); ++other) {
    const std::uint64_t code = codeOf(*other);
    while (one != middle && codeOf(*one) < code) list.push_back(*one++);
    list.push_back(*other);
  }
  list.insert(list.end(), one, middle);
  return list;
}

std::vector<OccupiedLeaf> sorted(const std::vector<OccupiedLeaf>& leaves) {
  std::vector<CodedLeaf> order(leaves.size());
  for (std::size_t i = 0; i < leaves.size(); ++i) order[i] = {codeOf(leaves[i]), static_cast<std::uint32_t>(i)};
  std::vector<CodedLeaf> other(order.size());
  for (int shift = 0; shift < 48; shift += RADIX_BITS) {  // the bits of a code
    radixPass(order, other, shift, [](const CodedLeaf& leaf) { return leaf.code; });
  }
  std::vector<OccupiedLeaf> list(leaves.size());
  for (std::size_t i = 0; i < order.size(); ++i) list[i] = leaves[order[i].index];
  return list;
}

}  // namespace

VoxelTree::VoxelTree(const std::vector<OccupiedLeaf>& leaves) {
  if (leaves.size() >= NONE) throw std::invalid_argument("too many leaves: " + std::to_string(leaves.size()));
  if (!takeSorted(leaves) && !takeSorted(merged(leaves))) takeSorted(sorted(leaves));
  if (leaves_.empty()) return;
  std::vector<std::uint64_t> prefixes;
  for (int level = 0; level < LEVELS; ++level) buildLevel(level, prefixes);
}

bool VoxelTree::takeSorted(const std::vector<OccupiedLeaf>& leaves) {
  std::array<std::uint32_t, LEVELS> counts{};
  std::uint64_t block = 0, end = 0;  // codes: of the last leaf's block of 4^3 voxels, and of what follows that leaf
  std::size_t blocks = 0;            // in which a smaller leaf lies
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const OccupiedLeaf& leaf = leaves[i];
    checkLeaf(leaf);
    if (i == 0 || !shareNode(leaf, leaves[i - 1], 0)) {
      block = codeOf(leaf) & ~std::uint64_t{63};
      blocks += leaf.size < 4;
    }
    const std::uint64_t code = block | cellBit(leaf.min.x, leaf.min.y, leaf.min.z);
    if (code < end) {
      if (code < codeOf(leaves[i - 1])) return false;
      throw std::invalid_argument(describe(leaf) + " overlaps " + describe(leaves[i - 1]));
    }
    end = code + std::uint64_t{leaf.size} * leaf.size * leaf.size;
    ++counts[levelOfSize(leaf.size)];
  }
  setLevels(counts);
  levels_[0].nodes.reserve(blocks);
  levels_[0].cells.reserve(blocks);
  takeByLevel(leaves);
  return true;
}

void VoxelTree::setLevels(const std::array<std::uint32_t, LEVELS>& counts) {
  for (int level = 0; level < LEVELS; ++level) {
    if (counts[level] != 0) levels_with_leaves_ |= 1u << level;
    first_leaf_of_level_[level + 1] = first_leaf_of_level_[level] + counts[level];
  }
}

void VoxelTree::takeByLevel(const std::vector<OccupiedLeaf>& leaves) {
  if (levels_with_leaves_ == 1) {
    leaves_ = leaves;
    return;
  }
  std::array<std::uint32_t, LEVELS + 1> next = first_leaf_of_level_;
  leaves_.resize(leaves.size());
  for (const OccupiedLeaf& leaf : leaves) leaves_[next[levelOfSize(leaf.size)]++] = leaf;
}

std::size_t VoxelTree::countNodes(int level, const std::vector<std::uint64_t>& prefixes) const {
  const int shift = 6 * (level + 1);
  std::uint32_t leaf = first_leaf_of_level_[level];
  std::size_t child = 0, count = 0;
  if (leaf == first_leaf_of_level_[level + 1]) {  // nodes of nodes alone
    for (; child < prefixes.size(); ++child) count += child == 0 || (prefixes[child] ^ prefixes[child - 1]) >> 6 != 0;
    return count;
  }
  for (std::uint64_t last = ~std::uint64_t{0}; leaf < first_leaf_of_level_[level + 1] || child < prefixes.size();) {
    const std::uint64_t of_leaf =
        leaf < first_leaf_of_level_[level + 1] ? codeOf(leaves_[leaf]) >> shift : ~std::uint64_t{0};
    const std::uint64_t of_child = child < prefixes.size() ? prefixes[child] >> 6 : ~std::uint64_t{0};
    const std::uint64_t prefix = std::min(of_leaf, of_child);
    count += prefix != last;
    last = prefix;
    leaf += of_leaf == prefix;
    child += of_child == prefix;
  }
  return count;
}

void VoxelTree::buildLevel(int level, std::vector<std::uint64_t>& prefixes) {
  // Merge this level's leaves with the nodes below (prefixes: their codes), both sorted by code.
  Level& l = levels_[level];
  const int shift = 6 * (level + 1);
  const std::uint32_t leaf_end = first_leaf_of_level_[level + 1];
  std::uint32_t leaf = first_leaf_of_level_[level];
  std::size_t child = 0;
  std::vector<std::uint64_t> own;
  if (level > 0) {  // lists that grow would take three times as much; those of level 0 were counted before
    const std::size_t count = countNodes(level, prefixes);
    l.nodes.reserve(count);
    l.cells.reserve(count);
  }
  own.reserve(l.nodes.capacity());
  while (leaf < leaf_end || child < prefixes.size()) {
    std::uint64_t prefix = leaf < leaf_end ? codeOf(leaves_[leaf]) >> shift : ~std::uint64_t{0};
    const bool has_leaf = child == prefixes.size() || prefix <= prefixes[child] >> 6;
    if (!has_leaf) prefix = prefixes[child] >> 6;
    Node node;
    node.first_leaf = leaf;
    node.first_child = static_cast<std::uint32_t>(child);
    for (; has_leaf && leaf < leaf_end && shareNode(leaves_[leaf], leaves_[node.first_leaf], level); ++leaf) {
      const OccupiedLeaf& one = leaves_[leaf];
      const unsigned bit = cellBit(one.min.x >> 2 * level, one.min.y >> 2 * level, one.min.z >> 2 * level);
      const std::uint32_t side = one.size >> (2 * level);  // 1, 2, or 4 for the root leaf
      const std::uint64_t cells = side == 1 ? 1u : side == 2 ? 0xffu : ~std::uint64_t{0};
      node.full |= cells << bit;
      node.start |= std::uint64_t{1} << bit;
    }
    for (; child < prefixes.size() && prefixes[child] >> 6 == prefix; ++child) {
      node.child |= std::uint64_t{1} << (prefixes[child] & 63);
    }
    l.nodes.push_back(node);
    l.cells.push_back({static_cast<std::uint16_t>(gatherBits(prefix)),
                       static_cast<std::uint16_t>(gatherBits(prefix >> 1)),
                       static_cast<std::uint16_t>(gatherBits(prefix >> 2))});
    own.push_back(prefix);
  }
  if (level > 0) buildTable(l);
  prefixes.swap(own);
}

void VoxelTree::buildTable(Level& level) {
  int bits = 3;
  while ((std::size_t{1} << bits) < 2 * level.nodes.size()) ++bits;
  level.table.assign(std::size_t{1} << bits, NONE);
  level.table_shift = 64 - bits;
  const std::size_t mask = level.table.size() - 1;
  for (std::size_t node = 0; node < level.nodes.size(); ++node) {
    const std::array<std::uint16_t, 3>& cell = level.cells[node];
    std::size_t slot = hash(pack(cell[0], cell[1], cell[2]), level.table_shift);
    while (level.table[slot] != NONE) slot = (slot + 1) & mask;
    level.table[slot] = static_cast<std::uint32_t>(node);
  }
}

VoxelTree::Coverage VoxelTree::coverage(std::int32_t x, std::int32_t y, std::int32_t z, std::int32_t size) const {
  if (x < 0 || y < 0 || z < 0 || x >= KEYS || y >= KEYS || z >= KEYS) return Coverage::EMPTY;
  // From the first level whose cells are at least the cube up to the first node that exists there.
  const int own = levelOfSize(static_cast<std::uint32_t>(size));
  const int first = std::max(own, 1);
  for (int level = first; level < LEVELS; ++level) {
    if (level > first && !(levels_with_leaves_ >> level & 1)) continue;  // nothing there can cover the cube
    const int shift = 2 * (level + 1);
    const std::uint32_t index = find(level, x >> shift, y >> shift, z >> shift);
    if (index == NONE) continue;
    const Node* node = &levels_[level].nodes[index];
    unsigned bit = cellBit(x >> 2 * level, y >> 2 * level, z >> 2 * level);
    int at = level;
    if (own == 0 && level == 1 && (node->child >> bit & 1)) {
      node = &levels_[0].nodes[node->childAt(bit)];
      bit = cellBit(x, y, z);
      at = 0;
    }
    const std::int32_t side = size >> (2 * at);
    const std::uint64_t cells = (side <= 1 ? 1u : side == 2 ? 0xffu : ~std::uint64_t{0}) << bit;
    if ((node->full & cells) == cells) return Coverage::FULL;
    // No node of the cube's own level: a child here leads to other places, for this one it is as good as empty.
    if (level > first) return Coverage::EMPTY;
    return ((node->full | node->child) & cells) == 0 ? Coverage::EMPTY : Coverage::PARTIAL;
  }
  return Coverage::EMPTY;
}

std::size_t VoxelTree::memoryBytes() const {
  std::size_t bytes = leaves_.capacity() * sizeof(OccupiedLeaf);
  for (const Level& level : levels_) {
    bytes += level.nodes.capacity() * sizeof(Node) + level.cells.capacity() * sizeof(level.cells[0]) +
             level.table.capacity() * sizeof(std::uint32_t);
  }
  return bytes;
}

void VoxelTree::setFeatureCells(int level, std::uint32_t node, std::uint64_t edges, std::uint64_t corners) {
  levels_[level].nodes[node].edges = edges;
  levels_[level].nodes[node].corners = corners;
}

void VoxelTree::raiseFeatureCells() {
  for (int level = 1; level < LEVELS; ++level) {
    for (Node& node : levels_[level].nodes) {
      const Node* child = levels_[level - 1].nodes.data() + node.first_child;
      for (std::uint64_t bits = node.child; bits != 0; bits &= bits - 1, ++child) {
        const unsigned bit = lowestBit(bits);
        node.edges |= std::uint64_t{child->edges != 0} << bit;
        node.corners |= std::uint64_t{child->corners != 0} << bit;
      }
    }
  }
}

bool VoxelTree::occupiedKeys(std::array<std::int32_t, 3>& lo, std::array<std::int32_t, 3>& hi) const {
  lo = {KEYS, KEYS, KEYS};
  hi = {0, 0, 0};
  for (int level = 0; level < LEVELS; ++level) {
    for (std::size_t n = 0; n < levels_[level].nodes.size(); ++n) {
      const std::uint64_t full = levels_[level].nodes[n].full;
      if (full == 0) continue;
      const std::array<std::uint16_t, 3>& cell = levels_[level].cells[n];
      const std::int32_t shift = 2 * (level + 1), x = cell[0] << shift, y = cell[1] << shift, z = cell[2] << shift,
                         end = 1 << shift;
      // Most lie within what others span.
      if ((x >= lo[0]) & (y >= lo[1]) & (z >= lo[2]) & (x + end <= hi[0]) & (y + end <= hi[1]) & (z + end <= hi[2])) {
        continue;
      }
      for (int axis = 0; axis < 3; ++axis) {
        const std::int32_t first = levels_[level].cells[n][axis] << (2 * (level + 1)), side = 1 << (2 * level);
        for (int i = 0; i < 4; ++i) {
          if ((full & RANGE_MASKS[axis][i][i]) == 0) continue;
          lo[axis] = std::min(lo[axis], first + i * side);
          hi[axis] = std::max(hi[axis], first + (i + 1) * side);
        }
      }
    }
  }
  return hi[0] > 0;
}

}  // namespace dccd
