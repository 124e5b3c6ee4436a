// How clusters move during a step: each as a rigid motion, and by how much its vertices miss that.
//
// What keeps two clusters apart from one step to the next is that most of a body's motion bends nothing: the distance
// of two features survives any rotation. So the vertices are taken in blocks that lie together, each block gets the
// rotation and the shift that fit it best, and what counts is the residual, the distance of a vertex from where these
// put it.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "culling/scene_arrays.h"
#include "dccd/tolerances.h"

namespace dccd {

/// What a pair of clusters does during a step, seen from the first one's rotation.
struct ClusterPairMotion {
  double residual_m = 0;   ///< no distance between them is smaller at t=1 than it was at t=0 by more than this
  double half_cosine = 1;  ///< and none smaller during the step than this share of it, less the residual
};

/// In proof: let a and b be points of two features, moving on straight lines, and r(t) their difference. With a
/// rotation Q, r(1) = Q r(0) + e, where |e| is at most the sum of what their features' vertices miss of one and the
/// same rigid motion: a point is a convex combination of the vertices. So |r(1)| >= |r(0)| - |e|. Along the axis of Q,
/// (1-t) r(0) + t Q r(0) keeps its length; across it, with the angle w, its length is |1-t + t exp(iw)| >= cos(w/2)
/// times that of r(0). So |r(t)| >= cos(w/2) |r(0)| - |e| for all t. Both grow with |r(0)|, so that a lower bound of
/// the distance at t=0 may take its place.
class ClusterMotion {
 public:
  /// Vertices of the same block have the same rigid motion, those of the same piece of a block the same residual.
  static constexpr std::size_t BLOCK = 64, PIECE = 16;

  /// Bodies of the scene as they were set.
  void setBodies(const SceneArrays& scene);
  bool isSet() const { return !bodies_.empty(); }
  void clear();

  /// Of the step whose records and bounds the scene has. pieces(n, f): calls f(first, last) over [0, n).
  template <class Pieces>
  void run(const SceneArrays& scene, const Pieces& pieces) {
    slop_m_ = slop(scene);
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      const bool was_still = bodies_[b].still;
      bodies_[b].still = scene.bodies()[b].kept && (was_still || isStill(scene, b));
      if (bodies_[b].still && was_still) continue;  // the clusters are where they were
      pieces(bodies_[b].blocks.size(), [&](std::size_t first, std::size_t last) { fitBlocks(scene, b, first, last); });
      for (int kind = 0; kind < 3; ++kind) {
        pieces(bodies_[b].clusters[kind].size(),
               [&](std::size_t first, std::size_t last) { boundClusters(scene, b, kind, first, last); });
      }
    }
  }

  /// Of clusters x and y of the trees of a kind of bodies a and b.
  ClusterPairMotion between(std::size_t a, FeatureKind kind_a, std::uint32_t x, std::size_t b, FeatureKind kind_b,
                            std::uint32_t y) const {
    const BodyMotion &one = bodies_[a], &other = bodies_[b];
    if (one.still && other.still) return {};
    static const Block at_rest{};
    const Cluster &p = one.clusters[static_cast<int>(kind_a)][x], &q = other.clusters[static_cast<int>(kind_b)][y];
    const Block& from = one.still ? at_rest : one.blocks[p.block];
    const Block& to = other.still ? at_rest : other.blocks[q.block];
    double residual = (one.still ? 0 : p.residual) + (other.still ? 0 : q.residual) + slop_m_;
    if (&from != &to) residual += from.misses(to, q);
    return {residual, from.half_cosine * (1 - tolerance::LENGTH)};
  }

  /// Rounding of a distance between two points of the scene, and of what a pair consumes, from above: each residual is
  /// the length of a sum of products below 8 times the size, each rounded less than 8 times; a pair has three of them
  /// and a difference of rotations. Together that is below 2^-46 of the size.
  static double slop(const SceneArrays& scene) { return tolerance::RESIDUAL * scene.size(); }
  std::size_t bytes() const;

 private:
  struct Cluster {
    double centre[3] = {0, 0, 0};  ///< at t=0
    double radius = 0;             ///< around it
    double residual = 0;           ///< of its vertices, from the motion of its block
    std::uint32_t block = 0;       ///< in which most of its vertices are
    std::uint32_t first_link = 0;  ///< the pieces of blocks in which its vertices are, up to the next cluster's
  };
  /// x -> rotation (x - from) + to.
  struct Block {
    double rotation[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    double from[3] = {0, 0, 0}, to[3] = {0, 0, 0};
    double half_cosine = 1;
    double residual[BLOCK / PIECE] = {};  ///< of its pieces

    void fit(const VertexMotion* v, std::size_t n);      ///< the motion of n vertices, as well as it can be
    void measure(const VertexMotion* v, std::size_t n);  ///< the residuals, from above
    void move(const double* x, double* y) const {
      const double d[3] = {x[0] - from[0], x[1] - from[1], x[2] - from[2]};
      for (int i = 0; i < 3; ++i) {
        y[i] = rotation[3 * i] * d[0] + rotation[3 * i + 1] * d[1] + rotation[3 * i + 2] * d[2] + to[i];
      }
    }
    /// How far apart two motions bring a point of the cluster's ball: it is where they bring the centre, and the
    /// difference of the rotations turns the rest.
    double misses(const Block& other, const Cluster& of) const {
      double here[3], there[3];
      move(of.centre, here);
      other.move(of.centre, there);
      double shift = 0, turn = 0;
      for (int i = 0; i < 3; ++i) shift += (here[i] - there[i]) * (here[i] - there[i]);
      for (int i = 0; i < 9; ++i) turn += (rotation[i] - other.rotation[i]) * (rotation[i] - other.rotation[i]);
      return (std::sqrt(shift) + std::sqrt(turn) * of.radius) * (1 + tolerance::LENGTH);
    }
  };
  struct BodyMotion {
    std::vector<Block> blocks;
    std::vector<Cluster> clusters[3];  // by FeatureKind
    std::vector<std::uint32_t> links[3];
    bool still = false;  ///< no vertex moves in this step
  };

  static bool isStill(const SceneArrays& scene, std::size_t body);
  void fitBlocks(const SceneArrays& scene, std::size_t body, std::size_t first, std::size_t last);
  void boundClusters(const SceneArrays& scene, std::size_t body, int kind, std::size_t first, std::size_t last);

  std::vector<BodyMotion> bodies_;
  double slop_m_ = 0;  ///< of the step that run() has seen
};

}  // namespace dccd
