// All bodies of a scene in the arrays that the kernels want: vertices renumbered in spatial order, cluster trees per
// body, and the ranks that give contacts their canonical order.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include <hwy/aligned_allocator.h>

#include "culling/cluster_tree.h"
#include "culling/seams.h"
#include "dccd/outcome.h"

namespace dccd {

enum class FeatureKind : std::uint8_t { VERTEX = 0, EDGE = 1, FACE = 2 };  // one less than it has vertices

/// The features of a pair of meshes.
constexpr FeatureKind firstKind(PairKind kind) { return static_cast<FeatureKind>(factsOf(kind).vertices[0] - 1); }
constexpr FeatureKind secondKind(PairKind kind) { return static_cast<FeatureKind>(factsOf(kind).vertices[1] - 1); }
static_assert(firstKind(PairKind::VERTEX_FACE) == FeatureKind::VERTEX);
static_assert(secondKind(PairKind::VERTEX_FACE) == FeatureKind::FACE);
static_assert(firstKind(PairKind::EDGE_EDGE) == FeatureKind::EDGE);
static_assert(secondKind(PairKind::EDGE_EDGE) == FeatureKind::EDGE);

/// What positions span.
struct Extent {
  std::shared_ptr<const Positions> of;
  Vec3 lo, hi;             ///< of coordinates that are numbers
  bool is_finite = false;  ///< all of them are
};

/// What has stood for so many steps is taken to stay, and what is soon made again of it is given back.
constexpr unsigned RESTS = 16;

/// One body: where its elements are in the scene's arrays.
struct SceneBody {
  Body setup;              ///< as it was when it was set; where it is comes with each step
  Index vertex_begin = 0;  ///< of the input numbering; vertices of all bodies follow each other
  Index edge_begin = 0, face_begin = 0;
  std::vector<Index> slot_vertex;    ///< internal vertex - internal_begin -> local vertex
  Index internal_begin = 0;          ///< internal numbering holds the used vertices only
  ClusterTree trees[3];              ///< by FeatureKind, over internal vertices
  std::vector<Index> ranks[3];       ///< slot -> rank: vertex_begin + local vertex, edge rank, face rank
  std::vector<std::uint8_t> asked;   ///< per vertex; 0: in the body's vertex_mask. Empty: no mask
  std::vector<std::uint8_t> active;  ///< per used vertex; what the trees are masked with
  bool masked = false;
  bool uncertain = false;  ///< some vertex has an uncertainty radius above 0 in this step
  bool unchanged = false;  ///< every vertex is at both ends where it was in the step before, bit for bit
  bool kept = false;       ///< nothing of it changed since the last step, nor did the range of the records
  unsigned rests = 0;      ///< steps on end in which it stood where it stood before; no more than RESTS + 1
  bool stale = false;      ///< its records and bounds are not those of its vertices
  bool far = false;        ///< it comes near no other body that it is tested against, and has no bounds in this step
  bool passed_by = false;  ///< it is far, and nothing else is asked of it: its vertices are not those of the step
  std::array<Extent, 2> extents;  ///< at t0 and t1, if it was asked for them
  bool recorded = false;          ///< it has been through a step since it was set
  double reach_m = 0;             ///< how far its bounds are widened: half of the scene's largest separation of meshes
  double bounds_min[8] = {}, bounds_max[8] = {};  ///< projections of the step
  std::uint16_t margin[16] = {};                  ///< reach_m in record units
  bool sewn = false;                              ///< it has a border by its numbers alone: its seams hold in this step
  bool sewn_known = false;                        ///< for the vertices as they are
  Seams seams;                                    ///< by which it is sewn, or was
  std::vector<std::uint8_t> repeated_slot;        ///< Seams::repeated, by slot
  bool open_known = false;                        ///< which of its faces are of open parts was looked for
  std::vector<std::uint8_t> open_slot;            ///< openFaces(), by slot; empty: all are, or it is closed
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
  /// In this step others can be inside of it, and must not: closed, or parts of it are, nothing of its surface is left
  /// out, no container.
  bool hasInside() const {
    return (setup.topology->isClosed() || sewn || !open_slot.empty()) && !setup.shell && !masked;
  }
  /// The face in the slot does not count for what is inside.
  bool enclosesNothing(std::size_t slot) const {
    return sewn ? repeated_slot[slot] != 0 : !open_slot.empty() && open_slot[slot] != 0;
  }
};

class SceneArrays {
 public:
  /// Positions at t0 guide the order of features in memory; any will do. Returns how many, from the first one on, were
  /// set already: they stay as they are. Throws std::invalid_argument naming the body when positions and topology do
  /// not fit; after any exception forgetBodies() comes first.
  std::size_t setBodies(const std::vector<Body>& bodies);
  void forgetBodies() { bodies_.clear(); }
  /// Whether these are the bodies that were set, wherever they are now.
  bool holds(const std::vector<Body>& bodies) const;

  /// Copies the positions, leaves out what is not finite or not active, and sets the record scale. may_pass_by: not of
  /// bodies that are far and meet neither the map nor themselves. parallel(n, piece, f): calls f(first, last) over
  /// [0, n), in parallel pieces of about that size or not. may_scale: nothing but signs is asked of the vertices, so
  /// that those of very large or very small scenes may be multiplied by a power of two, if that rounds nothing.
  /// Throws std::invalid_argument naming the body when a frame has the wrong number of vertices.
  template <class Parallel>
  void record(const Step& step, StepStats& stats, const Parallel& parallel, bool may_pass_by = false,
              bool may_scale = false) {
    const bool bounds_valid = beginRecord(step, may_pass_by);
    const std::size_t n = pieces_.size(), unit = piecesInAUnit();
    parallel(n, unit, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) copyPiece(step, pieces_[i]);
    });
    const bool any_kept = closeCopies(step, bounds_valid, stats);
    parallel(n, unit, [&](std::size_t first, std::size_t last) {
      for (std::size_t i = first; i < last; ++i) spanPiece(pieces_[i]);
    });
    endRecord(any_kept, may_scale);
  }
  void record(const Step& step, StepStats& stats) {
    record(step, stats, [](std::size_t n, std::size_t, const auto& f) { f(std::size_t{0}, n); });
  }

  /// Off: every body is refitted in every step that needs bounds.
  void setKeepBounds(bool keep) { keep_bounds_ = keep; }

  /// Records and bounds of every body that is neither kept nor far. needed: per body, whether it has bounds however far
  /// it is; empty: all. leaves_wait: per body, whether few of its leaves will be asked for (ClusterTree::needLeaves());
  /// empty: of none. pieces(n, f): calls f(first, last) over [0, n), in parallel or not.
  template <class Pieces>
  void refit(const Pieces& pieces, StepStats& stats, const std::vector<std::uint8_t>& needed = {},
             const std::vector<std::uint8_t>& leaves_wait = {}) {
    for (std::size_t b = 0; b < bodies_.size(); ++b) {
      SceneBody& body = bodies_[b];
      body.far = body.passed_by || (!needed.empty() && !needed[b] && isFar(b));
      ++(body.far ? stats.bodies_far : body.kept ? stats.bodies_kept : stats.bodies_refitted);
      body.stale = body.stale || !body.kept;
      if (body.far || !body.stale) continue;
      body.stale = false;
      pieces(body.usedCount(), [&](std::size_t first, std::size_t last) {
        quantize(body.internal_begin + first, body.internal_begin + last);
      });
      const bool wait = !leaves_wait.empty() && leaves_wait[b] && !body.uncertain && body.reach_m == 0;
      for (ClusterTree& tree : body.trees) {
        tree.letLeavesWait(wait, records_.data());
        pieces(tree.level(0).groups, [&](std::size_t first, std::size_t last) {
          wait ? tree.refitGroups(first, last) : refitLeaves(body, tree, first, last);
        });
        tree.refitUpper();
      }
    }
    refitBodies();
    bounds_valid_ = true;
  }

  /// After a refit(): its bounds reach from t0 to `until` or a little later. The next refit() makes them
  /// anew. Does nothing to a scene with separations or radii.
  template <class Pieces>
  Span shorten(const Pieces& pieces, double until) {
    const std::int32_t end = endOf(until);
    if (end == simd::WHOLE_STEP) return {};
    const bool swept = end <= SWEPT_AT_MOST;
    for (SceneBody& body : bodies_) {
      if (body.far || isStill(body)) continue;  // its bounds at t1 are those of any time
      body.stale = true;
      for (ClusterTree& tree : body.trees) {
        for (std::size_t l = 0; l < tree.height(); ++l) {
          pieces(tree.level(l).groups,
                 [&](std::size_t first, std::size_t last) { tree.shorten(l, end, swept, first, last); });
        }
      }
    }
    return {static_cast<double>(end) / simd::WHOLE_STEP, swept ? Times::SWEPT : Times::BOTH};
  }

  /// After a refit() that left pieces out: nothing is kept of it.
  void forgetBounds() { bounds_valid_ = false; }

  const std::vector<SceneBody>& bodies() const { return bodies_; }
  /// [m], or that times a power of two, as all bounds; see record().
  const VertexMotion* vertices() const { return vertices_.get(); }
  /// The RECORD values of an internal vertex, after refit().
  const std::uint16_t* record(Index internal) const { return records_.data() + internal * simd::RECORD; }
  std::size_t vertexCount() const { return vertex_count_; }
  /// Pairs of different bodies, flattened, the smaller index first, whose bounds overlap (t0_only: at t=0).
  void overlappingBodies(bool t0_only, std::vector<std::uint32_t>& pairs, std::vector<std::uint32_t>& scratch) const;
  std::size_t height() const { return height_; }
  /// Separation of two bodies, of a body from itself, or of a body from the map (OBSTACLE_BODY) [m].
  double separation(std::size_t a, std::size_t b) const;
  /// Some body has faces.
  bool hasFaces() const {
    return std::any_of(bodies_.begin(), bodies_.end(),
                       [](const SceneBody& body) { return body.setup.topology->hasFaces(); });
  }
  /// Some body is to be tested against the map.
  bool mayMeetMap() const {
    return std::any_of(bodies_.begin(), bodies_.end(), [](const SceneBody& b) { return meetsMap(b.setup); });
  }
  /// Some vertex of some body has an uncertainty radius in this step.
  bool uncertain() const { return uncertain_; }
  /// Uncertainty radii of internal vertices [m]; only while uncertain().
  const double* radii() const { return radii_.data(); }

  /// The body-local vertices (1, 2 or 3) of the feature with the rank, in the input's order.
  void featureVertices(FeatureKind kind, std::size_t body_index, Index rank, Index* out) const {
    const SceneBody& body = bodies_[body_index];
    if (kind == FeatureKind::VERTEX) {
      out[0] = rank - body.vertex_begin;
    } else if (kind == FeatureKind::EDGE) {
      const Edge& e = body.setup.topology->edges()[rank - body.edge_begin];
      out[0] = e[0], out[1] = e[1];
    } else {
      const Face& face = body.setup.topology->faces()[face_order_[rank]];
      out[0] = face[0], out[1] = face[1], out[2] = face[2];
    }
  }
  /// Soon featureVertices() is asked for it.
  void prefetchFeature(FeatureKind kind, std::size_t body_index, Index rank) const {
    const SceneBody& body = bodies_[body_index];
    if (kind == FeatureKind::EDGE) __builtin_prefetch(&body.setup.topology->edges()[rank - body.edge_begin]);
    if (kind == FeatureKind::FACE) __builtin_prefetch(&face_order_[rank]);
  }

 private:
  // Nothing moves far in a short time: swept bounds then say nearly as much as those at two times, for half the work.
  static constexpr std::int32_t SWEPT_AT_MOST = simd::WHOLE_STEP / 16;

  void buildTrees(SceneBody& body, const Positions& rest);
  void makeRoom();
  void setReaches();
  /// Some vertices of a body, and what a step's positions are found to be there.
  struct Piece {
    std::size_t body, first, last;
    bool same = false;     ///< as in the step before, bit for bit
    bool changed = false;  ///< others are active
    bool spans = false;    ///< its bounds are asked for
    std::size_t unchecked = 0, active = 0, first_active = 0;
    double bounds_min[8] = {}, bounds_max[8] = {};  ///< projections
  };
  bool beginRecord(const Step& step, bool may_pass_by);
  void passByFar(const Step& step);
  std::size_t piecesInAUnit() const;
  void copyPiece(const Step& step, Piece& piece);
  bool closeCopies(const Step& step, bool bounds_valid, StepStats& stats);
  void sew(SceneBody& body, const Body& motion, bool all_finite) const;
  void closeCopy(SceneBody& body, const Body& motion, const std::array<Piece*, 2>& pieces, bool bounds_valid,
                 StepStats& stats);
  void spanPiece(Piece& piece) const;
  void endRecord(bool any_kept, bool may_scale);
  bool scaleVertices();
  bool recordRadii(SceneBody& body, const Body& motion);
  void setRange(bool keep);
  void setMargin(const SceneBody& body, double reach_m, std::uint16_t* margin16) const;
  std::int32_t endOf(double until) const;
  bool isStill(const SceneBody& body) const;
  bool isFar(std::size_t b) const;
  void quantize(std::size_t first, std::size_t last);
  void refitLeaves(const SceneBody& body, ClusterTree& tree, std::size_t first, std::size_t last) const;
  void refitBodies();

  std::vector<SceneBody> bodies_;
  std::vector<Piece> pieces_;      // of the step that is recorded, by bodies
  std::vector<Index> face_order_;  // face rank -> face of the input (all bodies)
  hwy::AlignedFreeUniquePtr<VertexMotion[]> vertices_;
  AlignedRecords records_;
  std::size_t vertex_count_ = 0, vertex_capacity_ = 0;
  std::size_t height_ = 2;
  double range_min_[8] = {}, range_max_[8] = {};  // what the records span
  double low_[8] = {}, scale_[8] = {};
  bool range_padded_ = false;
  bool keep_bounds_ = true;
  bool bounds_valid_ = false;  // trees and records are those of the vertices
  bool uncertain_ = false;
  std::vector<double> radii_;
  std::vector<ClusterTree::Level> body_levels_;  // bounds of the bodies, as a tree whose features they are
  AlignedRecords body_bounds_;
};

}  // namespace dccd
