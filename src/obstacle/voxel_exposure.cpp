#include "obstacle/voxel_exposure.h"

#include <algorithm>

namespace dccd {
namespace {

using Coverage = VoxelTree::Coverage;
using Cell = std::array<std::int32_t, 3>;

std::array<FeatureMask, 64> makeFeatureTable() {
  std::array<FeatureMask, 64> table{};
  for (unsigned faces = 0; faces < 64; ++faces) {
    const auto exposed = [faces](int axis, int side) { return (faces >> (2 * axis + side) & 1) != 0; };
    FeatureMask mask = faces;
    for (int axis = 0; axis < 3; ++axis) {
      for (int sides = 0; sides < 4; ++sides) {
        const int b = sides & 1, c = sides >> 1;
        if (exposed((axis + 1) % 3, b) && exposed((axis + 2) % 3, c)) mask |= 1u << edgeBit(axis, b, c);
      }
    }
    for (int sides = 0; sides < 8; ++sides) {
      const int x = sides & 1, y = sides >> 1 & 1, z = sides >> 2;
      if (exposed(0, x) && exposed(1, y) && exposed(2, z)) mask |= 1u << cornerBit(x, y, z);
    }
    table[faces] = mask;
  }
  return table;
}

const std::array<FeatureMask, 64> FEATURES_OF_FACES = makeFeatureTable();

/// Occupancy of the level 0 block at a cell of a level 1 node; `node` NONE stands for a region covered all alike.
std::uint64_t blockBits(const VoxelTree& tree, std::uint32_t node, bool region_full, unsigned cell) {
  if (node == VoxelTree::NONE) return region_full ? ~std::uint64_t{0} : 0;
  const VoxelTree::Node& parent = tree.nodes(1)[node];
  if (parent.child >> cell & 1) return tree.nodes(0)[parent.childAt(cell)].full;
  return parent.full >> cell & 1 ? ~std::uint64_t{0} : 0;
}

/// Bits 0 to 7 of the index, a byte each.
std::array<std::uint64_t, 256> makeByteOfBit() {
  std::array<std::uint64_t, 256> table{};
  for (unsigned bits = 0; bits < 256; ++bits) {
    for (int i = 0; i < 8; ++i) table[bits] |= std::uint64_t{bits >> i & 1} << (8 * i);
  }
  return table;
}

const std::array<std::uint64_t, 256> BYTE_OF_BIT = makeByteOfBit();

/// Masks of the leaves of one level 0 node, given which of its cells are exposed in each direction, eight cells at a
/// time. A leaf of two voxels a side takes the union over its cells: faces between its own cells are covered and add
/// nothing.
void blockFeatures(const VoxelTree::Node& node, const std::array<std::uint64_t, FACE_DIRECTIONS>& exposed,
                   FeatureMask* masks) {
  for (int shift = 0; shift < 64; shift += 8) {
    std::uint64_t cells = node.full >> shift & 0xff;
    if (cells == 0) continue;
    std::uint64_t faces = 0;  // a byte for each cell
    for (int d = 0; d < FACE_DIRECTIONS; ++d) faces |= BYTE_OF_BIT[exposed[d] >> shift & 0xff] << d;
    const bool is_one = cells == 0xff && (node.start >> shift & 0xff) == 1;
    FeatureMask all = 0;
    for (; cells != 0; cells &= cells - 1) {
      const FeatureMask mask = FEATURES_OF_FACES[faces >> (8 * lowestBit(cells)) & 0x3f];
      all |= mask;
      if (!is_one) *masks++ = mask;
    }
    if (is_one) *masks++ = all;
  }
}

/// Leaves of one and two voxels, a level 1 node (16 voxels a side) at a time; of its blocks those that are `wanted`
/// (null: all).
void smallLeaves(VoxelTree& tree, std::uint32_t index, std::vector<FeatureMask>& masks,
                 const std::vector<std::uint8_t>* wanted) {
  const VoxelTree::Node& parent = tree.nodes(1)[index];
  if (parent.child == 0) return;
  if (wanted != nullptr) {
    const auto first = wanted->begin() + parent.first_child, last = first + bitCount(parent.child);
    if (std::find(first, last, 1) == last) return;
  }
  const std::array<std::uint16_t, 3>& at = tree.nodeCell(1, index);
  std::array<std::uint32_t, FACE_DIRECTIONS> next;
  std::array<bool, FACE_DIRECTIONS> next_full{};
  const bool has_large = tree.firstLeafOfLevel(1) < tree.leaves().size();
  for (int d = 0; d < FACE_DIRECTIONS; ++d) {
    Cell cell{at[0], at[1], at[2]};
    cell[d >> 1] += d & 1 ? 1 : -1;
    next[d] = tree.find(1, cell[0], cell[1], cell[2]);
    if (next[d] == VoxelTree::NONE && has_large) {
      next_full[d] = tree.coverage(16 * cell[0], 16 * cell[1], 16 * cell[2], 16) == Coverage::FULL;
    }
  }
  std::uint32_t child = parent.first_child;
  for (std::uint64_t children = parent.child; children != 0; children &= children - 1, ++child) {
    const unsigned bit = lowestBit(children);
    if (wanted != nullptr && !(*wanted)[child]) continue;
    const VoxelTree::Node& node = tree.nodes(0)[child];
    const std::array<std::uint8_t, 3>& cell = CELL_COORDINATES[bit];
    std::array<std::uint64_t, FACE_DIRECTIONS> exposed;
    for (int d = 0; d < FACE_DIRECTIONS; ++d) {
      std::array<std::uint8_t, 3> beside = cell;
      beside[d >> 1] = static_cast<std::uint8_t>(beside[d >> 1] + (d & 1 ? 1 : -1));
      const bool inside = beside[d >> 1] < 4;
      const unsigned beside_bit = cellBit(beside[0], beside[1], beside[2]);
      const std::uint64_t block = blockBits(tree, inside ? index : next[d], next_full[d], beside_bit);
      exposed[d] = node.full & ~neighbourBits(node.full, block, d);
    }
    blockFeatures(node, exposed, masks.data() + node.first_leaf);
    const std::uint64_t x = exposed[0] | exposed[1], y = exposed[2] | exposed[3], z = exposed[4] | exposed[5];
    tree.setFeatureCells(0, child, (x & y) | (y & z) | (z & x), x & y & z);
  }
}

/// Is some voxel of the one-voxel layer of the cube at `cell` that touches the leaf (on the cube's side away from
/// `direction`) empty?
bool layerHasGap(const VoxelTree& tree, Cell cell, std::int32_t size, int direction) {
  const Coverage coverage = tree.coverage(cell[0], cell[1], cell[2], size);
  if (coverage != Coverage::PARTIAL) return coverage == Coverage::EMPTY;
  const std::int32_t half = size / 2;
  const int axis = direction >> 1;
  if (!(direction & 1)) cell[axis] += half;
  for (int part = 0; part < 4; ++part) {
    Cell child = cell;
    if (part & 1) child[(axis + 1) % 3] += half;
    if (part & 2) child[(axis + 2) % 3] += half;
    if (layerHasGap(tree, child, half, direction)) return true;
  }
  return false;
}

/// The two cubes beside a leaf's edge, in directions db and dc: is there a place along the edge where the voxels of
/// both that touch it are empty? `b_cell` and `c_cell` are the smallest keys of the cubes, which are `size` a side.
bool edgeHasGap(const VoxelTree& tree, Cell b_cell, Cell c_cell, std::int32_t size, int db, int dc) {
  const Coverage b = tree.coverage(b_cell[0], b_cell[1], b_cell[2], size);
  const Coverage c = tree.coverage(c_cell[0], c_cell[1], c_cell[2], size);
  if (b == Coverage::FULL || c == Coverage::FULL) return false;
  if (b == Coverage::EMPTY && c == Coverage::EMPTY) return true;
  const std::int32_t half = size / 2;
  const int axis = 3 - (db >> 1) - (dc >> 1);
  // The half of each cube that touches the edge: away from its own direction, and on the edge's side along the other.
  if (!(db & 1)) b_cell[db >> 1] += half;
  if (dc & 1) b_cell[dc >> 1] += half;
  if (!(dc & 1)) c_cell[dc >> 1] += half;
  if (db & 1) c_cell[db >> 1] += half;
  if (edgeHasGap(tree, b_cell, c_cell, half, db, dc)) return true;
  b_cell[axis] += half;
  c_cell[axis] += half;
  return edgeHasGap(tree, b_cell, c_cell, half, db, dc);
}

/// Leaves of four voxels and more, whose neighbours may be of any size: recursion only where these are mixed.
FeatureMask largeLeaf(const VoxelTree& tree, const OccupiedLeaf& leaf) {
  const std::int32_t size = static_cast<std::int32_t>(leaf.size);
  const Cell own{leaf.min.x, leaf.min.y, leaf.min.z};
  const auto beside = [&](int direction) {
    Cell cell = own;
    cell[direction >> 1] += direction & 1 ? size : -size;
    return cell;
  };
  unsigned faces = 0;
  for (int d = 0; d < FACE_DIRECTIONS; ++d) {
    if (layerHasGap(tree, beside(d), size, d)) faces |= 1u << d;
  }
  FeatureMask mask = FEATURES_OF_FACES[faces];
  for (int axis = 0; axis < 3; ++axis) {
    for (int sides = 0; sides < 4; ++sides) {
      const int db = 2 * ((axis + 1) % 3) + (sides & 1), dc = 2 * ((axis + 2) % 3) + (sides >> 1);
      const FeatureMask bit = 1u << edgeBit(axis, sides & 1, sides >> 1);
      if ((mask & bit) && !edgeHasGap(tree, beside(db), beside(dc), size, db, dc)) mask &= ~bit;
    }
  }
  for (int sides = 0; sides < 8; ++sides) {
    const FeatureMask bit = 1u << cornerBit(sides & 1, sides >> 1 & 1, sides >> 2);
    if (!(mask & bit)) continue;
    for (int axis = 0; axis < 3 && (mask & bit); ++axis) {
      Cell voxel = own;
      for (int a = 0; a < 3; ++a) voxel[a] += sides >> a & 1 ? size - 1 : 0;
      voxel[axis] += sides >> axis & 1 ? 1 : -1;
      if (tree.coverage(voxel[0], voxel[1], voxel[2], 1) == Coverage::FULL) mask &= ~bit;
    }
  }
  return mask;
}

/// Cells of leaves of four voxels and more: all of a leaf's cells stand for its edges and corners.
void markFeatureCells(VoxelTree& tree, int level, std::uint32_t index, const std::vector<FeatureMask>& masks) {
  const VoxelTree::Node& node = tree.nodes(level)[index];
  std::uint64_t edges = 0, corners = 0;
  for (std::uint64_t bits = node.full; bits != 0; bits &= bits - 1) {
    const FeatureMask mask = masks[node.leafAt(lowestBit(bits))];
    const std::uint64_t cell = bits & (~bits + 1);
    if (mask & EDGE_MASK) edges |= cell;
    if (mask & CORNER_MASK) corners |= cell;
  }
  tree.setFeatureCells(level, index, edges, corners);
}

/// Of all leaves, once those of level 0 are known.
void markFeatureCells(VoxelTree& tree, const std::vector<FeatureMask>& masks) {
  for (int level = 1; level < VoxelTree::LEVELS; ++level) {
    for (std::uint32_t index = 0; index < tree.nodes(level).size(); ++index) {
      markFeatureCells(tree, level, index, masks);
    }
  }
  tree.raiseFeatureCells();
}

/// Directions in which the cells beside a block's own lie in other blocks.
constexpr std::array<std::uint8_t, 64> makeBorders() {
  std::array<std::uint8_t, 64> borders{};
  for (std::size_t cell = 0; cell < 64; ++cell) {
    for (int d = 0; d < FACE_DIRECTIONS; ++d) {
      if (CELL_COORDINATES[cell][static_cast<std::size_t>(d >> 1)] == 3 * (d & 1)) borders[cell] |= 1 << d;
    }
  }
  return borders;
}
constexpr std::array<std::uint8_t, 64> BORDERS = makeBorders();

/// The masks of a tree that followed another one. A mask depends on its leaf and on the voxels beside that leaf's
/// faces, so that a voxel that changed has to do with seven leaves; the others keep theirs.
class NextMasks {
 public:
  NextMasks(VoxelTree& tree, const VoxelTree& before, const std::vector<FeatureMask>& masks_before,
            const VoxelTree::Change& change)
      : tree_(tree),
        before_(before),
        masks_before_(masks_before),
        change_(change),
        first_large_(tree.firstLeafOfLevel(1)),
        has_large_(first_large_ < tree.leaves().size()),
        whole_(tree.nodes(0).size(), 0) {}

  std::vector<FeatureMask> make() {
    masks_.reserve(tree_.leaves().size());
    takeMasks();
    for (const std::uint32_t before : change_.large_before) large_.push_back(before == VoxelTree::NONE);
    for (const Block& block : change_.blocks) lookAround(block);
    for (const OccupiedLeaf& leaf : change_.large) lookAround(leaf);
    for (std::uint32_t node = 0; any_whole_ && node < tree_.nodes(1).size(); ++node) {
      smallLeaves(tree_, node, masks_, &whole_);
    }
    for (std::size_t i = 0; i < large_.size(); ++i) {
      const OccupiedLeaf& leaf = tree_.leaves()[first_large_ + i];
      masks_.push_back(large_[i] ? largeLeaf(tree_, leaf) : masks_before_[change_.large_before[i]]);
    }
    return std::move(masks_);
  }

 private:
  using Node = VoxelTree::Node;
  using Block = VoxelTree::Change::Block;
  /// Of a block with more it costs less to look at all of it.
  static constexpr unsigned MOST_ONE_BY_ONE = 8;

  VoxelTree& tree_;
  const VoxelTree& before_;
  const std::vector<FeatureMask>& masks_before_;
  const VoxelTree::Change& change_;
  const std::uint32_t first_large_;
  const bool has_large_;
  std::vector<FeatureMask> masks_;
  std::vector<std::uint8_t> whole_, large_;  // what is looked at whole: nodes of level 0, leaves of the levels above
  bool any_whole_ = false;

  void lookAtAllOf(std::uint32_t node) { whole_[node] = any_whole_ = true; }

  /// Of all small leaves, as they were; 0 where a leaf is new.
  void takeMasks() {
    std::uint32_t from = 0;  // leaf of the tree before: the masks of those before it are taken
    const auto takeUpTo = [&](std::uint32_t to) {
      masks_.insert(masks_.end(), masks_before_.begin() + from, masks_before_.begin() + to);
      from = to;
    };
    const std::vector<Node>& old = before_.nodes(0);
    const auto firstLeaf = [&](std::uint32_t node) {
      return node < old.size() ? old[node].first_leaf : before_.firstLeafOfLevel(1);
    };
    for (const Block& block : change_.blocks) {
      const std::uint32_t first = firstLeaf(block.before), end = block.is_new ? first : firstLeaf(block.before + 1);
      if (isOneByOne(block)) {
        const std::uint64_t full = tree_.nodes(0)[block.node].full, was_full = old[block.before].full;
        for (std::uint64_t voxels = block.voxels; voxels != 0; voxels &= voxels - 1) {
          const unsigned bit = lowestBit(voxels);
          takeUpTo(first + rankBelow(was_full, bit));
          full >> bit & 1 ? masks_.push_back(0) : static_cast<void>(++from);
        }
        const std::uint64_t same = full & ~block.voxels;
        tree_.setFeatureCells(0, block.node, old[block.before].edges & same, old[block.before].corners & same);
        continue;
      }
      takeUpTo(first);
      from = end;
      if (block.node == VoxelTree::NONE) continue;
      masks_.resize(masks_.size() + bitCount(tree_.nodes(0)[block.node].start));
      lookAtAllOf(block.node);
    }
    takeUpTo(before_.firstLeafOfLevel(1));
  }
  bool isOneByOne(const Block& block) const {
    if (block.is_new || block.node == VoxelTree::NONE || bitCount(block.voxels) > MOST_ONE_BY_ONE) return false;
    const Node &node = tree_.nodes(0)[block.node], &old = before_.nodes(0)[block.before];
    return node.full == node.start && old.full == old.start;
  }

  /// Of the leaf of one voxel.
  void setFaces(std::uint32_t index, unsigned bit, FeatureMask kept, FeatureMask faces) {
    FeatureMask& mask = masks_[tree_.nodes(0)[index].leafAt(bit)];
    mask = FEATURES_OF_FACES[(mask & kept & FACE_MASK) | faces];
    tree_.setFeatureCell(index, bit, (mask & EDGE_MASK) != 0, (mask & CORNER_MASK) != 0);
  }

  /// What its changed voxels have to do with, in it and in the blocks beside it.
  void lookAround(const Block& block) {
    const bool is_there = block.node != VoxelTree::NONE;
    const std::uint64_t full = is_there ? tree_.nodes(0)[block.node].full : largeBits(block.cell);
    std::array<std::uint64_t, FACE_DIRECTIONS> exposed;
    unsigned looked = 0;  // in which directions it was looked beyond the block
    std::uint64_t touched = block.voxels;
    for (int d = 0; d < FACE_DIRECTIONS; ++d) {
      std::uint64_t beside = 0;
      if ((block.voxels & RANGE_MASKS[d >> 1][3 * (d & 1)][3 * (d & 1)]) != 0) {
        beside = lookBeside(block, d, full);
        looked |= 1u << d;
      }
      exposed[d] = ~neighbourBits(full, beside, d);
      touched |= neighbourBits(block.voxels, 0, d);
    }
    if (!is_there || whole_[block.node]) return;
    for (touched &= full; touched != 0; touched &= touched - 1) {
      const unsigned bit = lowestBit(touched), kept = BORDERS[bit] & ~looked;
      FeatureMask faces = 0;
      for (int d = 0; d < FACE_DIRECTIONS; ++d) faces |= static_cast<FeatureMask>(exposed[d] >> bit & 1) << d;
      setFaces(block.node, bit, kept, faces & ~kept);
    }
  }

  /// The leaves of the block beside it that its changed voxels touch. `full`: what is occupied in it. Returns what is
  /// occupied beside.
  std::uint64_t lookBeside(const Block& block, int d, std::uint64_t full) {
    Cell cell{block.cell[0], block.cell[1], block.cell[2]};
    cell[d >> 1] += d & 1 ? 1 : -1;
    const std::uint32_t parent = tree_.find(1, cell[0] >> 2, cell[1] >> 2, cell[2] >> 2);
    const unsigned bit_of_block = cellBit(cell[0], cell[1], cell[2]);
    if (parent == VoxelTree::NONE || !(tree_.nodes(1)[parent].child >> bit_of_block & 1)) {
      markLarge(cell);
      return largeBits(cell);
    }
    const std::uint32_t index = tree_.nodes(1)[parent].childAt(bit_of_block);
    const Node& node = tree_.nodes(0)[index];
    std::uint64_t reached = neighbourBits(0, block.voxels, d ^ 1) & node.full;
    if (reached == 0 || whole_[index]) return node.full;
    if (node.full != node.start) {
      lookAtAllOf(index);
      return node.full;
    }
    const std::uint64_t covered = neighbourBits(0, full, d ^ 1);
    for (; reached != 0; reached &= reached - 1) {
      const unsigned bit = lowestBit(reached);
      const FeatureMask face = 1u << (d ^ 1);
      setFaces(index, bit, ~face, covered >> bit & 1 ? 0 : face);
    }
    return node.full;
  }

  /// All of a block of 4^3 voxels, where a leaf of that size or more covers it; else nothing.
  template <class Coordinates>
  std::uint64_t largeBits(const Coordinates& block) const {
    if (!has_large_) return 0;
    return tree_.coverage(4 * block[0], 4 * block[1], 4 * block[2], 4) == Coverage::FULL ? ~std::uint64_t{0} : 0;
  }
  /// The leaf of four voxels and more that holds the block of 4^3 voxels.
  void markLarge(const Cell& block) {
    for (int level = 1; level < VoxelTree::LEVELS && has_large_; ++level) {
      if (tree_.firstLeafOfLevel(level) == tree_.firstLeafOfLevel(level + 1)) continue;
      const int shift = 2 * level;
      const std::uint32_t index = tree_.find(level, block[0] >> shift, block[1] >> shift, block[2] >> shift);
      if (index == VoxelTree::NONE) continue;
      const Node& node = tree_.nodes(level)[index];
      const unsigned bit = cellBit(block[0] >> (shift - 2), block[1] >> (shift - 2), block[2] >> (shift - 2));
      if (node.full >> bit & 1) large_[node.leafAt(bit) - first_large_] = 1;
    }
  }
  void lookAround(const OccupiedLeaf& leaf) {
    KeyBox box;
    const std::int32_t min[3] = {leaf.min.x, leaf.min.y, leaf.min.z}, size = static_cast<std::int32_t>(leaf.size);
    for (int axis = 0; axis < 3; ++axis) {
      box.lo[axis] = std::max(min[axis] - 1, 0);
      box.hi[axis] = std::min(min[axis] + size, VoxelTree::KEYS - 1);
    }
    tree_.visitLeaves(box, [&](std::uint32_t index) {
      if (index >= first_large_) {
        large_[index - first_large_] = 1;
        return true;
      }
      const auto after = std::upper_bound(tree_.nodes(0).begin(), tree_.nodes(0).end(), index,
                                          [](std::uint32_t i, const Node& node) { return i < node.first_leaf; });
      lookAtAllOf(static_cast<std::uint32_t>(after - tree_.nodes(0).begin()) - 1);
      return true;
    });
  }
};

}  // namespace

std::vector<FeatureMask> exposedFeatures(VoxelTree& tree) {
  std::vector<FeatureMask> masks(tree.leaves().size(), 0);
  for (std::uint32_t node = 0; node < tree.nodes(1).size(); ++node) smallLeaves(tree, node, masks, nullptr);
  for (std::size_t leaf = tree.firstLeafOfLevel(1); leaf < masks.size(); ++leaf) {
    masks[leaf] = largeLeaf(tree, tree.leaves()[leaf]);
  }
  markFeatureCells(tree, masks);
  return masks;
}

std::vector<FeatureMask> exposedFeatures(VoxelTree& tree, const VoxelTree& before,
                                         const std::vector<FeatureMask>& masks_before,
                                         const VoxelTree::Change& change) {
  std::vector<FeatureMask> masks = NextMasks(tree, before, masks_before, change).make();
  markFeatureCells(tree, masks);
  return masks;
}

}  // namespace dccd
