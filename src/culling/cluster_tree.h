// Features of one kind of one body, in clusters of 16 and clusters of clusters (16-ary), refitted every step.
// The bounds of every level are 16-DOPs of both ends of the step: per direction the smallest and largest projection at
// t0 and at t1, which is tighter than a DOP of the swept volume (two slabs that only pass each other stay apart).
#pragma once

#include <atomic>
#include <cstdint>
#include <vector>

#include <hwy/aligned_allocator.h>

#include "dccd/types.h"
#include "simd/group_pairs.h"

namespace dccd {

/// Order in which items near each other in space come near each other in memory, so that every aligned run of 16^k
/// items is compact: recursive median splits of the longest side, at multiples of 16^k. Deterministic.
std::vector<Index> spatialOrder(const std::vector<Vec3>& centres);

/// uint16 arrays aligned for vector loads; grows only.
class AlignedRecords {
 public:
  void resize(std::size_t n);
  std::uint16_t* data() { return data_.get(); }
  const std::uint16_t* data() const { return data_.get(); }

 private:
  hwy::AlignedFreeUniquePtr<std::uint16_t[]> data_;
  std::size_t capacity_ = 0;
};

/// Which bounds are tested: those at both ends, the same way round; those at t0 alone; or swept ones.
enum class Times : std::uint8_t { BOTH, T0, SWEPT };

/// The time that bounds cover: it ends at `end` in the place of t1. `times`: which of the bounds are tested.
struct Span {
  double end = 1;
  Times times = Times::BOTH;
};

class ClusterTree {
 public:
  struct Level {
    std::size_t groups = 0;
    AlignedRecords soa, aos;
    /// Without the features' vertices. swept: bounds that shorten() has swept, in the place of those at t0.
    simd::GroupsView view(bool swept = false) const {
      return {soa.data() + (swept ? simd::SOA_T1 : 0), aos.data() + (swept ? simd::DIRECTIONS : 0)};
    }
  };

  /// features: vertex indices, `arity` each, in the order given by spatialOrder. Slots are feature positions, filled up
  /// with empty ones to a multiple of 16.
  void build(std::vector<Index> features, std::size_t arity);

  /// Gives the tree at least `height` levels (single groups on top), so that two trees can be walked in step.
  void raise(std::size_t height);

  /// Leaves out the features for which any vertex has active[vertex] == 0. Null: none.
  void mask(const std::uint8_t* active);

  /// Recomputes all bounds from the vertices' records. margin16: see simd::buildLeaves.
  void refitLeaves(const std::uint16_t* records, const std::uint16_t* margin16, std::size_t first_group,
                   std::size_t last_group);
  /// Before a refit. wait: refitGroups() follows in the place of refitLeaves(), and needLeaves() makes the leaves of
  /// those groups that are asked for, from the same records, without margins.
  void letLeavesWait(bool wait, const std::uint16_t* records);
  void refitGroups(std::size_t first_group, std::size_t last_group);
  /// Of what was refitted from these records without margins, leaves wait again, and take no memory until then.
  void releaseLeaves(const std::uint16_t* records);
  void refitUpper();
  /// Before a group of leaves is looked at. Of any number of threads one makes them, and the others wait for it.
  void needLeaves(std::size_t group) const {
    if (leaves_wait_ && made_[group].load(std::memory_order_acquire) != MADE) makeLeaves(group);
  }
  /// simd::shortenBounds() of the groups of a level.
  void shorten(std::size_t level, std::int32_t end, bool swept, std::size_t first_group, std::size_t last_group);

  std::size_t featureCount() const { return feature_count_; }
  std::size_t arity() const { return arity_; }
  std::size_t height() const { return levels_.size(); }
  const Level& level(std::size_t l) const { return levels_[l]; }
  /// The leaves, with the features' vertices.
  simd::GroupsView leaves(bool swept) const {
    simd::GroupsView view = levels_[0].view(swept);
    view.vertices = lanes_.get();
    view.arity = arity_;
    return view;
  }
  /// Vertex indices of the feature in a slot; only slots below featureCount() hold one.
  const Index* feature(std::size_t slot) const { return features_.data() + slot * arity_; }
  /// The same vertices in the layout of groups: the next vertex of the feature is GROUP further on. The test for shared
  /// vertices has just read this copy. ARITY: arity().
  template <std::size_t ARITY>
  const Index* lane(std::size_t slot) const {
    return lanes_.get() + (slot / simd::GROUP * ARITY * simd::GROUP + slot % simd::GROUP);
  }
  /// Vertex indices of the features that the bounds of a group's 16 slots hold; NO_INDEX where a slot is masked or
  /// empty.
  const Index* boundedGroup(std::size_t group) const {
    return (masked_.empty() ? features_ : masked_).data() + group * simd::GROUP * arity_;
  }

 private:
  static constexpr std::uint8_t WAITS = 0, IS_BEING_MADE = 1, MADE = 2;
  void makeLeaves(std::size_t group) const;

  std::size_t feature_count_ = 0;
  std::size_t arity_ = 1;
  std::vector<Index> features_;               // slots x arity, empty ones NO_INDEX
  hwy::AlignedFreeUniquePtr<Index[]> lanes_;  // features_ group by group, a vertex of each lane after another
  std::vector<Index> masked_;                 // the same with left-out ones NO_INDEX; empty when nothing is left out
  mutable std::vector<Level> levels_;         // that of leaves is made when it is asked for
  bool leaves_wait_ = false;                  // some of them may, for
  const std::uint16_t* records_ = nullptr;
  mutable std::vector<std::atomic<std::uint8_t>> made_;  // per group of leaves
};

}  // namespace dccd
