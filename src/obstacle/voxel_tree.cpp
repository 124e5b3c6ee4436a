#include "obstacle/voxel_tree.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "dccd/tolerances.h"

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
// radix sort runs, then codes and sorted leaves instead); then list, codes and leaves. A node: itself, its cell, a
// table of two to four entries, and the codes of two levels while it is built.
static_assert(tolerance::MAP_LEAF_LISTED == sizeof(OccupiedLeaf), "");
static_assert(tolerance::MAP_LEAF_SORTING >= 2 * sizeof(OccupiedLeaf) + sizeof(CodedLeaf) + sizeof(std::uint64_t) &&
                  tolerance::MAP_LEAF_SORTING >= sizeof(OccupiedLeaf) + 2 * sizeof(CodedLeaf),
              "");
static_assert(tolerance::MAP_LEAF_BUILDING >= 2 * sizeof(OccupiedLeaf) + sizeof(std::uint64_t), "");
static_assert(tolerance::MAP_LEAF_IN_TREE == sizeof(OccupiedLeaf), "");
static_assert(tolerance::MAP_NODE >=
                  sizeof(VoxelTree::Node) + sizeof(std::array<std::uint16_t, 3>) + 4 * sizeof(std::uint32_t),
              "");
static_assert(tolerance::MAP_NODE_BUILDING >= tolerance::MAP_NODE + 2 * sizeof(std::uint64_t), "");

/// Least significant digit first, 12 bits a pass: the 48 bits of a code take four.
void radixSort(std::vector<CodedLeaf>& items) {
  constexpr int DIGIT = 12;
  std::vector<CodedLeaf> other(items.size());
  std::vector<std::uint32_t> offsets(std::size_t{1} << DIGIT);
  for (int shift = 0; shift < 48; shift += DIGIT) {
    std::fill(offsets.begin(), offsets.end(), 0);
    const auto digit = [shift](const CodedLeaf& item) { return item.code >> shift & ((1u << DIGIT) - 1); };
    for (const CodedLeaf& item : items) ++offsets[digit(item)];
    std::uint32_t sum = 0;
    for (std::uint32_t& offset : offsets) sum += std::exchange(offset, sum);
    for (const CodedLeaf& item : items) other[offsets[digit(item)]++] = item;
    items.swap(other);
  }
}

}  // namespace

VoxelTree::VoxelTree(const std::vector<OccupiedLeaf>& leaves) {
  if (leaves.size() >= NONE) throw std::invalid_argument("too many leaves: " + std::to_string(leaves.size()));
  std::vector<std::uint64_t> codes, prefixes;
  sortLeaves(leaves, codes);
  if (leaves_.empty()) return;
  for (int level = 0; level < LEVELS; ++level) buildLevel(level, codes, prefixes);
}

void VoxelTree::sortLeaves(const std::vector<OccupiedLeaf>& leaves, std::vector<std::uint64_t>& codes) {
  std::vector<CodedLeaf> order(leaves.size());
  bool sorted = true;
  for (std::size_t i = 0; i < leaves.size(); ++i) {
    const OccupiedLeaf& leaf = leaves[i];
    checkLeaf(leaf);
    order[i] = {mortonCode(leaf.min.x, leaf.min.y, leaf.min.z), static_cast<std::uint32_t>(i)};
    sorted = sorted && (i == 0 || order[i - 1].code <= order[i].code);
  }
  if (!sorted) radixSort(order);

  std::array<std::uint32_t, LEVELS + 1> next{};
  std::uint64_t end = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const OccupiedLeaf& leaf = leaves[order[i].index];
    if (order[i].code < end) {
      throw std::invalid_argument(describe(leaf) + " overlaps " + describe(leaves[order[i - 1].index]));
    }
    end = order[i].code + std::uint64_t{leaf.size} * leaf.size * leaf.size;
    ++next[levelOfSize(leaf.size) + 1];
  }
  for (int level = 0; level < LEVELS; ++level) {
    if (next[level + 1] != 0) levels_with_leaves_ |= 1u << level;
    next[level + 1] += next[level];
  }
  first_leaf_of_level_ = next;
  leaves_.resize(leaves.size());
  codes.resize(leaves.size());
  for (const CodedLeaf& item : order) {
    const std::uint32_t slot = next[levelOfSize(leaves[item.index].size)]++;
    leaves_[slot] = leaves[item.index];
    codes[slot] = item.code;
  }
}

std::size_t VoxelTree::countNodes(int level, const std::vector<std::uint64_t>& codes,
                                  const std::vector<std::uint64_t>& prefixes) const {
  const int shift = 6 * (level + 1);
  std::uint32_t leaf = first_leaf_of_level_[level];
  std::size_t child = 0, count = 0;
  for (std::uint64_t last = ~std::uint64_t{0}; leaf < first_leaf_of_level_[level + 1] || child < prefixes.size();) {
    const std::uint64_t of_leaf = leaf < first_leaf_of_level_[level + 1] ? codes[leaf] >> shift : ~std::uint64_t{0};
    const std::uint64_t of_child = child < prefixes.size() ? prefixes[child] >> 6 : ~std::uint64_t{0};
    const std::uint64_t prefix = std::min(of_leaf, of_child);
    count += prefix != last;
    last = prefix;
    leaf += of_leaf == prefix;
    child += of_child == prefix;
  }
  return count;
}

void VoxelTree::buildLevel(int level, const std::vector<std::uint64_t>& codes, std::vector<std::uint64_t>& prefixes) {
  // Merge this level's leaves with the nodes below (prefixes: their codes), both sorted by code.
  Level& l = levels_[level];
  const int shift = 6 * (level + 1);
  const std::uint32_t leaf_end = first_leaf_of_level_[level + 1];
  std::uint32_t leaf = first_leaf_of_level_[level];
  std::size_t child = 0;
  std::vector<std::uint64_t> own;
  const std::size_t count = countNodes(level, codes, prefixes);  // lists that grow would take three times as much
  l.nodes.reserve(count);
  l.cells.reserve(count);
  own.reserve(count);
  while (leaf < leaf_end || child < prefixes.size()) {
    std::uint64_t prefix = leaf < leaf_end ? codes[leaf] >> shift : ~std::uint64_t{0};
    if (child < prefixes.size()) prefix = std::min(prefix, prefixes[child] >> 6);
    Node node;
    node.first_leaf = leaf;
    node.first_child = static_cast<std::uint32_t>(child);
    for (; leaf < leaf_end && codes[leaf] >> shift == prefix; ++leaf) {
      const unsigned bit = static_cast<unsigned>(codes[leaf] >> (shift - 6) & 63);
      const std::uint32_t side = leaves_[leaf].size >> (2 * level);  // 1, 2, or 4 for the root leaf
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
  // A node's cell in the node above holds what any of its cells does, and so on up.
  while (edges != 0 || corners != 0) {
    Node& at = levels_[level].nodes[node];
    const bool new_edges = edges != 0 && at.edges == 0, new_corners = corners != 0 && at.corners == 0;
    at.edges |= edges;
    at.corners |= corners;
    if (++level == LEVELS || !(new_edges || new_corners)) return;
    const std::array<std::uint16_t, 3>& cell = levels_[level - 1].cells[node];
    const std::uint64_t bit = std::uint64_t{1} << cellBit(cell[0], cell[1], cell[2]);
    node = find(level, cell[0] >> 2, cell[1] >> 2, cell[2] >> 2);
    edges = new_edges ? bit : 0;
    corners = new_corners ? bit : 0;
  }
}

}  // namespace dccd
