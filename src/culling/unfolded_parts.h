// High-level culling of self-collision within parts of a surface, where the whole of it folds or is closed.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <vector>

#include "culling/scene_arrays.h"
#include "simd/surface_views.h"

namespace dccd {

/// Pairs of clusters of two trees of a surface that need not be looked at: where one of them is certain, and the other
/// one near it. Which ones are near is known once per topology, which are certain in each step.
class NearClusters {
 public:
  /// Groups of level 1 of the trees. The same tree: only pairs in ascending order are asked for.
  NearClusters(std::size_t groups_a, std::size_t groups_b, bool same_tree);
  /// For clusters a in ascending order.
  void add(std::uint32_t a, const std::vector<std::uint32_t>& near_b);
  std::vector<std::uint16_t>& certainOfA() { return certain_a_; }
  std::vector<std::uint16_t>& certainOfB() { return same_tree_ ? certain_a_ : certain_b_; }
  /// Takes out of `count` flattened pairs of clusters those that need not be looked at; returns how many are left.
  std::size_t leaveOut(std::uint32_t* pairs, std::size_t count) const;

 private:
  struct Block {
    std::uint32_t b;                              ///< group of level 1
    std::array<std::uint16_t, simd::GROUP> near;  ///< of each cluster of the other group: a bit for each one of b
  };
  const Block* find(std::uint32_t a, std::uint32_t b) const;

  bool same_tree_;
  std::vector<std::uint32_t> begin_;  // of the blocks of a group of a, by b
  std::vector<Block> blocks_;
  std::vector<std::uint16_t> certain_a_, certain_b_;  // per group of level 1: a bit for each cluster
};

/// Certifies that parts of a surface do not touch their surroundings during a step.
///
/// The faces are in cells, clusters of the faces' tree that follow each other. Around a cell r lies its part S: all
/// cells that have a vertex in common with r, or with a cell that has. Let every face of S point along a direction V
/// (n(t) . V > 0) at every t in [0,1], and let P project along V. Say that a point of the plane is covered as often as
/// it is the image of points of S; away from the image of S's border that is as often as the border winds around it,
/// since each one counts +1. Let K be the convex hull of P(r). If the border stays away from K and winds around it
/// once, the points of K are covered once. Then at no t does a feature of r meet one of S without a common vertex: the
/// common point would be two points of S with one image in K; around it S covers whole neighbourhoods of the image from
/// both, as a surface does whose faces are seen from their front, so that points near the image would be covered twice.
///
/// The border. Each of its edges belongs to a cell outside of S, too, or it is one of the mesh's own border.
/// - Outside cells. Let V be orthogonal to some of the records' directions. If the cell is beyond r in such a direction
///   d, at t=0 and at t=1 (by the records' integers, without any margin), its hull is in a half-plane H_d beside K at
///   every t. All directions and their opposites are around K in the order of their angles. Edges that follow each
///   other along the border have a vertex in common, so that their half-planes are none that lie opposite each other;
///   and seen from K the border turns from one to the other by their angle, which is less than half a turn. The sum
///   over the border, in these places, is how often it winds around K. Which edges follow each other at a vertex where
///   more than two meet does not matter to the sum.
/// - The mesh's border, where it is one path. Let it go along one of the directions, g: each of its edges from a
/// smaller
///   value to a larger one at t=0 and t=1, so at every t. Let it begin before K and end behind it. Glue a strip to it
///   that goes to infinity, to the right: it is seen from its front, too. So the points of K are covered once by S and
///   strip together, if the new border winds around K once; that has two rays in the path's place, which stay before
///   and behind K, and turns by half a turn from the first to the second.
///
/// Nothing is asked of S's topology, but that no more than two faces meet in an edge, in opposite directions. What lies
/// beyond S is not covered by the certificate, and is looked at.
class UnfoldedParts {
 public:
  using Parallel =
      std::function<void(std::size_t n, std::size_t piece, const std::function<void(std::size_t, std::size_t)>& f)>;
  static void oneByOne(std::size_t n, std::size_t, const std::function<void(std::size_t, std::size_t)>& f) { f(0, n); }

  static constexpr std::size_t CLUSTERS_OF_A_CELL = 2;
  /// A body that is not a surface has no parts. clusters_of_a_cell: 1, 2, 4, ...
  explicit UnfoldedParts(const SceneBody& body, std::size_t clusters_of_a_cell = CLUSTERS_OF_A_CELL);

  /// Certifies cells, and returns their number. The scene's bounds must be those of its vertices. The body must have no
  /// separation from itself and no inactive vertex.
  std::size_t run(const SceneBody& body, const SceneArrays& scene, const Parallel& parallel = oneByOne);
  /// Forgets what was certified.
  void clear() { certified_count_ = 0; }
  /// The same where it pays: after a run that certified next to nothing the next RUNS_LEFT_OUT are left out.
  std::size_t runWhereItPays(const SceneBody& body, const SceneArrays& scene, const Parallel& parallel);

  /// What is left out of the pairs of the body's own features; null: nothing is.
  const NearClusters* leftOut(PairKind kind) const {
    return certified_count_ > 0 ? &near_[static_cast<int>(kind)] : nullptr;
  }
  std::size_t cellCount() const { return cell_count_; }

 private:
  /// Lists of numbers, one list a cell or cluster.
  struct Lists {
    std::vector<std::uint32_t> begin{0}, items;
    void close() { begin.push_back(static_cast<std::uint32_t>(items.size())); }
    const std::uint32_t* first(std::size_t i) const { return items.data() + begin[i]; }
    const std::uint32_t* last(std::size_t i) const { return items.data() + begin[i + 1]; }
    std::size_t size(std::size_t i) const { return begin[i + 1] - begin[i]; }
  };
  /// The border goes so many times from an edge of one outside cell to one of another; by their places in the list.
  struct Turn {
    std::uint8_t from, to;
    std::uint16_t times;
  };
  /// From which outside cell the border comes to the mesh's border, and to which it goes on.
  struct Path {
    std::uint8_t from = 0, to = 0;
  };
  friend class UnfoldedPartsBuilder;
  static constexpr std::size_t MOST_OUTSIDE = 48;  ///< outside cells; a part with more is of no one shape

  void findFacedViews(const ClusterTree& faces, const VertexMotion* vertices, const Parallel& parallel);
  std::uint32_t viewsOfPart(std::size_t cell) const;
  bool isCertified(std::size_t cell, const SceneArrays& scene) const;
  int turnAtPath(std::size_t cell, std::size_t view, std::uint8_t from, std::uint8_t to,
                 const SceneArrays& scene) const;
  void markClusters();

  static constexpr std::size_t RUNS_LEFT_OUT = 15;
  /// A cell saves about twice the time that looking at all cells takes for one that is not certified.
  static constexpr std::size_t FEW = 16;  ///< one cell in so many

  std::size_t clusters_ = 0, cell_count_ = 0, certified_count_ = 0, left_out_runs_ = 0;
  std::vector<std::uint8_t> sound_;  // per cell: its part has a border that can be told of
  Lists part_;                       // cells of a cell's part, ascending
  Lists outside_;                    // cells beside it
  Lists path_;                       // vertices of the mesh's border in it, in their order
  std::vector<std::uint32_t> turn_begin_;
  std::vector<Turn> turns_;
  std::vector<Path> paths_;             // per cell
  Lists homes_[3];                      // per cluster, by FeatureKind: cells of its features; none: not all have one
  std::vector<NearClusters> near_;      // by PairKind
  std::vector<std::uint32_t> sampled_;  // one face of each cell, in groups
  std::vector<std::uint32_t> sampled_views_;  // of these
  std::vector<std::uint32_t> views_;          // per cell: views that all its faces face
  std::vector<std::uint8_t> wanted_, certified_;
  AlignedRecords bounds_;  // per cell
};

}  // namespace dccd
