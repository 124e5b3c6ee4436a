// All bodies of a scene in the arrays that the kernels want: vertices renumbered in spatial order, cluster trees per
// body, and the ranks that give contacts their canonical order.
#pragma once

#include <cstdint>
#include <vector>

#include <hwy/aligned_allocator.h>

#include "broad_phase/cluster_tree.h"
#include "deformable_ccd/detector.h"

namespace deformable_ccd {

enum class FeatureKind : std::uint8_t { VERTEX = 0, EDGE = 1, FACE = 2 };

/// One body: where its elements are in the scene's arrays.
struct SceneBody {
  BodySetup setup;
  Index vertex_begin = 0;  ///< of the input numbering; vertices of all bodies follow each other
  Index edge_begin = 0, face_begin = 0;
  std::vector<Index> slot_vertex;    ///< internal vertex - internal_begin -> local vertex
  Index internal_begin = 0;          ///< internal numbering holds the used vertices only
  ClusterTree trees[3];              ///< by FeatureKind, over internal vertices
  std::vector<Index> ranks[3];       ///< slot -> rank: vertex_begin + local vertex, edge rank, face rank
  std::vector<std::uint8_t> active;  ///< per used vertex; what the trees are masked with
  bool masked = false;
  bool translates = false;  ///< all vertices have exactly the same displacement in this step (at rest included)

  const ClusterTree& tree(FeatureKind k) const { return trees[static_cast<int>(k)]; }
  const std::vector<Index>& rank(FeatureKind k) const { return ranks[static_cast<int>(k)]; }
  /// Every vertex of the feature in the slot is active.
  bool holds(FeatureKind k, std::size_t slot) const {
    if (!masked) return true;
    const ClusterTree& t = tree(k);
    for (std::size_t i = 0; i < t.arity(); ++i) {
      if (!active[t.feature(slot)[i] - internal_begin]) return false;
    }
    return true;
  }
  std::size_t usedCount() const { return slot_vertex.size(); }
};

class SceneArrays {
 public:
  /// Throws std::invalid_argument naming the body when positions and topology do not fit.
  void setBodies(std::vector<BodySetup> bodies, const std::vector<const Positions*>& rest_positions);

  /// Copies the positions, leaves out what is not finite or not active, and sets the record scale.
  /// Throws std::invalid_argument naming the body when a frame has the wrong number of vertices.
  void record(const MotionStep& step, core::StepStats& stats);

  /// Records and bounds of every body. pieces(n, f): calls f(first, last) over [0, n), in parallel or not.
  template <class Pieces>
  void refit(const Pieces& pieces) {
    pieces(vertex_count_, [this](std::size_t first, std::size_t last) { quantize(first, last); });
    const std::int16_t* margin = largest_separation_ > 0 ? margin_ : nullptr;
    for (SceneBody& body : bodies_) {
      for (ClusterTree& tree : body.trees) {
        pieces(tree.level(0).groups, [&](std::size_t first, std::size_t last) {
          tree.refitLeaves(records_.data(), margin, first, last);
        });
        tree.refitUpper();
      }
    }
    refitBodies();
  }

  const std::vector<SceneBody>& bodies() const { return bodies_; }
  const VertexMotion* vertices() const { return vertices_.get(); }
  std::size_t vertexCount() const { return vertex_count_; }
  /// Bounds of the bodies as a tree whose features are the bodies.
  const ClusterTree::Level& bodyLevel(std::size_t l) const { return body_levels_[l]; }
  std::size_t bodyLevels() const { return body_levels_.size(); }
  /// Pairs of different bodies, flattened, the smaller index first, whose bounds overlap (t0_only: at t=0).
  void overlappingBodies(bool t0_only, std::vector<std::uint32_t>& pairs, std::vector<std::uint32_t>& scratch) const;
  std::size_t height() const { return height_; }
  double largestSeparation() const { return largest_separation_; }

  /// The body-local vertices (1, 2 or 3) of the feature with the rank, in the input's order.
  void featureVertices(FeatureKind kind, std::size_t body, Index rank, Index* out) const;

  /// Real width of a record unit per direction and the real value of record 0, for bounds on times.
  const double* unit() const { return unit_; }

  std::size_t memoryBytes() const;

 private:
  void quantize(std::size_t first, std::size_t last);
  void refitBodies();

  std::vector<SceneBody> bodies_;
  std::vector<Index> face_order_;  // face rank -> face of the input (all bodies)
  hwy::AlignedFreeUniquePtr<VertexMotion[]> vertices_;
  AlignedRecords records_;
  std::size_t vertex_count_ = 0, vertex_capacity_ = 0;
  std::size_t height_ = 2;
  double low_[8] = {}, scale_[8] = {}, unit_[8] = {};
  std::int16_t margin_[16] = {};
  double largest_separation_ = 0;
  std::vector<ClusterTree::Level> body_levels_;
  AlignedRecords body_bounds_;
};

}  // namespace deformable_ccd
