// The masks of a tree that followed another one, made of that one's.
#include <algorithm>

#include "obstacle/voxel_exposure.h"

namespace dccd {
namespace exposure {
namespace {

/// A mask depends on its leaf and on the voxels beside that leaf's faces, so that a voxel that changed has to do with
/// seven leaves; the others keep theirs.
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
      setSmallLeaves(tree_, node, masks_, &whole_);
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
    mask = featuresOf((mask & kept & FACE_MASK) | faces);
    tree_.setFeatureCell(index, bit, (mask & EDGE_MASK) != 0, (mask & CORNER_MASK) != 0);
  }

  /// What its changed voxels have to do with, in it and in the blocks beside it.
  void lookAround(const Block& block) {
    const bool is_there = block.node != VoxelTree::NONE;
    const std::uint64_t full = is_there ? tree_.nodes(0)[block.node].full : largeBits(block.cell);
    std::array<std::uint64_t, FACE_DIRECTIONS> exposed, unknown;  // by what is not looked at beyond the block
    std::uint64_t touched = block.voxels;
    for (int d = 0; d < FACE_DIRECTIONS; ++d) {
      const std::uint64_t border = RANGE_MASKS[d >> 1][3 * (d & 1)][3 * (d & 1)];
      const bool looks = (block.voxels & border) != 0;
      unknown[d] = looks ? 0 : border;
      exposed[d] = ~neighbourBits(full, looks ? lookBeside(block, d, full) : 0, d);
      touched |= neighbourBits(block.voxels, 0, d);
    }
    if (!is_there || whole_[block.node]) return;
    for (touched &= full; touched != 0; touched &= touched - 1) {
      const unsigned bit = lowestBit(touched);
      FeatureMask faces = 0, kept = 0;
      for (int d = 0; d < FACE_DIRECTIONS; ++d) {
        faces |= static_cast<FeatureMask>(exposed[d] >> bit & 1) << d;
        kept |= static_cast<FeatureMask>(unknown[d] >> bit & 1) << d;
      }
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
    return tree_.coverage(4 * block[0], 4 * block[1], 4 * block[2], 4) == VoxelTree::Coverage::FULL ? ~std::uint64_t{0}
                                                                                                    : 0;
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
}  // namespace exposure

std::vector<FeatureMask> exposedFeatures(VoxelTree& tree, const VoxelTree& before,
                                         const std::vector<FeatureMask>& masks_before,
                                         const VoxelTree::Change& change) {
  std::vector<FeatureMask> masks = exposure::NextMasks(tree, before, masks_before, change).make();
  exposure::markFeatureCells(tree, masks);
  return masks;
}

}  // namespace dccd
