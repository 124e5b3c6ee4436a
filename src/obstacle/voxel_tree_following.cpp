// A tree that is made of the one before it: most of a live map stays as it is.
#include <algorithm>
#include <cstring>

#include "obstacle/voxel_tree.h"

namespace dccd {
namespace {

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

/// Of a node of level 0, in units of the node.
using Cell = std::array<std::uint16_t, 3>;

Cell cellOf(const OccupiedLeaf& leaf) {
  return {static_cast<std::uint16_t>(leaf.min.x >> 2), static_cast<std::uint16_t>(leaf.min.y >> 2),
          static_cast<std::uint16_t>(leaf.min.z >> 2)};
}

std::uint64_t codeOf(const Cell& cell) { return mortonCode(cell[0], cell[1], cell[2]); }

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

/// Sorts them by level, in the order in which they come. `small`: all are taken for such of level 0.
bool VoxelTree::takeLevels(std::vector<OccupiedLeaf>& leaves, bool small) {
  std::uint32_t sizes = 0;
  for (std::size_t i = 0; !small && i < leaves.size(); ++i) sizes |= leaves[i].size;
  std::array<std::uint32_t, LEVELS> counts{};
  if (sizes < 4) {
    counts[0] = static_cast<std::uint32_t>(leaves.size());
  } else {
    for (const OccupiedLeaf& leaf : leaves) {
      if (!isLeaf(leaf)) return false;
      ++counts[levelOfSize(leaf.size)];
    }
  }
  setLevels(counts);
  if (sizes < 4) {
    leaves_.swap(leaves);
  } else {
    takeByLevel(leaves);
  }
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
