// What an ObstacleCheck holds and does: obstacle_check.cpp has the flow, obstacle_features.cpp the features' tests.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <memory>
#include <optional>
#include <vector>

#include "dccd/tolerances.h"
#include "obstacle/axis_predicates.h"
#include "obstacle/mesh_keys.h"
#include "obstacle/obstacle_batch.h"

namespace dccd {

/// What is known of a vertex. The NEAR bits are set by the faces (of a polyline: edges) at it: of what their keys
/// reach.
enum VertexState : std::uint8_t {
  ACTIVE = 1,
  MOVES = 2,
  NEAR = 4,         ///< some leaf, during the step
  NEAR_EDGE = 8,    ///< a convex edge, during the step
  NEAR_START = 16,  ///< some leaf, at t=0
  INSIDE = 32       ///< it touches a leaf at t=0
};

struct MovingBounds;

/// The rung of the options. Throws std::invalid_argument for a separation that it cannot have.
std::unique_ptr<Rung> elementaryTestFor(const ObstacleOptions& options);

struct ObstacleCheck::Impl {
  explicit Impl(const ObstacleOptions& o)
      : options(o),
        test(elementaryTestFor(o)),
        vertex_batch(PairKind::VERTEX_FACE, test.get()),
        edge_batch(PairKind::EDGE_EDGE, test.get()),
        corner_batch(PairKind::VERTEX_FACE, test.get()) {}

  /// What one run works on.
  struct Run {
    const ObstacleQuery& query;
    const VoxelSurface::Impl* surface;
    ObstacleStats* stats;
    bool isUnlimited() const { return query.deadline.isNever() && query.most_found == NO_LIMIT; }
  };
  static constexpr std::size_t NO_LIMIT = std::numeric_limits<std::size_t>::max();

  /// Distance from which on a feature of these vertices is in contact. Boxes are widened by it and compared with the
  /// map's planes, which are doubles: where the true sum is beyond a plane, so is the rounded one.
  template <class Feature>
  double separationOf(const Run& run, const Feature& feature) const {
    double radius = 0;
    if (run.query.vertex_radius_m) {
      for (const Index v : feature) radius = std::max(radius, run.query.vertex_radius_m[v]);
    }
    // Rounded up, so that a contact at exactly the sum is none too far.
    return radius > 0 ? (options.minimum_separation_m + radius) * (1 + tolerance::SEPARATION_SUM)
                      : options.minimum_separation_m;
  }

  /// Asked before each feature and each leaf near it: has this run found enough, or is its time up? Looks at one in 32.
  bool isLate(const Run& run) {
    if (late || run.isUnlimited() || (looked_at++ & 31) != 0) return late;
    full = full || foundTooMuch(run);
    return late = full ||
                  run.query.deadline.movedBy(-LISTING_A_CONTACT * static_cast<std::int64_t>(foundCount())).isOver();
  }
  /// Contacts so far, of which some may be the same.
  std::size_t foundCount() const;
  static constexpr std::chrono::nanoseconds LISTING_A_CONTACT{300};  ///< sorting, joining and copying one of 100,000
  /// Certainly more than most_found are left when collect() has joined what belongs to one feature and leaf.
  bool foundTooMuch(const Run& run);

  void begin(const Deadline& deadline);
  void prepareReaches(const Run& run);
  void prepareVertices(const Run& run);
  /// What the keys of a face or an edge reach, as NEAR bits for its vertices; corner: also a corner.
  std::uint8_t nearBits(const Run& run, const KeyLanes& swept, const KeyLanes& start, bool& corner) const;
  static constexpr std::size_t TOGETHER = 8;  ///< faces that are looked at together first
  std::optional<std::uint8_t> nearBitsOfAll(const Run& run, const Face* first, const Face* last) const;
  void markNearFaces(const Run& run);
  void markNearEdges(const Run& run);
  void runVertices(const Run& run);
  void runEdges(const Run& run);
  void runFaces(const Run& run);

  /// These add the initial contacts of a feature none of whose own ends touches anything at t=0.
  bool edgeStartsInside(const Run& run, const Edge& edge);
  bool faceStartsInside(const Run& run, const Face& face);
  template <class Feature>
  void addInitial(const Run& run, PairKind kind, const Feature& feature, std::uint32_t leaf,
                  std::vector<Contact>& contacts) {
    Contact contact = contactOf(run, kind, leaf);
    std::copy(feature.begin(), feature.end(), contact.vertex.begin());
    setInitial(contact);
    contacts.push_back(contact);
  }
  void vertexPath(const Run& run, Index vertex, std::uint32_t leaf, const LeafBox& box);
  void vertexSeparation(const Run& run, Index vertex, std::uint32_t leaf, bool inside);
  void edgePairs(const Run& run, const Edge& edge, const VertexMotion* points, const MovingBounds& moving,
                 double separation_m, std::uint32_t leaf, bool inside);
  void cornerPairs(const Run& run, const Face& face, const VertexMotion* points, const MovingBounds& moving,
                   double separation_m, std::uint32_t leaf, bool inside);
  void collect(std::vector<Contact>& contacts, std::size_t first, std::size_t most_found);

  Contact contactOf(const Run& run, PairKind kind, std::uint32_t leaf) const;
  void setInitial(Contact& contact);
  void setTime(Contact& contact, const CrossingTime& time);
  /// points: those of the mesh's feature, 2 or 3.
  bool settleFall(const ObstaclePair& pair, const VertexMotion* points, std::size_t count, const LeafBox& target,
                  std::vector<Contact>& contacts);
  VertexMotion motionOf(const Run& run, Index vertex) const {
    const Vec3 &a = run.query.map_t0[vertex], &b = run.query.map_t1[vertex];
    return {{a.x(), a.y(), a.z(), 0}, {b.x(), b.y(), b.z(), 0}};
  }
  template <class Feature>
  static KeyLanes unite(const std::vector<KeyLanes>& of, const Feature& feature) {
    KeyLanes lanes = of[feature[0]];
    for (std::size_t i = 1; i < feature.size(); ++i) lanes.include(of[feature[i]]);
    return lanes;
  }
  /// Fills near_leaves with the leaves that a key box reaches, by key.
  void findLeaves(const Run& run, const KeyBox& box);
  /// Of a run that is limited not more than this, 4 MB, are near a feature; of more the run is full.
  static constexpr std::size_t MOST_NEAR_LEAVES = std::size_t{1} << 20;
  static constexpr std::chrono::nanoseconds SORTING_A_LEAF{100};  ///< one of a million
  static constexpr std::size_t LEAVES_PER_LOOK_AT_THE_CLOCK = 4096;
  bool addNear(const Run& run, std::uint32_t leaf) {
    if (near_leaves.size() % LEAVES_PER_LOOK_AT_THE_CLOCK == LEAVES_PER_LOOK_AT_THE_CLOCK - 1) {
      late =
          late || run.query.deadline.movedBy(-SORTING_A_LEAF * static_cast<std::int64_t>(near_leaves.size())).isOver();
    }
    if (run.query.most_found != NO_LIMIT && near_leaves.size() == MOST_NEAR_LEAVES) {
      full = late = true;
    } else {
      near_leaves.push_back(leaf);
    }
    return !late;
  }
  static void sortLeaves(const VoxelSurface::Impl& surface, std::vector<std::uint32_t>& list);

  ObstacleOptions options;
  std::unique_ptr<Rung> test;
  ObstacleBatch vertex_batch, edge_batch, corner_batch;
  bool late = false;  ///< this run is to end
  bool full = false;  ///< because of what it has found
  std::uint32_t looked_at = 0;
  std::size_t joined = 0;  ///< contacts of this run when they were last joined

  std::vector<double> reaches;       ///< per vertex: the largest separation of a feature at it, rounded up; [0] for all
  std::vector<KeyLanes> keys;        ///< over the step, as far as the reaches
  std::vector<KeyLanes> start_keys;  ///< at t=0, touching
  std::vector<std::uint8_t> state;   ///< VertexState bits
  struct NearFace {
    Index face;
    bool corner, start;  ///< corners within reach; leaves at t=0
  };
  std::vector<NearFace> near_faces;
  std::vector<std::uint32_t> near_leaves;
  std::vector<Contact> vertex_contacts, edge_contacts, face_contacts;
};

}  // namespace dccd
