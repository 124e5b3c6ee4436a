// What a monitor holds and does: monitor.cpp has its frames and steps, monitor_inputs.cpp what a step is computed from
// (bodies, references, map), monitor_questions.cpp what is asked between steps.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "dccd/monitor.h"
#include "step/step_runner.h"

namespace dccd {

struct Monitor::Impl {
  /// A frame of the clock body on its way to an outcome: a step from `from` to `to`, or a status without one.
  struct Pending {
    StepStatus status = StepStatus::OK;
    std::shared_ptr<const MeshFrame> from, to;
    StampNs stamp_ns = 0;
    std::int64_t since_ns = 0;
    std::uint64_t sequence = 0;
    std::string reason;
  };
  enum class Ready : std::uint8_t { YES, WAIT, NEVER };
  /// What the minimum separation measures neighbours in, one entry a body; frames are null where nothing is left out.
  struct References {
    std::vector<std::shared_ptr<const ReferenceFrame>> frames;
    std::vector<std::shared_ptr<const Topology>> topologies;
  };

  MonitorOptions options;
  std::vector<MonitorBody> bodies;
  std::vector<MeshStore> stores;
  std::vector<FrameCounters> counters;
  std::deque<Pending> pending;
  MonitorMap map;
  std::shared_ptr<const VoxelSurface> reduced_from, reduced;  // the map's surface, and what exclude_boxes leave of it
  std::uint64_t excluded_voxels = 0;
  StepRunner runner;
  std::unique_ptr<StepRunner> side_runner;  // predictions and checks; made when first asked for
  double side_budget_ms = 0;
  StepInput input, side_input;
  References references;
  std::vector<std::uint64_t> runs, last_runs;
  StampNs last_end_ns = 0;
  double last_duration_s = 0;
  bool has_last = false, finishing = false;
  std::string off_path;  // why the step's paths are not those that were seen; empty: they are
  StepListener* listener = nullptr;
  std::uint64_t sequence = 0;

  Impl(const MonitorOptions& o, std::vector<MonitorBody> b) : options(o), bodies(std::move(b)), runner(o.detector) {
    stores.assign(bodies.size(), MeshStore(options.store));
    counters.resize(bodies.size());
    input.resize(bodies.size());
    runs.resize(bodies.size());
    forgetReferences();
  }

  static double seconds(StampNs from, StampNs to) { return static_cast<double>(to - from) * 1e-9; }
  bool isStream(std::size_t body) const { return bodies[body].motion == BodyMotionKind::STREAM; }
  void drop(Pending& step, StepStatus status, const std::string& reason) {
    step.status = status;
    step.reason = reason;
  }
  void onClockFrame(StepStatus status, StampNs stamp_ns, std::int64_t now_ns, std::string reason);
  Ready ready(Pending& step, bool timed_out);
  Ready placeable(std::size_t body, Pending& step, bool timed_out);
  void place(const Pending& step);
  void lookBetween(std::size_t body, StampNs from_ns, StampNs to_ns);
  void keepReferences(StepInput& at, References& kept) const;
  void forgetReferences();
  bool separates(std::size_t body, const std::vector<double>& radius_m) const;
  MonitorMap usableMap(StampNs stamp_ns) const;
  MonitorMap withoutExcluded(MonitorMap used);
  void runStep(const Pending& step, StepOutcome& outcome);
  /// What a step, a check and a prediction have in common.
  void runOn(StepRunner& on, const StepInput& at, const MonitorMap& used, bool continues, StepOutcome& outcome,
             StepRunner* predecessor = nullptr);
  StepRunner& side(double budget_ms);
};

}  // namespace dccd
