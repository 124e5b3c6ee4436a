// The monitor: stamped frames of several bodies in, one outcome per frame of the clock body out. Free of ROS, so that
// the live node, analyze_bag and the tests run the same code.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <vector>

#include "dccd/detector.h"
#include "dccd/export.h"
#include "dccd/mesh_store.h"
#include "dccd/tolerances.h"

namespace dccd {

/// How a body comes by its positions.
enum class BodyMotionKind : std::uint8_t {
  STREAM = 0,  ///< frames with stamps, interpolated between them
  STATIC = 1,  ///< the newest frame holds at all times
};

/// A body as the monitor is told of it; its topology comes with the frames.
struct MonitorBody {
  std::string name;
  BodyMotionKind motion = BodyMotionKind::STREAM;
  bool rigid = false;  ///< never tested against itself
  bool self_collision = true;
  bool against_bodies = true;
  bool against_obstacle = true;
  double minimum_separation_m = 0;
  std::vector<Index> vertex_mask;           ///< vertices that are left out, with every feature on them (grasped ones)
  std::vector<SeparationFrom> separations;  ///< see BodySetup
};

struct StepInput;  // step/step_runner.h

struct MonitorOptions {
  DetectorOptions detector;
  MeshStoreOptions store;
  double sync_timeout_s = 0.1;       ///< how long a step waits for the other bodies' frames
  std::size_t clock_body = 0;        ///< a step ends at each of its frames
  std::size_t max_waiting = 64;      ///< steps that may wait for other bodies; the oldest gives way
  std::size_t max_contacts = 10000;  ///< per outcome; the earliest are kept, status TRUNCATED
  bool suppress_initial = false;     ///< leave initial obstacle contacts out of the list (they still count)
  std::vector<Box> exclude_boxes;    ///< [m], fixed frame: voxels with their centre inside count as free
  bool obstacle_expected = false;    ///< without a map the status is NO_MAP
  /// With obstacle_expected, a map older than this at the end of the step is no map; 0: never. (Where none is expected,
  /// leaving a map out would go unsaid: it is used whatever its age.)
  double octomap_timeout_s = 0;
  double rigid_tolerance_m =
      tolerance::RIGID_PATH_M;  ///< a step is split until straight paths are this close to a rotation's arc
  std::size_t max_substeps = 64;
  double look_ahead_s = 0;  ///< horizon of predictions; 0: none
};

/// The map of a step. None yet: surface null. Valid and empty: a surface without leaves.
struct MonitorMap {
  std::shared_ptr<const VoxelSurface> surface;
  StampNs stamp_ns = 0;
  Eigen::Isometry3d map_from_fixed = Eigen::Isometry3d::Identity();  ///< at the map's stamp, held for the whole step
  std::string problem;                                               ///< why there is none, for the reason of NO_MAP
};

/// Every frame received ends in exactly one place: received = sum(by_status) + waiting.
struct DCCD_EXPORT FrameCounters {
  std::uint64_t received = 0;
  std::uint64_t receipt_stamps = 0;  ///< frames stamped with their receipt time
  std::array<std::uint64_t, static_cast<std::size_t>(StepStatus::COUNT)> by_status{};

  std::uint64_t of(StepStatus status) const { return by_status[static_cast<std::size_t>(status)]; }
  void count(StepStatus status) { ++by_status[static_cast<std::size_t>(status)]; }
  std::uint64_t processed() const;  ///< came to a result, or serve one as another body's position
  std::uint64_t started() const;    ///< seams: began a new pair of frames
  std::uint64_t skipped() const;    ///< all other ends
  std::uint64_t waiting() const { return received - processed() - started() - skipped(); }
  FrameCounters& operator+=(const FrameCounters& other);
};

/// Of how many contacts what holds.
struct ContactCounts {
  std::size_t certain = 0, undecided = 0;
  std::size_t initial = 0, leaving = 0;
  std::size_t mesh = 0, obstacle = 0;  ///< with a body, with the map
};

/// What became of one frame of the clock body.
struct StepOutcome {
  StepStatus status = StepStatus::FIRST_FRAME;
  std::string reason;  ///< one sentence; empty when OK
  StampNs start_ns = 0, stamp_ns = 0;
  std::uint64_t sequence = 0;  ///< of the clock body's frames that were pushed or skipped, from 1
  bool answered = false;       ///< the fields below hold a result

  std::vector<Contact> contacts;      ///< canonical order, filtered and cut as the options say; toc of the whole step
  std::size_t total_contacts = 0;     ///< before the cut to max_contacts
  ContactCounts counts;               ///< of all of these
  std::size_t suppressed = 0;         ///< initial contacts left out by choice
  std::uint64_t excluded_voxels = 0;  ///< finest voxels of the map taken out by exclude_boxes
  StartState start_state = StartState::NOT_CHECKED;
  std::vector<StartIntersection> intersections;
  bool complete = true;  ///< false: the step budget ran out, before the last pair or before the start state was known
  double unchecked_toc_lower = std::numeric_limits<double>::infinity();
  double earliest_toc = std::numeric_limits<double>::infinity();  ///< over contacts and what was left out
  StepStats stats;
  double unknown_fraction =
      0;  ///< [1] of the swept voxels, those not known to the map, which fills it in; NaN: too many to count
  std::size_t substeps = 0;
  bool clear = false;  ///< doc/interface.md, ~clear

  /// Positions at both ends and the map used, for geometry and display. Shared with the monitor's next step: copy
  /// nothing, but finish with the outcome before the next call.
  const StepInput* input = nullptr;  ///< both ends, and how rigid bodies come from one to the other
  const std::vector<Positions>* positions_t0 = nullptr;
  const std::vector<Positions>* positions_t1 = nullptr;
  const std::vector<std::shared_ptr<const Topology>>* topologies = nullptr;
  std::shared_ptr<const VoxelSurface> obstacle;
  Eigen::Isometry3d map_from_fixed = Eigen::Isometry3d::Identity();
  StampNs map_stamp_ns = 0;

  double duration_s() const { return static_cast<double>(stamp_ns - start_ns) * 1e-9; }
};

/// Point, normal, weights and approach speed [m per step] of one of the outcome's contacts, any kind, in the fixed
/// frame.
DCCD_EXPORT ContactGeometry contactGeometry(const StepOutcome& outcome, const Contact& contact);

/// Where one of the contact's vertices is at its toc_lower [m], fixed frame; i counts Contact::vertex. Of a rigid body
/// that turns, on the path that was tested: the chord of that part of the step.
DCCD_EXPORT Vec3 vertexAtContact(const StepOutcome& outcome, const Contact& contact, int i);

/// All that a step's answer follows from, before it is computed. One entry a body; valid until the step ends.
struct StepSource {
  StampNs start_ns = 0, stamp_ns = 0;
  std::uint64_t sequence = 0;  ///< as in StepOutcome
  const std::vector<MonitorBody>* bodies = nullptr;
  const MonitorOptions* options = nullptr;
  const std::vector<std::shared_ptr<const Topology>>* topologies = nullptr;
  const std::vector<Positions>*t0 = nullptr, *t1 = nullptr;  ///< [m] fixed frame
  const std::vector<std::uint8_t>* rigid = nullptr;          ///< moves from pose_t0 to pose_t1 along the rotation
  const std::vector<Eigen::Isometry3d>*pose_t0 = nullptr, *pose_t1 = nullptr;
  const std::vector<std::vector<double>>* radius_m = nullptr;  ///< uncertainty per vertex; empty: none
  const std::vector<std::shared_ptr<const ReferenceFrame>>* references = nullptr;  ///< null: nothing is left out
  const MonitorMap* map = nullptr;  ///< as used: null surface where the map was too old
};

/// Told of every step that is computed, on the thread that calls next().
class DCCD_EXPORT StepListener {
 public:
  virtual ~StepListener() = default;
  virtual void onStep(const StepSource& source) = 0;
  virtual void onOutcome(const StepOutcome& outcome) = 0;  ///< of the step before; INTERNAL_ERROR when it failed
};

/// Not thread-safe: one thread at a time, in the node its worker. `now_ns` is any clock that only goes forward (the
/// node: steady clock; offline: the bag's); it decides about sync_timeout_s and nothing else.
class DCCD_EXPORT Monitor {
 public:
  /// Throws std::invalid_argument naming the option or body.
  Monitor(const MonitorOptions& options, std::vector<MonitorBody> bodies);
  ~Monitor();

  const MonitorOptions& options() const;
  void setOptions(const MonitorOptions& options);  ///< from the next step on; clock_body must stay
  const std::vector<MonitorBody>& bodies() const;

  /// A frame of the body, in the fixed frame. Returns what it is to the frame before it.
  StepStatus push(std::size_t body, MeshFrame frame, std::int64_t now_ns);
  /// A frame that never became one (refused, no transform, ...). The clock body's yield an outcome with that status.
  void skip(std::size_t body, StepStatus status, StampNs stamp_ns, const std::string& reason);
  /// Counted only, without outcome: frames dropped by queues, or while disabled.
  void countDropped(std::size_t body, StepStatus status, std::uint64_t count = 1);
  void countReceived(std::size_t body, std::uint64_t count = 1, std::uint64_t receipt_stamps = 0);

  /// The map from the next step on.
  void setMap(MonitorMap map);
  const MonitorMap& map() const;

  /// The next outcome, in the order of the clock body's frames. False: none, or the next waits for other bodies.
  bool next(std::int64_t now_ns, StepOutcome& outcome);
  /// Whether a step waits for other bodies' frames, so that next() is worth calling again later.
  bool waiting() const;
  /// End of input: steps that still wait are not waited for any longer.
  void finish();

  /// Forgets all frames. Waiting frames are counted under `status`. After RESET the next frames are new references for
  /// what the minimum separation leaves out; else references stay as long as the topology does.
  void reset(StepStatus status = StepStatus::RESET);

  /// The newest frames as a step without motion: is anything in contact now? Status NO_BODY when a body has none yet.
  StepOutcome checkNow();
  /// From the newest frames to their extrapolation over look_ahead_s; toc is a fraction of that horizon. NO_BODY when
  /// a body has no two frames without a seam between them. Valid after an outcome with a result.
  StepOutcome predict();

  /// The reference frame of a body for as long as it has this topology, instead of its first frame. For replays.
  void setReference(std::size_t body, std::shared_ptr<const Topology> topology,
                    std::shared_ptr<const ReferenceFrame> reference);
  /// Pairs from which the minimum separation is left out (see LeftOutPair); changes with the reference frames only.
  const std::vector<LeftOutPair>& leftOut() const;

  const FrameCounters& counters(std::size_t body) const;
  FrameCounters total() const;

  /// Null: none. Must outlive the monitor or be taken away. Steps of checkNow() and predict() are not told.
  void setListener(StepListener* listener);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
