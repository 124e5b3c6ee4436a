#include "obstacle/voxel_tree.h"

#include <algorithm>
#include <cstring>
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

bool isLeaf(const OccupiedLeaf& leaf) {
  const std::uint32_t size = leaf.size;
  return size != 0 && size <= static_cast<std::uint32_t>(VoxelTree::KEYS) && (size & (size - 1)) == 0 &&
         ((leaf.min.x | leaf.min.y | leaf.min.z) & (size - 1)) == 0;
}

/// A leaf of one or two voxels.
bool isSmallLeaf(const OccupiedLeaf& leaf) {
  return leaf.size - 1 <= 1 && ((leaf.min.x | leaf.min.y | leaf.min.z) & (leaf.size - 1)) == 0;
}

/// How many leaves two lists of `most` have in common from their beginnings on.
std::size_t commonLeaves(const OccupiedLeaf* a, const OccupiedLeaf* b, std::size_t most) {
  const auto isSame = [](const OccupiedLeaf& p, const OccupiedLeaf& q) {
    return p.min.x == q.min.x && p.min.y == q.min.y && p.min.z == q.min.z && p.size == q.size;
  };
  std::size_t i = 0;
  // Nearly all are the same: eight at a time as words, without the two bytes behind a key that mean nothing.
  static_assert(sizeof(OccupiedLeaf) == 12 && sizeof(VoxelKey) == 6 && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "");
  constexpr std::uint64_t MEANT[3] = {0x0000ffffffffffff, 0xffffffffffffffff, 0xffffffff0000ffff};
  for (; i + 8 <= most; i += 8) {
    const char *p = reinterpret_cast<const char*>(a + i), *q = reinterpret_cast<const char*>(b + i);
    const auto otherBits = [&](int w) {
      std::uint64_t words[2];
      std::memcpy(&words[0], p + 8 * w, 8);
      std::memcpy(&words[1], q + 8 * w, 8);
      return words[0] ^ words[1];
    };
    std::uint64_t other = 0;
    for (int w = 0; w < 3; ++w) {
      other |= (otherBits(w) | otherBits(w + 3) | otherBits(w + 6) | otherBits(w + 9)) & MEANT[w];
    }
    if (other != 0) break;
  }
  while (i < most && isSame(a[i], b[i])) ++i;
  return i;
}

/// A leaf's key, 16 bits for each of its coordinates, x the lowest.
std::uint64_t keyWord(const OccupiedLeaf& leaf) {
  std::uint64_t word;
  std::memcpy(&word, &leaf, sizeof word);
  return word & 0x0000ffffffffffff;
}
constexpr std::uint64_t KEYS_WITHIN = 0x0000000300030003;  // of a node of level 0

/// cellBit() of the key, at the number that its three pairs of lowest bits make.
const std::array<std::uint8_t, 64> BIT_OF_KEY = [] {
  std::array<std::uint8_t, 64> bits;
  for (std::uint32_t i = 0; i < 64; ++i) bits[i] = static_cast<std::uint8_t>(cellBit(i, i >> 2, i >> 4));
  return bits;
}();
unsigned bitOfKey(std::uint64_t key) {
  key &= KEYS_WITHIN;
  return BIT_OF_KEY[(key | key >> 14 | key >> 28) & 63];
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

/// Of a node of level 0, in units of the node.
using Cell = std::array<std::uint16_t, 3>;

Cell cellOf(const OccupiedLeaf& leaf) {
  return {static_cast<std::uint16_t>(leaf.min.x >> 2), static_cast<std::uint16_t>(leaf.min.y >> 2),
          static_cast<std::uint16_t>(leaf.min.z >> 2)};
}

std::uint64_t codeOf(const Cell& cell) { return mortonCode(cell[0], cell[1], cell[2]); }
std::uint64_t codeOf(const OccupiedLeaf& leaf) { return mortonCode(leaf.min.x, leaf.min.y, leaf.min.z); }

/// Whether both lie in the same node of the level. Most leaves follow one of which that is so, and need no code.
bool shareNode(const OccupiedLeaf& a, const OccupiedLeaf& b, int level) {
  return ((a.min.x ^ b.min.x) | (a.min.y ^ b.min.y) | (a.min.z ^ b.min.z)) >> (2 * (level + 1)) == 0;
}

std::vector<OccupiedLeaf> sorted(const std::vector<OccupiedLeaf>& leaves) {
  std::vector<CodedLeaf> order(leaves.size());
  for (std::size_t i = 0; i < leaves.size(); ++i) order[i] = {codeOf(leaves[i]), static_cast<std::uint32_t>(i)};
  radixSort(order);
  std::vector<OccupiedLeaf> list(leaves.size());
  for (std::size_t i = 0; i < order.size(); ++i) list[i] = leaves[order[i].index];
  return list;
}

/// Of cells in the order of their codes, most of which follow one of the same node of level 1.
std::vector<std::uint64_t> codesOf(const std::vector<Cell>& cells) {
  std::vector<std::uint64_t> codes;
  codes.reserve(cells.size());
  Cell last{};
  for (const Cell& cell : cells) {
    const bool in_next = codes.empty() || ((cell[0] ^ last[0]) | (cell[1] ^ last[1]) | (cell[2] ^ last[2])) > 3;
    codes.push_back(in_next ? codeOf(cell) : (codes.back() & ~std::uint64_t{63}) | cellBit(cell[0], cell[1], cell[2]));
    last = cell;
  }
  return codes;
}

}  // namespace

VoxelTree::VoxelTree(const std::vector<OccupiedLeaf>& leaves) {
  if (leaves.size() >= NONE) throw std::invalid_argument("too many leaves: " + std::to_string(leaves.size()));
  if (!takeSorted(leaves)) takeSorted(sorted(leaves));
  if (leaves_.empty()) return;
  std::vector<std::uint64_t> prefixes;
  for (int level = 0; level < LEVELS; ++level) buildLevel(level, prefixes);
}

bool VoxelTree::takeSorted(const std::vector<OccupiedLeaf>& leaves) {
  std::array<std::uint32_t, LEVELS + 1> next{};
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
    ++next[levelOfSize(leaf.size) + 1];
  }
  for (int level = 0; level < LEVELS; ++level) {
    if (next[level + 1] != 0) levels_with_leaves_ |= 1u << level;
    next[level + 1] += next[level];
  }
  first_leaf_of_level_ = next;
  levels_[0].nodes.reserve(blocks);
  levels_[0].cells.reserve(blocks);
  if (levels_with_leaves_ == 1) {
    leaves_ = leaves;
    return true;
  }
  leaves_.resize(leaves.size());
  for (const OccupiedLeaf& leaf : leaves) leaves_[next[levelOfSize(leaf.size)]++] = leaf;
  return true;
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

// --- a tree that follows another one ---------------------------------------------------------------------------------

/// Sorts them by level, in the order in which they come. `small`: all are taken for such of level 0.
bool VoxelTree::takeLevels(std::vector<OccupiedLeaf>& leaves, bool small) {
  std::uint32_t sizes = 0;
  for (std::size_t i = 0; !small && i < leaves.size(); ++i) sizes |= leaves[i].size;
  std::array<std::uint32_t, LEVELS + 1> next{};
  if (sizes < 4) {
    next[1] = static_cast<std::uint32_t>(leaves.size());
  } else {
    for (const OccupiedLeaf& leaf : leaves) {
      if (!isLeaf(leaf)) return false;
      ++next[levelOfSize(leaf.size) + 1];
    }
  }
  for (int level = 0; level < LEVELS; ++level) {
    if (next[level + 1] != 0) levels_with_leaves_ |= 1u << level;
    next[level + 1] += next[level];
  }
  first_leaf_of_level_ = next;
  if (sizes < 4) {
    leaves_.swap(leaves);
    return true;
  }
  leaves_.resize(leaves.size());
  for (const OccupiedLeaf& leaf : leaves) leaves_[next[levelOfSize(leaf.size)]++] = leaf;
  return true;
}

/// How many blocks have the same leaves from `node` of the tree before and from `leaf` on, which passes by them.
std::uint32_t VoxelTree::commonBlocks(const VoxelTree& before, std::uint32_t node, std::uint32_t& leaf) const {
  const std::vector<Node>& old = before.levels_[0].nodes;
  const std::uint32_t end = first_leaf_of_level_[1], old_leaf = old[node].first_leaf, first = node;
  const std::size_t most = std::min(end - leaf, before.first_leaf_of_level_[1] - old_leaf);
  const std::size_t same_to = leaf + commonLeaves(&leaves_[leaf], &before.leaves_[old_leaf], most);
  const std::uint32_t shift = leaf - old_leaf;  // modulo 2^32
  for (; node < old.size(); ++node) {
    const std::uint32_t next = before.leafEnd(node) + shift;
    if (next > same_to || (next == same_to && next < end && shareNode(leaves_[next], leaves_[next - 1], 0))) break;
    leaf = next;
  }
  return node - first;
}

bool VoxelTree::followBlocks(const VoxelTree& before, Change& change, std::vector<std::uint64_t>& prefixes) {
  struct Kept {  // nodes that follow each other in both trees: the first one, and how much later its leaves come
    std::uint32_t node, count, shift;
  };
  const Level& old = before.levels_[0];
  std::vector<Kept> kept;
  std::vector<Node> changed;
  std::uint32_t node = 0, made = 0;  // of the tree before, and of this one
  const auto isAt = [&](const Cell& cell) {
    return node < old.nodes.size() &&
           ((cell[0] ^ old.cells[node][0]) | (cell[1] ^ old.cells[node][1]) | (cell[2] ^ old.cells[node][2])) == 0;
  };
  const auto passUpTo = [&](std::uint64_t code) {  // nodes that are no more
    for (; node < old.nodes.size() && codeOf(old.cells[node]) < code; ++node) {
      change.blocks.push_back({old.cells[node], old.nodes[node].full, NONE, node, false});
    }
  };
  for (std::uint32_t leaf = 0, end = first_leaf_of_level_[1]; leaf < end;) {
    if (isAt(cellOf(leaves_[leaf]))) {
      const std::uint32_t shift = leaf - old.nodes[node].first_leaf, count = commonBlocks(before, node, leaf);
      if (count > 0) kept.push_back({made, count, shift});
      made += count;
      node += count;
      if (leaf == end) break;
    }
    const OccupiedLeaf& first = leaves_[leaf];
    const Cell cell = cellOf(first);
    if (!isAt(cell)) {
      const std::uint64_t code = codeOf(cell);
      if (leaf > 0 && code <= codeOf(cellOf(leaves_[leaf - 1]))) return false;
      passUpTo(code);
      if (isAt(cell)) continue;
    }
    Node one;
    one.first_leaf = leaf;
    const std::uint64_t first_key = keyWord(first);
    for (; leaf < end; ++leaf) {
      const OccupiedLeaf& its = leaves_[leaf];
      const std::uint64_t key = keyWord(its);
      if (((key ^ first_key) & ~KEYS_WITHIN) != 0) break;
      const unsigned bit = bitOfKey(key);
      if ((its.size != 1 && !isSmallLeaf(its)) || one.full >> bit != 0) return false;
      one.full |= (its.size == 1 ? std::uint64_t{1} : 0xffu) << bit;
      one.start |= std::uint64_t{1} << bit;
    }
    const bool is_new = !isAt(cell);
    change.blocks.push_back({cell, one.full ^ (is_new ? 0 : old.nodes[node].full), made++, node, is_new});
    changed.push_back(one);
    node += !is_new;
  }
  passUpTo(~std::uint64_t{0});
  placeBlocks(before, changed, change);
  Level& level = levels_[0];
  for (const Kept& run : kept) {
    for (std::uint32_t n = run.node; n < run.node + run.count; ++n) level.nodes[n].first_leaf += run.shift;
  }
  prefixes = codesOf(level.cells);
  return true;
}

/// Nodes of level 0: those of the tree before, and in their places the ones that are new or have changed.
void VoxelTree::placeBlocks(const VoxelTree& before, const std::vector<Node>& changed, const Change& change) {
  const Level& old = before.levels_[0];
  Level& level = levels_[0];
  std::size_t count = old.nodes.size();
  for (const Change::Block& block : change.blocks) count = count + block.is_new - (block.node == NONE);
  level.nodes.reserve(count);
  level.cells.reserve(count);
  std::uint32_t from = 0;
  const auto takeUpTo = [&](std::uint32_t to) {
    level.nodes.insert(level.nodes.end(), old.nodes.begin() + from, old.nodes.begin() + to);
    level.cells.insert(level.cells.end(), old.cells.begin() + from, old.cells.begin() + to);
    from = to;
  };
  for (const Change::Block& block : change.blocks) {
    if (block.node != NONE && !block.is_new) continue;
    takeUpTo(block.before);
    if (block.is_new) {
      level.nodes.emplace_back();
      level.cells.push_back(block.cell);
    } else {
      ++from;
    }
  }
  takeUpTo(static_cast<std::uint32_t>(old.nodes.size()));
  auto next = changed.begin();
  for (const Change::Block& block : change.blocks) {
    if (block.node != NONE) level.nodes[block.node] = *next++;
  }
}

bool VoxelTree::followLarge(const VoxelTree& before, Change& change) const {
  change.large_before.reserve(leaves_.size() - first_leaf_of_level_[1]);
  for (int level = 1; level < LEVELS; ++level) {
    for (const Node& node : levels_[level].nodes) {
      if ((node.full & node.child) != 0) return false;
    }
    std::uint32_t leaf = first_leaf_of_level_[level], old = before.first_leaf_of_level_[level];
    const std::uint32_t leaf_end = first_leaf_of_level_[level + 1], old_end = before.first_leaf_of_level_[level + 1];
    std::uint64_t end = 0;
    while (leaf < leaf_end || old < old_end) {
      const std::uint64_t code = leaf < leaf_end ? codeOf(leaves_[leaf]) : ~std::uint64_t{0};
      const std::uint64_t old_code = old < old_end ? codeOf(before.leaves_[old]) : ~std::uint64_t{0};
      if (code > old_code) {
        change.large.push_back(before.leaves_[old++]);
        continue;
      }
      const OccupiedLeaf& one = leaves_[leaf++];
      if (code < end) return false;
      end = code + std::uint64_t{one.size} * one.size * one.size;
      const bool same = code == old_code && one.size == before.leaves_[old].size;
      if (!same) change.large.push_back(one);
      change.large_before.push_back(same ? old++ : NONE);
    }
  }
  return true;
}

std::optional<VoxelTree> VoxelTree::following(std::vector<OccupiedLeaf>& leaves, const VoxelTree& before,
                                              Change& change) {
  if (leaves.empty() || leaves.size() >= NONE) return std::nullopt;
  // Where there were only small leaves there will be, most of the time: to find out takes as long as to compare them.
  for (bool small = before.levels_with_leaves_ == 1;; small = false) {
    std::optional<VoxelTree> tree = VoxelTree();
    std::vector<std::uint64_t> prefixes;
    change = Change();
    bool follows = tree->takeLevels(leaves, small) && tree->followBlocks(before, change, prefixes);
    for (int level = 1; follows && level < LEVELS; ++level) tree->buildLevel(level, prefixes);
    if (follows && tree->followLarge(before, change)) return tree;
    if (leaves.empty()) leaves.swap(tree->leaves_);
    if (!small) return std::nullopt;
  }
}

}  // namespace dccd
