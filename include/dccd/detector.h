// The step: two frames of positions in, sorted contacts and statistics out.
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "dccd/contact.h"
#include "dccd/elementary.h"
#include "dccd/export.h"
#include "dccd/topology.h"
#include "dccd/voxel_surface.h"

namespace dccd {

/// The stages of the flow, in order. Names by toString().
enum class Stage : std::uint8_t { RECORD, BOUNDS, BROAD_PHASE, PLANAR, ELEMENTARY, OBSTACLE, START_STATE, SORT, COUNT };
/// What a scene can call for (doc/interface.md). Names by toString().
enum class Effect : std::uint8_t {
  SELF_COLLISION,
  BODY_BODY,
  OBSTACLE,
  START_STATE,
  RIGID_BODIES,        ///< those of BODY_BODY with a rigid body; ms: also the split of the step
  UNKNOWN_SPACE,       ///< in: voxels that the step sweeps, out: those that the map does not know
  MINIMUM_SEPARATION,  ///< pairs that carry a distance into the elementary test
  TRACKER_NOISE,       ///< pairs whose vertices bring an uncertainty radius
  LOOK_AHEAD,          ///< the last prediction: pairs past the filters, contacts
  COUNT
};
DCCD_EXPORT const char* toString(Stage stage);
DCCD_EXPORT const char* toString(Effect effect);

/// Pairs into and out of a stage or an effect, and its time summed over the workers.
struct StageStats {
  std::uint64_t in = 0;
  std::uint64_t out = 0;
  double ms = 0;
  StageStats& operator+=(const StageStats& other) {
    in += other.in;
    out += other.out;
    ms += other.ms;
    return *this;
  }
};

struct StepStats {
  std::array<StageStats, static_cast<std::size_t>(Stage::COUNT)> stages{};
  std::array<StageStats, static_cast<std::size_t>(Effect::COUNT)> effects{};
  TierCounters tiers;
  double total_ms = 0;
  std::uint64_t vf_candidates = 0, ee_candidates = 0;  ///< out of the linear filter
  std::uint64_t undecided = 0, initial = 0, leaving = 0;
  std::uint64_t unchecked_vertices = 0, unchecked_faces = 0;
  std::uint64_t unfolded_bodies = 0;  ///< whose self-collision was left out: no fold, contour apart from itself
  std::uint64_t bodies_refitted = 0, bodies_kept = 0;  ///< bounds computed; still those of the step before
  std::uint64_t body_pairs = 0;                        ///< pairs of different bodies whose swept bounds overlap
  std::uint64_t left_out_listed = 0;                   ///< pairs closer than the separation in the reference frame
  std::uint64_t left_out_met = 0;  ///< of those, the ones that came to the elementary test, without a separation
  const StageStats& operator[](Stage s) const { return stages[static_cast<std::size_t>(s)]; }
  StageStats& operator[](Stage s) { return stages[static_cast<std::size_t>(s)]; }
  const StageStats& operator[](Effect e) const { return effects[static_cast<std::size_t>(e)]; }
  StageStats& operator[](Effect e) { return effects[static_cast<std::size_t>(e)]; }
};

/// Do surfaces already cross at t=0? (doc/algorithm.md)
enum class StartState : std::uint8_t { CLEAR = 0, INTERSECTING = 1, NOT_CHECKED = 2 };
DCCD_EXPORT const char* toString(StartState state);

/// An edge through a face at t=0 (vertex[0..1] of body[0] the edge, vertex[2..4] of body[1] the face), or a mesh vertex
/// inside occupied space (body[1] = OBSTACLE_BODY, vertex[0] the vertex).
struct StartIntersection {
  std::array<std::uint16_t, 2> body{0, 0};
  std::array<Index, 5> vertex{NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX};
};

/// The paper's own hierarchy is not among them: it lives in paper/triangle_candidates.h, for benchmarks and
/// tests.
enum class BroadPhase : std::uint8_t { CLUSTERED = 0, BRUTE_FORCE = 1 };

struct DetectorOptions {
  AccuracyOptions accuracy;
  BroadPhase broad_phase = BroadPhase::CLUSTERED;
  int num_threads = 1;            ///< 1 or more
  double step_budget_ms = 0;      ///< 0: none
  bool earliest_only = false;     ///< only contacts that may be the first; with `exact` those in the earliest TOC cell
  bool check_start_state = true;  ///< run the static tests when the step needs them
  /// Bodies that move bit for bit as in the step before keep their bounds (no answer changes). Off: to time a step
  /// again and again.
  bool keep_bounds = true;
  /// Leave out the self-collision of surfaces that certainly do not fold (no answer changes).
  bool unfolded_test = true;
};

/// Where a body was when it was known to be fit: its features that are closer there than the minimum separation are
/// neighbours, not layers.
struct ReferenceFrame {
  Positions positions;           ///< [m]
  std::vector<double> radius_m;  ///< the largest uncertainty per vertex that the list is to be made for; empty: none
};

/// A minimum separation [m] from one other body (or itself, or OBSTACLE_BODY) instead of the larger of the two bodies'.
struct SeparationFrom {
  std::uint16_t body = 0;
  double separation_m = 0;
};

/// A pair of features of one body from which the separation is left out, because it is closer in the reference frame
/// (with uncertainty radii: while it is closer there than its present separation). It is still tested for contact
/// without one.
struct LeftOutPair {
  PairKind kind = PairKind::VERTEX_FACE;
  std::uint16_t body = 0;
  std::array<Index, 4> vertex{NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX};  ///< as in Contact
};

/// A body as the detector sees it; fixed until setBodies is called again.
struct BodySetup {
  std::string name;
  std::shared_ptr<const Topology> topology;
  bool self_collision = true;
  bool against_bodies = true;
  bool against_obstacle = true;
  double minimum_separation_m = 0;                  ///< [m]; a pair uses the larger of its two bodies'
  std::vector<std::uint8_t> vertex_active;          ///< empty: all; 0: the vertex and every feature on it is left out
  std::vector<SeparationFrom> separations;          ///< named by either of the two bodies
  std::shared_ptr<const ReferenceFrame> reference;  ///< null: no pair is left out
  bool rigid = false;                               ///< for the statistics
};

/// One body's positions at both ends of the step, in the fixed frame [m]. Non-finite ones are unchecked.
struct BodyMotion {
  const Positions* t0 = nullptr;
  const Positions* t1 = nullptr;
  /// Uncertainty radius per vertex during the whole step [m], finite and 0 or more; null: none. A pair's separation
  /// grows by the largest radius of each of its two features. Needs accuracy conservative or screen.
  const std::vector<double>* radius_m = nullptr;
};

class Detector;

/// One step of all bodies, in the order of setBodies.
struct MotionStep {
  std::vector<BodyMotion> bodies;
  std::shared_ptr<const VoxelSurface> obstacle;                      ///< null: none
  Eigen::Isometry3d map_from_fixed = Eigen::Isometry3d::Identity();  ///< held for the whole step
  bool continues = false;  ///< t0 is the t1 of the previous run(), so the start state can be carried over
  double spent_ms = 0;     ///< of step_budget_ms, by earlier parts of the same step
  /// Parts of the same step that follow: the search of the start state leaves them as much time as this part's pairs
  /// took.
  std::size_t parts_after = 0;
  /// Another detector, whose last step ended at this t0: what it knows of its end is the start state, without a search.
  /// Nothing is carried over to a step after this one.
  Detector* predecessor = nullptr;
  bool start_state_wanted = true;  ///< false: not checked, whatever the options say
};

struct DCCD_EXPORT StepResult {
  std::vector<Contact> contacts;  ///< canonical order (canonicalLess)
  StartState start_state = StartState::NOT_CHECKED;
  std::vector<StartIntersection> intersections;
  bool start_state_complete = true;  ///< false: the budget ran out before all that can meet at t0 was looked at
  bool complete = true;              ///< of the contacts; false: the budget ran out
  /// complete == false: nothing that was left out can touch before this; otherwise infinity.
  double unchecked_toc_lower = std::numeric_limits<double>::infinity();
  StepStats stats;

  /// The earliest possible TOC over contacts, undecided pairs and what was left out; infinity when none.
  double earliestToc() const;
};

/// Runs steps. Keeps all scratch; after warm-up a step allocates nothing that grows with the number of steps.
/// Not thread-safe; its own workers are inside.
class DCCD_EXPORT Detector {
 public:
  /// Throws std::invalid_argument naming the option and value that is out of range.
  explicit Detector(const DetectorOptions& options);
  ~Detector();
  const DetectorOptions& options() const;
  void setOptions(const DetectorOptions& options);  ///< applies from the next step on
  /// Positions of the first frame guide the order of features in memory; any will do.
  void setBodies(std::vector<BodySetup> bodies, const std::vector<const Positions*>& rest_positions);
  const StepResult& run(const MotionStep& step);
  /// Known after setBodies; in the order of the bodies, kinds, features.
  const std::vector<LeftOutPair>& leftOut() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
