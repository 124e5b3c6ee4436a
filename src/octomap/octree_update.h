// One view's hits and misses to an octree of liboctomap's, and the lists of its leaves from those before: each cube
// that the view reached is visited once, in Morton order, from the root down.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include <octomap/OcTree.h>

#include "obstacle/leaf_sets.h"
#include "octomap/leaf_lists.h"

namespace dccd {

/// What a view says of a cube's voxels: that none was seen through, that all were, or that its parts must be asked.
enum class Seen : std::uint8_t { NONE, SOME, ALL };

/// A voxel in which a point lies, as a word: its Morton code, and whether the point fills it. Else it only keeps it
/// from being cleared.
inline std::uint64_t endWord(std::uint64_t code, bool fills) { return code << 1 | (fills ? 1u : 0u); }

class CloudTree : public octomap::OcTree {
 public:
  using octomap::OcTree::OcTree;
  /// That of an empty tree; no leaf, once it has children.
  octomap::OcTreeNode* makeRoot() {
    root = new octomap::OcTreeNode();
    ++tree_size;
    return root;
  }
};

/// In Morton order, pruned leaves unexpanded.
struct TreeLeaves {
  std::vector<OccupiedLeaf> occupied, free;
  std::vector<OccupiedLeaf> doubtful;  ///< voxels: CloudMap::doubtful()
  std::vector<OccupiedLeaf> found;     ///< voxels that a point of this view fills

  void clear() {
    for (std::vector<OccupiedLeaf>* list : {&occupied, &free, &doubtful, &found}) list->clear();
  }
};

struct UpdateLimits {
  KeyBox box;             ///< what is not there stays as it is
  std::size_t nodes = 0;  ///< of the tree; some dozens more may be made
};

/// Look: Seen look(cube) of a cube of several voxels or of one, in which no point lies; bool crosses(cube) of a voxel
/// of which look() says SOME. They are asked in Morton order.
template <class Look>
class OctreeUpdate {
 public:
  /// ends: by their words, those that fill within the limits. after: empty; a long list's memory is worth keeping.
  OctreeUpdate(CloudTree& tree, const TreeLeaves& before, const std::vector<std::uint64_t>& ends, Look& look,
               const UpdateLimits& limits, TreeLeaves& after)
      : tree_(tree),
        ends_(ends),
        look_(look),
        limits_(limits),
        least_(tree.getClampingThresMinLog()),
        most_(tree.getClampingThresMaxLog()),
        after_(after),
        occupied_(before.occupied, after_.occupied),
        free_(before.free, after_.free),
        doubtful_(before.doubtful, after_.doubtful) {}

  /// after: the leaves from then on. isFull(): there was no room for all of the view.
  void run() {
    path_[0].node = tree_.getRoot();
    visit(0);
    for (Range* list : {&occupied_, &free_, &doubtful_}) list->keepAll();
  }
  bool isFull() const { return full_; }

 private:
  using Node = octomap::OcTreeNode;
  static constexpr int VOXEL_DEPTH = 16;

  /// A list before and after. What is not skipped is kept, and written down once something behind it changes: of most
  /// cubes nothing does.
  class Range {
   public:
    Range(const std::vector<OccupiedLeaf>& from, std::vector<OccupiedLeaf>& to) : from_(from), to_(to) {
      to_.reserve(from.size() + from.size() / 16);
      goTo(0);
    }
    bool isIn(const OctreeCube& cube) {
      keepBefore(cube.code);
      return next_code_ < cube.end();
    }
    void skip(const OctreeCube& cube) {
      keepBefore(cube.code);
      while (next_code_ < cube.end()) goTo(next_ + 1);
    }
    /// Behind all that was listed so far.
    void list(const OctreeCube& cube) {
      keepBefore(cube.code);
      to_.push_back(cube.leaf());
    }
    /// What is in the cube, listed or kept, is there no more.
    void remove(const OctreeCube& cube) {
      skip(cube);
      while (!to_.empty() && cube.holds(to_.back())) to_.pop_back();
    }
    void keepAll() { keepBefore(NO_CODE); }

   private:
    const std::vector<OccupiedLeaf>& from_;
    std::vector<OccupiedLeaf>& to_;
    std::size_t next_ = 0;
    std::uint64_t next_code_ = 0;  // that leaf's; behind the last one NO_CODE

    static constexpr std::uint64_t NO_CODE = ~std::uint64_t{0};
    void goTo(std::size_t next) {
      next_ = next;
      next_code_ = next < from_.size() ? codeOf(from_[next]) : NO_CODE;
    }
    void keepBefore(std::uint64_t code);
  };

  /// A cube on the way from the root to the one that is visited.
  struct Step {
    OctreeCube cube;
    unsigned index = 0;           // among its siblings
    Node* node = nullptr;         // null: there is none
    const Node* cover = nullptr;  // then: the leaf above that stands for it, if there is one
    bool is_new = false;          // has no children yet, and is no leaf
    bool was_covered = false;     // the leaves before do not list it: a leaf above was divided
    bool divided = false;         // and it was this one
    bool changed = false;
  };

  CloudTree& tree_;
  const std::vector<std::uint64_t>& ends_;
  Look& look_;
  const UpdateLimits limits_;
  const float least_, most_;
  TreeLeaves& after_;
  Range occupied_, free_, doubtful_;
  std::size_t end_ = 0;  // the next of ends_
  std::array<Step, VOXEL_DEPTH + 1> path_;
  bool full_ = false;

  void visit(int depth) {
    Step& at = path_[depth];
    if (end_ < ends_.size() && ends_[end_] >> 1 < at.cube.end()) return depth == VOXEL_DEPTH ? end() : divide(depth);
    if (full_ || !meets(at.cube.leaf(), limits_.box) || (isLeast(leafOf(at)) && !doubtful_.isIn(at.cube)))
      return keep(at);
    Seen seen = look_.look(at.cube);
    if (seen == Seen::SOME && depth == VOXEL_DEPTH) seen = look_.crosses(at.cube) ? Seen::ALL : Seen::NONE;
    if (seen == Seen::NONE) return keep(at);
    if (seen == Seen::SOME || !isInside(at.cube.leaf(), limits_.box)) return divide(depth);
    miss(depth);
  }

  void divide(int depth) {
    Step& at = path_[depth];
    if (at.node) fetchParts(at.node);
    for (unsigned i = 0; i < 8; ++i) {
      Step& part = path_[depth + 1];
      part = Step();
      part.cube = at.cube.child(i);
      part.index = i;
      if (at.node && tree_.nodeChildExists(at.node, i)) part.node = tree_.getNodeChild(at.node, i);
      if (!part.node) part.cover = leafOf(at);
      part.was_covered = at.divided;
      visit(depth + 1);
      at.changed = at.changed || part.changed;
    }
    if (at.changed) {
      fold(at.node, at.cube);
    } else if (at.node && leafOf(at)) {
      keep(at);
    }
  }

  /// A leaf above that is not divided stands for it, or is kept; the parts of one that is are listed then.
  void keep(const Step& at) {
    if (at.node && at.was_covered) list(at.cube, at.node);
  }

  /// All of the cube, in which no point lies.
  void miss(int depth) {
    Step& at = path_[depth];
    doubtful_.skip(at.cube);
    if (isLeast(leafOf(at))) return keep(at);
    take(depth);
    missTree(at.node, at.cube);
  }
  void missTree(Node* node, const OctreeCube& cube) {
    if (!tree_.nodeHasChildren(node)) {
      tree_.updateNodeLogOdds(node, tree_.getProbMissLog());
      return list(cube, node);
    }
    fetchParts(node);
    for (unsigned i = 0; i < 8; ++i) {
      const bool exists = tree_.nodeChildExists(node, i);
      if (exists || !full_) missTree(exists ? tree_.getNodeChild(node, i) : make(node, i), cube.child(i));
    }
    fold(node, cube);
  }

  /// The voxel in which points lie.
  void end() {
    Step& at = path_[VOXEL_DEPTH];
    bool fills = false;
    for (; end_ < ends_.size() && ends_[end_] >> 1 < at.cube.end(); ++end_) fills = fills || (ends_[end_] & 1) != 0;
    if (!fills || full_) return keep(at);
    doubtful_.skip(at.cube);
    after_.found.push_back(at.cube.leaf());
    const Node* leaf = leafOf(at);
    if (leaf && leaf->getLogOdds() >= most_) return keep(at);
    take(VOXEL_DEPTH);
    tree_.updateNodeLogOdds(at.node, tree_.getProbHitLog());
    list(at.cube, at.node);
    if (!tree_.isNodeOccupied(at.node)) doubtful_.list(at.cube);
  }

  /// The cube's node is there from then on, and what is below it will be listed anew.
  void take(int depth) {
    Step& at = path_[depth];
    reach(depth);
    if (!at.was_covered) {
      occupied_.skip(at.cube);
      free_.skip(at.cube);
    }
    at.is_new = false;
    at.changed = true;
  }
  Node* reach(int depth) {
    Step& at = path_[depth];
    if (at.node) return at.node;
    at.is_new = true;
    if (depth == 0) return at.node = tree_.makeRoot();
    Step& up = path_[depth - 1];
    reach(depth - 1);
    if (!leafOf(up)) return at.node = make(up.node, at.index);
    if (!up.was_covered) {
      occupied_.skip(up.cube);
      free_.skip(up.cube);
    }
    tree_.expandNode(up.node);
    full_ = full_ || tree_.size() > limits_.nodes;
    up.divided = at.was_covered = true;
    at.is_new = false;
    for (unsigned i = 0; i < at.index; ++i) list(up.cube.child(i), tree_.getNodeChild(up.node, i));
    return at.node = tree_.getNodeChild(up.node, at.index);
  }
  Node* make(Node* above, unsigned index) {
    full_ = full_ || tree_.size() > limits_.nodes;
    return tree_.createNodeChild(above, index);
  }

  /// They lie anywhere, and each will be asked.
  void fetchParts(const Node* node) const {
    for (unsigned i = 0; i < 8; ++i) {
      if (tree_.nodeChildExists(node, i)) __builtin_prefetch(tree_.getNodeChild(node, i));
    }
  }

  void list(const OctreeCube& cube, const Node* leaf) { (tree_.isNodeOccupied(leaf) ? occupied_ : free_).list(cube); }
  /// Once the parts of a cube have changed: as OcTree::updateNode() does.
  void fold(Node* node, const OctreeCube& cube) {
    if (!tree_.pruneNode(node)) return node->updateOccupancyChildren();
    occupied_.remove(cube);
    free_.remove(cube);
    list(cube, node);
  }

  /// The leaf that is the cube, or holds it; or null.
  const Node* leafOf(const Step& at) const {
    if (!at.node) return at.cover;
    return at.is_new || tree_.nodeHasChildren(at.node) ? nullptr : at.node;
  }
  bool isLeast(const Node* leaf) const { return leaf && leaf->getLogOdds() <= least_; }
};

template <class Look>
void OctreeUpdate<Look>::Range::keepBefore(std::uint64_t code) {
  if (next_code_ >= code) return;
  const auto isBefore = [&](const OccupiedLeaf& leaf) { return codeOf(leaf) < code; };
  // Most times there are few.
  std::size_t end = next_, step = 1;
  while (end < from_.size() && isBefore(from_[end])) {
    end = std::min(from_.size(), end + step);
    step *= 2;
  }
  const auto first = from_.begin() + static_cast<std::ptrdiff_t>(next_);
  const auto last = std::partition_point(first, from_.begin() + static_cast<std::ptrdiff_t>(end), isBefore);
  to_.insert(to_.end(), first, last);
  goTo(static_cast<std::size_t>(last - from_.begin()));
}

}  // namespace dccd
