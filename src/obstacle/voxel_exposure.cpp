#include "obstacle/voxel_exposure.h"

#include <algorithm>

namespace dccd {
namespace exposure {
namespace {

using Coverage = VoxelTree::Coverage;

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

}  // namespace

FeatureMask featuresOf(FeatureMask faces) { return FEATURES_OF_FACES[faces]; }

void setSmallLeaves(VoxelTree& tree, std::uint32_t index, std::vector<FeatureMask>& masks,
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

namespace {

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

}  // namespace

/// Recursion only where the neighbours are mixed.
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

/// All cells of a leaf of four voxels and more stand for its edges and corners.
void markFeatureCells(VoxelTree& tree, const std::vector<FeatureMask>& masks) {
  for (int level = 1; level < VoxelTree::LEVELS; ++level) {
    for (std::uint32_t index = 0; index < tree.nodes(level).size(); ++index) {
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
  }
  tree.raiseFeatureCells();
}

}  // namespace exposure

std::vector<FeatureMask> exposedFeatures(VoxelTree& tree) {
  std::vector<FeatureMask> masks(tree.leaves().size(), 0);
  for (std::uint32_t node = 0; node < tree.nodes(1).size(); ++node)
    exposure::setSmallLeaves(tree, node, masks, nullptr);
  for (std::size_t leaf = tree.firstLeafOfLevel(1); leaf < masks.size(); ++leaf) {
    masks[leaf] = exposure::largeLeaf(tree, tree.leaves()[leaf]);
  }
  exposure::markFeatureCells(tree, masks);
  return masks;
}

}  // namespace dccd
