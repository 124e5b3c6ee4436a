// The monitor: stamped frames of several bodies in, one outcome per frame of the clock body out. Free of ROS, so that
// the live node, analyze_bag and the tests run the same code.
#pragma once

#include <array>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dccd/detect.h"
#include "dccd/export.h"
#include "dccd/mesh_store.h"
#include "dccd/tolerances.h"

namespace dccd {

struct SpeedBound;
struct SpeedLaw;

/// How frames become steps.
struct MonitorOptions {
  Options detector;  ///< how a step is answered
  MeshStoreOptions store;
  double sync_timeout_s = 0.1;   ///< how long a step waits for the other bodies' frames
  std::size_t clock_body = 0;    ///< a step ends at each of its frames
  std::size_t max_waiting = 64;  ///< steps that may wait for other bodies; the oldest gives way
  /// With obstacle_expected, a map whose stamp is further than this from the end of the step, before or after it, is no
  /// map; 0: never. (Where none is expected, leaving a map out would go unsaid: it is used whatever its age.)
  double octomap_timeout_s = 0;
  /// How much older than its stamp what a map shows may be, for the bodies' own voxels [s].
  double own_voxels_lag_s = 0.1;
  /// Of detector.expected, where one body holds the other: what was one's own may become the other's.
  std::vector<Expectation> held;
  bool own_voxels_trust = false;  ///< what the first map shows where a body is, is its own
  /// A map's own voxels are told on a thread of their own, by the frames of when that began, and until it is done steps
  /// have the map before. Else in the step that takes the map, and which map a step has follows from the stamps alone.
  bool own_voxels_beside = false;
  double look_ahead_s = 0;  ///< horizon of predictions, at most 1e8; 0: none
  /// A patch that comes back within this is the same one; of steps that were answered whole. With
  /// detector.patches.
  double patch_gap_s = tolerance::PATCH_GAP_S;
  /// What is pushed is made of what came. Who makes it has questions to answer of each outcome of next() and
  /// checkNow(), too (Claim::askOfCell): until then nothing is proved.
  bool in_cell = false;

  MonitorOptions() { detector.max_contacts = 10000; }
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

/// Told of every step that is computed, on the thread that calls next().
class DCCD_EXPORT StepListener {
 public:
  virtual ~StepListener() = default;
  virtual void onStep(const Step& step, const Options& options) = 0;
  virtual void onOutcome(const Outcome& outcome) = 0;  ///< of the step before; INTERNAL_ERROR when it failed
};

/// Not thread-safe: one thread at a time, in the node its worker. `now_ns` is any clock that only goes forward (the
/// node: steady clock; offline: the bag's); it decides about sync_timeout_s and nothing else.
class DCCD_EXPORT Monitor {
 public:
  /// Throws std::invalid_argument naming the option or body.
  Monitor(const MonitorOptions& options, std::vector<Body> bodies);
  ~Monitor();

  const MonitorOptions& options() const;
  /// What a step may take, so that a prediction has its share of the time [ms]; 0: as long as it takes.
  double stepMs() const;
  void setOptions(const MonitorOptions& options);  ///< from the next step on; clock_body must stay
  const std::vector<Body>& bodies() const;

  /// A frame of the body, in the fixed frame. Returns what it is to the frame before it.
  StepStatus push(std::size_t body, MeshFrame frame, std::int64_t now_ns);
  /// A frame that never became one (refused, no transform, ...). The clock body's yield an outcome with that status.
  void skip(std::size_t body, StepStatus status, StampNs stamp_ns, const std::string& reason,
            std::int64_t arrival_ns = 0);
  /// Counted only, without outcome: frames dropped by queues, or while disabled.
  void countDropped(std::size_t body, StepStatus status, std::uint64_t count = 1);
  void countReceived(std::size_t body, std::uint64_t count = 1, std::uint64_t receipt_stamps = 0);

  /// From the next step on the body is another one, with frames of its own: those that it had are forgotten. `body` may
  /// be bodies().size(), which adds one. All that is known of the other bodies stays. Push what steps to come begin
  /// with, at stampsToCome(), or the next step waits for it. Throws std::invalid_argument; all then stays.
  void setBody(std::size_t body, Body what);
  /// Where steps to come begin and end, as far as that is known, ascending.
  std::vector<StampNs> stampsToCome() const;

  /// A static body's frame is to be placed anew: it is forgotten, and counts as one that waits until it is pushed
  /// again.
  void withdraw(std::size_t body);

  /// The map from the next step on whose end is not before its stamp, where bodies have own voxels; else from the next
  /// step on. Of one that is trusted nothing is a body's own. Where ObstacleMap::number
  /// has a gap, what is own by the next one is in doubt: it may be an obstacle that those showed that are missing.
  void setMap(ObstacleMap map);
  /// Why one that came will not be given, for the sentence about the gap that it leaves.
  void sayOfMaps(const std::string& why);
  /// What is occupied besides, from the next map on: it is trusted, and has the frame and resolution of the others.
  void setMapBeside(ObstacleMap map);
  const ObstacleMap& map() const;       ///< as it was given last
  const ObstacleMap& mapInUse() const;  ///< of the last step, and of the next one where none waits
  /// Where the frames go by which frames and maps were placed: asked when a step is answered, of each that is not the
  /// fixed one. A step in which one is not known, or off by more than rigid_tolerance_m from where the step has what it
  /// carries, is PARTIAL. Must outlive the monitor. Null, the beginning: what is pushed is all that is known.
  void setTracks(const FrameTracks* tracks);
  /// From the next step on nobody reads its distances but safeUntil() and speedScale(), by these bounds and this law,
  /// and who asks which two are nearest over the step. Of a pair that changes nothing of these three, however far it
  /// is, Outcome::clearances say FARTHER, by as much as that takes.
  void readDistancesBy(const std::vector<SpeedBound>& bounds, const std::optional<SpeedLaw>& law);
  /// The beginning.
  void readAllDistances();
  /// Of such frames those of which a step needs to know: of the map in use, of maps that wait, of static bodies.
  std::set<std::string> heldFrames() const;
  /// ObstacleMap::arrival_ns of the first of the maps that wait for the bodies' frames; none: none does.
  std::optional<std::int64_t> mapWaitsSince() const;

  /// The next outcome, in the order of the clock body's frames. False: none, or the next waits for other bodies.
  bool next(std::int64_t now_ns, Outcome& outcome);
  /// The step that is computed, and all after it, are not wanted any more: they end at once, as with a step budget that
  /// is over. From any thread.
  void cancel();
  /// Steps that wait for other bodies' frames are answered with this status instead.
  void dropSteps(StepStatus status, const std::string& reason);
  /// Whether a step waits for other bodies' frames, so that next() is worth calling again later.
  bool waiting() const;
  /// End of input: steps that still wait are not waited for any longer.
  void finish();

  /// Forgets all frames. Waiting frames are counted under `status`. After RESET the next frames are new references for
  /// what the minimum separation leaves out; else references stay as long as the topology does.
  void reset(StepStatus status = StepStatus::RESET);

  /// The newest frames as a step without motion: is anything in contact now? Status NO_BODY when a body has none yet.
  Outcome checkNow();
  /// From the newest frames to their extrapolation over look_ahead_s; toc is a fraction of that horizon. NO_BODY when
  /// a body has no two frames without a seam between them. Valid after an outcome with a result.
  Outcome predict();

  const FrameCounters& counters(std::size_t body) const;
  FrameCounters total() const;

  /// Null: none. Must outlive the monitor or be taken away. Steps of checkNow() and predict() are not told.
  void setListener(StepListener* listener);

  struct DCCD_HIDDEN Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
