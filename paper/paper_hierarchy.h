// The paper's hierarchy: a two-level tree of SIMD 16-DOPs over triangles (Section 6). The lower level is one binary
// tree for each connected part of each body, built once and refitted every step; the upper level is a tree over the
// parts' roots, built anew every step, since parts move relative to each other.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "dccd/types.h"
#include "paper/paper_record.h"

namespace dccd {

/// Swept bounds over the 8 directions; the lanes' order of PaperRecord. Empty: smallest above largest.
struct alignas(64) Dop16 {
  float lo[PAPER_DIRECTIONS];
  float hi[PAPER_DIRECTIONS];
};

class PaperHierarchy {
 public:
  /// Splits the leaves of each part at medians of their centroids, along the longest axis. Returns the order in which
  /// the leaves are stored: leaf i of the tree is leaf order[i] of the input. part: one number a leaf, 0 ..
  /// part_count-1, every part has a leaf.
  std::vector<Index> build(const std::vector<std::array<float, 3>>& centroids, const std::vector<Index>& part);

  /// The bounds of the leaves, to be filled before update().
  Dop16* leaves() { return dops_.data(); }
  const Dop16& leaf(std::size_t i) const { return dops_[i]; }
  std::size_t leafCount() const { return leaf_count_; }

  /// Merges the parts' trees upwards and builds the upper level.
  void update();

  /// Starts a descent. part_self: one byte a part, 0 leaves out the pairs within the part.
  void begin(const std::uint8_t* part_self);
  /// The next leaf pairs with overlapping bounds, 2 numbers a pair; 0 when there are no more. capacity >= 4 pairs.
  std::size_t next(std::uint32_t* pairs, std::size_t capacity);
  /// The leaves in [begin, end) whose bounds overlap leaf i's, for brute force; `out` has room for end - begin.
  std::size_t overlapping(std::size_t i, std::size_t begin, std::size_t end, std::uint32_t* out) const;

 private:
  struct Item {
    std::array<float, 3> centroid;
    Index node;
  };
  /// Builds a tree over items[0 .. count), whose nodes exist, and returns its root.
  Index buildOver(Item* items, std::size_t count, unsigned depth);

  std::size_t leaf_count_ = 0;
  std::size_t lower_end_ = 0;  // nodes of the parts' trees end here; the upper level follows
  unsigned depth_ = 0;         // of the deepest part
  std::vector<Index> children_;
  std::vector<Index> part_root_;
  std::vector<Dop16> dops_;
  std::vector<Item> items_;
  std::vector<std::uint32_t> stack_;
  std::size_t stack_size_ = 0;
};

}  // namespace dccd
