// What a monitor holds and does: monitor.cpp has its frames and steps, monitor_inputs.cpp what a step is made of
// (bodies, references), monitor_ways.cpp where they go in it, monitor_maps.cpp its map, monitor_questions.cpp what is
// asked between steps.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <future>
#include <map>
#include <memory>
#include <new>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dccd/monitor_extras.h"
#include "dccd/stream.h"
#include "stream/own_voxels.h"
#include "stream/patch_tracker.h"

namespace dccd {

/// The body's mesh, and its way from where the one frame has it to where the other one does; they may be the same.
void placeBetween(const std::shared_ptr<const MeshFrame>& from, const std::shared_ptr<const MeshFrame>& to, Body& body);

/// The newest of so many maps without what is own, and how long that took. Nothing of the monitor's: what is made of it
/// stays within the library.
struct ToldMaps {
  ObstacleMap map;
  std::size_t count = 0;
  double ms = 0;
};

/// By whom distances are read, if that is not everybody.
struct DistancesRead {
  std::vector<SpeedBound> bounds;
  std::optional<SpeedLaw> law;
};

struct Monitor::Impl {
  static Impl& of(Monitor& monitor) { return *monitor.impl_; }

  /// A frame of the clock body on its way to an outcome: a step from `from` to `to`, or a status without one.
  struct Pending {
    StepStatus status = StepStatus::OK;
    std::shared_ptr<const MeshFrame> from, to;
    StampNs stamp_ns = 0;
    std::int64_t arrival_ns = 0, since_ns = 0;  // of the message, and when it was pushed
    std::uint64_t sequence = 0;
    std::string reason;
  };
  /// What neighbours are measured in, one entry a body; positions are null where nothing is left out.
  struct References {
    std::vector<std::shared_ptr<const Positions>> positions;
    std::vector<std::shared_ptr<const Topology>> topologies;
  };

  /// By body, and last of the map: somebody looked where it was in all of a step, and said so where it is not known.
  using Shown = std::vector<bool>;

  MonitorOptions options;
  std::vector<Body> bodies;  // as they were given, without mesh and motion
  std::vector<MeshStore> stores;
  std::vector<FrameCounters> counters;
  std::deque<Pending> pending;
  ObstacleMap map, trusted;              // in force; what is occupied besides
  std::deque<ObstacleMap> maps_to_come;  // as they were given: newer than what is known of the bodies
  std::uint64_t map_number = 0;          // of the last one that came
  OwnVoxelFinder own_voxels;
  double own_voxels_ms = 0;              // of the step that is made
  StampNs told_from_ns = 0;              // since when the bodies' ways are needed for the map that is told beside steps
  std::vector<std::string> thinned_out;  // of that step, in words
  const FrameTracks* tracks = nullptr;
  std::optional<DistancesRead> distances_read;
  History history, side_history, doubt_history;  // of steps; of predictions and checks; of voxels in doubt
  PatchTracker tracker;
  std::shared_ptr<const Step> last;  // the step before, where nothing has come between; null: none
  References references;
  std::vector<std::uint64_t> runs, last_runs;  // per body, the run without a seam that this step, the last one is in
  std::vector<std::uint64_t> told_runs;        // per body, the run that outcomes have told of so far; 0: none
  bool finishing = false;
  std::atomic<bool> cancelled{false};
  StepListener* listener = nullptr;
  std::uint64_t sequence = 0;
  std::future<ToldMaps> telling;  // last, so that its end is waited for before anything that it reads is gone

  Impl(const MonitorOptions& o, std::vector<Body> b) : options(o), bodies(std::move(b)) {
    stores.assign(bodies.size(), MeshStore(options.store));
    counters.resize(bodies.size());
    runs.resize(bodies.size());
    told_runs.resize(bodies.size());
    forgetReferences();
  }

  Deadline deadlineAfter(double ms) const { return Deadline::after(ms).orWhen(cancelled); }
  bool isStream(std::size_t body) const { return bodies.at(body).motion == BodyMotionKind::STREAM; }
  /// All or nothing. Counts the frame, or has it told as a step.
  StepStatus push(std::size_t body, MeshFrame frame, std::int64_t now_ns);
  /// Where there is no memory for the reason, the status alone tells.
  void drop(Pending& step, StepStatus status, std::string_view reason) noexcept {
    step.status = status;
    try {
      step.reason = reason;
    } catch (const std::bad_alloc&) {
      step.reason.clear();
    }
  }
  void dropWaiting(StepStatus status, std::string_view reason) {
    for (Pending& step : pending) {
      if (step.status == StepStatus::OK) drop(step, status, reason);
    }
  }
  void jumpBackTo(StampNs stamp_ns);
  /// Whether the body may still be where the step needs it. A step that it will never be there for is dropped.
  bool waitsFor(std::size_t body, Pending& step, bool timed_out);
  /// Where the body's run is another one than outcomes have told of, the step is one of seam, once.
  void dropAtSeam(std::size_t body, Pending& step);
  Step place(const Pending& pending);
  static void sayUnknown(const std::string& name, const std::string& why, Step& step);
  void lookBetween(std::size_t body, Step& step) const;
  bool isForgotten(const MeshFrame& frame) const;
  std::vector<Knot> trackOf(const MeshFrame& from, const MeshFrame& to, std::string& why) const;
  std::shared_ptr<const MeshFrame> frameAt(std::size_t body, StampNs stamp_ns, Step& step) const;
  bool findPlaces(const MeshStore::Stretch& stretch, const Step& step, const Body& body, std::vector<Waypoint>& places,
                  std::string& why) const;
  /// The body's waypoints; `who`, in words; stretches: its frames in and around the step, oldest first. False: they
  /// leave some of it open.
  bool follow(const std::string& who, const std::vector<MeshStore::Stretch>& stretches, Body& body, Step& step) const;
  /// Says of the step what came of the body between the stamps and was not used.
  void lookForUnused(std::size_t body, StampNs from_ns, StampNs to_ns, Step& step) const;
  /// The same of what is held where it was placed once: static bodies and the map. epoch: of the step's first frame.
  void lookAtHeld(std::uint64_t epoch, Shown& shown, Step& step) const;
  bool lookAtHeld(std::size_t body, std::uint64_t epoch, Step& step) const;
  void takeAlong(std::size_t body, std::uint64_t epoch, const Eigen::AlignedBox3d& bounds, Step& step) const;
  void sayUnshown(const Shown& shown, Step& step) const;
  void keepReferences(Step& step, References& kept) const;
  void forgetReferences();
  /// Nothing is carried over a seam.
  void forgetLast();
  bool separates(const Body& body) const;
  std::vector<TrackedBody> tracked() const;
  void takeMaps(StampNs known_until_ns);
  /// What is told beside steps comes into force, if that is done.
  void finishTelling();
  void awaitTelling() const {
    if (telling.valid()) telling.wait();
  }
  bool tellsBeside() const {
    return options.own_voxels_beside && std::any_of(bodies.begin(), bodies.end(), ownsVoxels);
  }
  void tellBeside(std::size_t count, std::vector<TrackedBody> bodies_tracked);
  /// Outside of a step: what is own is followed, as far as the bodies' ways are known.
  void followOwnVoxels(StampNs stamp_ns);
  void tellBetweenSteps();
  void limitMapsToCome();
  void forgetOwnVoxels(std::size_t body);
  /// Whether it can be used together with the one that is trusted; else there is none.
  bool fitsTrusted(const ObstacleMap& next);
  void settleDoubt(Step& step, const Deadline& deadline);
  StampNs wayNeededFrom(std::size_t body, StampNs stamp_ns) const;
  ObstacleMap usableMap(StampNs stamp_ns) const;
  /// With which of its patches are those of the step before.
  Outcome runStep(const Pending& pending, const Deadline& deadline);
};

}  // namespace dccd
