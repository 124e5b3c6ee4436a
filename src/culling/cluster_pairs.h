// Walks two cluster trees side by side and streams the feature pairs that the linear filter keeps.
#pragma once

#include <cstdint>
#include <limits>
#include <vector>

#include "culling/cluster_tree.h"
#include "dccd/types.h"

namespace dccd {

/// Two trees of the same height to be paired. self: both are the same tree, and each pair of slots is wanted once.
struct TreePair {
  const ClusterTree* a = nullptr;
  const ClusterTree* b = nullptr;
  bool self = false;
  Span span;
  bool adjacent = false;  ///< both are of one body: features that share a vertex are no pair
  /// Of a tree and itself, at t0: all that share a vertex, where that is known; null: it is found out.
  const simd::KnownPairs* sharing = nullptr;

  simd::GroupsView viewA(std::size_t level) const { return a->level(level).view(span.times == Times::SWEPT); }
  simd::GroupsView viewB(std::size_t level) const { return b->level(level).view(span.times == Times::SWEPT); }
};

/// What of the pairs a search that was cut did not come to.
struct SearchRest {
  double toc = std::numeric_limits<double>::infinity();  ///< nothing of it can touch before; infinity: there is none
  bool late = false;                                     ///< the deadline was over at a look
};

/// Pairs of groups of level 1, (a, b) flattened: the units of work that are spread over threads. Of more than max_pairs
/// that many are kept, the first in the trees' order; the rest is bounded as by superclusterTocBound(). The deadline
/// ends the search as max_pairs does; once it was over it is not asked again.
SearchRest superclusterPairs(const TreePair& trees, std::vector<std::uint32_t>& pairs,
                             std::vector<std::uint32_t>& scratch,
                             std::size_t max_pairs = std::numeric_limits<std::size_t>::max(),
                             const Deadline& deadline = {});

/// No features of the two level-1 groups can touch before this time, in [0, 1]; 0 only where the groups' projections
/// overlap (to two record units) in all 8 directions at t=0. The end of the bounds when they never meet until then.
double superclusterTocBound(const TreePair& trees, std::uint32_t a, std::uint32_t b);

/// Streams the surviving slot pairs of superclusters in chunks. One per worker; keeps its buffers.
class ClusterPairStream {
 public:
  static constexpr std::size_t CHUNK = 2048;  ///< slot pairs at most in a call of the sink

  ClusterPairStream();

  /// pairs: `count` pairs of level-1 groups. sink(const uint32_t* slot_pairs, size_t count) is called once per chunk,
  /// as long as it returns true. False: it did not.
  template <class Sink>
  bool run(const TreePair& trees, const std::uint32_t* pairs, std::size_t count, Sink&& sink) {
    std::size_t done = 0;
    while (done < count) {
      std::size_t consumed = 0;
      const std::size_t clusters =
          simd::testGroupPairs(trees.viewA(1), trees.viewB(1), pairs + 2 * done, count - done, trees.self,
                               simd::Diagonal::UPPER_WITH_DIAGONAL, trees.span.times != Times::BOTH, clusters_.data(),
                               CLUSTER_PAIRS, &consumed);
      done += consumed;
      for (std::size_t i = 0; i < clusters; ++i) {
        trees.a->needLeaves(clusters_[2 * i]);
        trees.b->needLeaves(clusters_[2 * i + 1]);
      }
      std::size_t leaf_done = 0;
      while (leaf_done < clusters) {
        const std::uint32_t* from = clusters_.data() + 2 * leaf_done;
        const bool swept = trees.span.times == Times::SWEPT, one_end = trees.span.times != Times::BOTH;
        const std::size_t found =
            trees.sharing ? simd::testOtherPairs(trees.a->leaves(false), from, clusters - leaf_done, *trees.sharing,
                                                 slots_.data(), CHUNK, &consumed)
            : trees.adjacent
                ? simd::testUnsharedPairs(trees.a->leaves(swept), trees.b->leaves(swept), from, clusters - leaf_done,
                                          trees.self, one_end, slots_.data(), CHUNK, &consumed)
                : simd::testGroupPairs(trees.viewA(0), trees.viewB(0), from, clusters - leaf_done, trees.self,
                                       simd::Diagonal::STRICT_UPPER, one_end, slots_.data(), CHUNK, &consumed);
        leaf_done += consumed;
        cluster_pairs_tested_ += consumed;
        if (found && !sink(slots_.data(), found)) return false;
      }
    }
    return true;
  }

  std::uint64_t clusterPairsTested() const { return cluster_pairs_tested_; }
  void clearCounters() { cluster_pairs_tested_ = 0; }

 private:
  static constexpr std::size_t CLUSTER_PAIRS = 1024;
  std::vector<std::uint32_t> clusters_, slots_;
  std::uint64_t cluster_pairs_tested_ = 0;
};

}  // namespace dccd
