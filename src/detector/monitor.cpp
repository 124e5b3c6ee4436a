#include "deformable_ccd/monitor.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "detector/step_runner.h"
#include "mesh/seam_reason.h"
#include "obstacle/excluded_leaves.h"

namespace deformable_ccd {

namespace {

void check(const MonitorOptions& options, std::size_t bodies) {
  const auto require = [](bool good, const std::string& text) {
    if (!good) throw std::invalid_argument(text);
  };
  require(options.clock_body < bodies, "clock_body is not one of the bodies");
  require(options.sync_timeout_s >= 0 && std::isfinite(options.sync_timeout_s),
          "sync_timeout_s must be finite and 0 or more, is " + std::to_string(options.sync_timeout_s));
  require(options.max_waiting >= 1, "max_waiting must be 1 or more");
  require(options.octomap_timeout_s >= 0, "octomap_timeout_s must be 0 (never) or more");
  require(options.rigid_tolerance_m > 0, "rigid_tolerance_m must be above 0");
  require(options.max_substeps >= 1, "max_substeps must be 1 or more");
  require(options.look_ahead_s >= 0 && std::isfinite(options.look_ahead_s),
          "look_ahead_s must be finite and 0 (off) or more, is " + std::to_string(options.look_ahead_s));
  for (const Box& box : options.exclude_boxes) require(!box.empty(), "exclude_boxes: a box's min exceeds its max");
}

std::vector<double> largerRadii(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) return a.empty() ? b : a;
  std::vector<double> larger(a.size());
  for (std::size_t v = 0; v < a.size(); ++v) larger[v] = std::max(a[v], b[v]);
  return larger;
}

double largest(const std::vector<double>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

double seconds(StampNs from, StampNs to) { return static_cast<double>(to - from) * 1e-9; }

}  // namespace

std::uint64_t FrameCounters::processed() const {
  std::uint64_t sum = 0;
  for (std::size_t s = 0; s < by_status.size(); ++s) sum += isAnswered(static_cast<StepStatus>(s)) ? by_status[s] : 0;
  return sum;
}

std::uint64_t FrameCounters::started() const {
  std::uint64_t sum = 0;
  for (std::size_t s = 0; s < by_status.size(); ++s) sum += isSeam(static_cast<StepStatus>(s)) ? by_status[s] : 0;
  return sum;
}

std::uint64_t FrameCounters::skipped() const {
  std::uint64_t sum = 0;
  for (const std::uint64_t n : by_status) sum += n;
  return sum - processed() - started();
}

FrameCounters& FrameCounters::operator+=(const FrameCounters& other) {
  received += other.received;
  receipt_stamps += other.receipt_stamps;
  for (std::size_t s = 0; s < by_status.size(); ++s) by_status[s] += other.by_status[s];
  return *this;
}

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
  StepInput input, side_input;
  std::vector<std::shared_ptr<const ReferenceFrame>> references;
  std::vector<std::shared_ptr<const Topology>> reference_topologies;
  std::vector<std::uint64_t> runs, last_runs;
  StampNs last_end_ns = 0;
  double last_duration_s = 0;
  bool has_last = false, map_changed = true, finishing = false;
  StepListener* listener = nullptr;
  std::uint64_t sequence = 0;

  Impl(const MonitorOptions& o, std::vector<MonitorBody> b)
      : options(o), bodies(std::move(b)), runner(o.detector) {
    stores.assign(bodies.size(), MeshStore(options.store));
    counters.resize(bodies.size());
    input.resize(bodies.size());
    runs.resize(bodies.size());
    forgetReferences();
  }

  bool isStream(std::size_t body) const { return bodies[body].motion == BodyMotionKind::STREAM; }
  void drop(Pending& step, StepStatus status, const std::string& reason) {
    step.status = status;
    step.reason = reason;
  }
  void onClockFrame(StepStatus status, StampNs stamp_ns, std::int64_t now_ns, std::string reason);
  Ready ready(Pending& step, bool timed_out);
  Ready placeable(std::size_t body, Pending& step, bool timed_out);
  void place(const Pending& step);
  void keepReferences(StepInput& at);
  void forgetReferences();
  bool separates(std::size_t body, const std::vector<double>& radius_m) const;
  MonitorMap usableMap(StampNs stamp_ns) const;
  MonitorMap withoutExcluded(MonitorMap used);
  void runStep(const Pending& step, StepOutcome& outcome);
  void finishOutcome(StepOutcome& outcome, const MonitorMap& used) const;
  StepRunner& side();
};

Monitor::Monitor(const MonitorOptions& options, std::vector<MonitorBody> bodies) {
  check(options, bodies.size());
  if (bodies[options.clock_body].motion == BodyMotionKind::STATIC) {
    throw std::invalid_argument("clock_body '" + bodies[options.clock_body].name + "' is static and has no clock");
  }
  impl_ = std::make_unique<Impl>(options, std::move(bodies));
}

Monitor::~Monitor() = default;

const MonitorOptions& Monitor::options() const { return impl_->options; }
const std::vector<MonitorBody>& Monitor::bodies() const { return impl_->bodies; }
const MonitorMap& Monitor::map() const { return impl_->map; }
const std::vector<LeftOutPair>& Monitor::leftOut() const { return impl_->runner.leftOut(); }
const FrameCounters& Monitor::counters(std::size_t body) const { return impl_->counters.at(body); }

void Monitor::setOptions(const MonitorOptions& options) {
  check(options, impl_->bodies.size());
  if (options.clock_body != impl_->options.clock_body) throw std::invalid_argument("clock_body must stay");
  for (MeshStore& store : impl_->stores) store.setOptions(options.store);
  impl_->runner.setOptions(options.detector);
  impl_->side_runner.reset();
  // Other boxes are another map.
  impl_->map_changed |= !options.exclude_boxes.empty() || !impl_->options.exclude_boxes.empty();
  impl_->reduced_from = nullptr;
  impl_->options = options;
}

void Monitor::countReceived(std::size_t body, std::uint64_t count, std::uint64_t receipt_stamps) {
  impl_->counters.at(body).received += count;
  impl_->counters.at(body).receipt_stamps += receipt_stamps;
}

void Monitor::countDropped(std::size_t body, StepStatus status, std::uint64_t count) {
  impl_->counters.at(body).by_status.at(static_cast<std::size_t>(status)) += count;
}

void Monitor::setReference(std::size_t body, std::shared_ptr<const Topology> topology,
                           std::shared_ptr<const ReferenceFrame> reference) {
  impl_->reference_topologies.at(body) = std::move(topology);
  impl_->references.at(body) = std::move(reference);
}

void Monitor::setListener(StepListener* listener) { impl_->listener = listener; }

FrameCounters Monitor::total() const {
  FrameCounters sum;
  for (const FrameCounters& counters : impl_->counters) sum += counters;
  return sum;
}

void Monitor::setMap(MonitorMap map) {
  impl_->map = std::move(map);
  impl_->map_changed = true;
  impl_->reduced_from = nullptr;
}

StepStatus Monitor::push(std::size_t body, MeshFrame frame, std::int64_t now_ns) {
  Impl& m = *impl_;
  const StampNs stamp_ns = frame.stamp_ns;
  m.finishing = false;
  if (!m.isStream(body)) {
    // The newest frame holds at all times; an older one, or the same again, is as good as any.
    m.stores.at(body).clear();
    const StepStatus status = m.stores[body].push(std::move(frame));
    m.counters[body].count(isSeam(status) ? StepStatus::OK : status);
    m.has_last = false;
    return status;
  }
  MeshStore& store = m.stores.at(body);
  const std::shared_ptr<const MeshFrame> before = store.empty() ? nullptr : store.newestShared();
  const StepStatus status = store.push(std::move(frame));
  if (body == m.options.clock_body) {
    const std::string reason = before ? seamReason(status, *before, store.newest(), m.options.store) : "";
    m.onClockFrame(status, stamp_ns, now_ns, reason);
  } else {
    m.counters[body].count(status);
  }
  return status;
}

void Monitor::Impl::onClockFrame(StepStatus status, StampNs stamp_ns, std::int64_t now_ns, std::string reason) {
  const MeshStore& store = stores[options.clock_body];
  Pending step{status, nullptr, nullptr, stamp_ns, now_ns, ++sequence, std::move(reason)};
  if (status == StepStatus::OK) {
    step.from = store.previous();
    step.to = store.newestShared();
  } else if (status == StepStatus::TIME_JUMP) {
    // What waits for other bodies will not get it any more, and frames of theirs from the old time are of no use.
    for (Pending& waiting : pending) {
      if (waiting.status == StepStatus::OK) drop(waiting, StepStatus::NO_BODY, "time jumped back while waiting");
    }
    for (std::size_t b = 0; b < stores.size(); ++b) {
      const bool stale = b != options.clock_body && isStream(b) && !stores[b].empty() &&
                         seconds(stamp_ns, stores[b].newest().stamp_ns) > options.store.max_step_s;
      if (stale) stores[b].clear();
    }
  }
  if (pending.size() >= options.max_waiting) {
    for (Pending& waiting : pending) {
      if (waiting.status != StepStatus::OK) continue;
      drop(waiting, StepStatus::NO_BODY, "more than max_waiting steps wait for other bodies");
      break;
    }
  }
  pending.push_back(std::move(step));
}

void Monitor::skip(std::size_t body, StepStatus status, StampNs stamp_ns, const std::string& reason) {
  Impl& m = *impl_;
  if (body == m.options.clock_body) {
    m.pending.push_back({status, nullptr, nullptr, stamp_ns, 0, ++m.sequence, reason});
  } else {
    m.counters.at(body).count(status);
  }
}

bool Monitor::waiting() const { return !impl_->pending.empty(); }

void Monitor::finish() { impl_->finishing = true; }

void Monitor::reset(StepStatus status) {
  Impl& m = *impl_;
  for (const auto& step : m.pending) m.counters[m.options.clock_body].count(step.to ? status : step.status);
  m.pending.clear();
  for (std::size_t b = 0; b < m.stores.size(); ++b) {
    if (m.isStream(b)) m.stores[b].clear();
  }
  if (status == StepStatus::RESET) m.forgetReferences();
  m.has_last = false;
}

Monitor::Impl::Ready Monitor::Impl::placeable(std::size_t body, Pending& step, bool timed_out) {
  const MeshStore& store = stores[body];
  const std::string name = "body '" + bodies[body].name + "' ";
  if (!isStream(body)) {
    if (!store.empty()) return Ready::YES;
    if (!timed_out) return Ready::WAIT;
    drop(step, StepStatus::NO_BODY, name + "has not been received yet");
    return Ready::NEVER;
  }
  std::uint64_t run_t0 = 0;
  const Lookup at_t1 = store.lookup(step.to->stamp_ns, &runs[body]);
  if (at_t1 == Lookup::NOT_YET) {
    if (!timed_out) return Ready::WAIT;
    drop(step, StepStatus::NO_BODY, name + (store.empty() ? "has not been received yet"
                                                          : "has no frame at or after the end of the step"));
    return Ready::NEVER;
  }
  const Lookup at_t0 = store.lookup(step.from->stamp_ns, &run_t0);
  if (at_t1 == Lookup::READY && at_t0 == Lookup::READY && run_t0 == runs[body]) return Ready::YES;
  drop(step, store.runReason() == StepStatus::FIRST_FRAME ? StepStatus::NO_BODY : store.runReason(),
       name + "has no unbroken frames around the step (" + toString(store.runReason()) + ")");
  return Ready::NEVER;
}

Monitor::Impl::Ready Monitor::Impl::ready(Pending& step, bool timed_out) {
  Ready all = Ready::YES;
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    if (b == options.clock_body) continue;
    const Ready one = placeable(b, step, timed_out);
    if (one == Ready::NEVER) return one;
    if (one == Ready::WAIT) all = Ready::WAIT;
  }
  return all;
}

void Monitor::Impl::place(const Pending& step) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    MeshStore& store = stores[b];
    if (b == options.clock_body) {
      input.t0[b] = step.from->positions;
      input.t1[b] = step.to->positions;
      input.topologies[b] = step.to->topology;
      input.rigid[b] = step.to->rigid;
      input.pose_t0[b] = step.from->pose;
      input.pose_t1[b] = step.to->pose;
      input.radius_m[b] = largerRadii(step.from->radius_m, step.to->radius_m);
      continue;
    }
    input.topologies[b] = store.newest().topology;
    input.rigid[b] = isStream(b) && store.newest().rigid;
    if (!isStream(b)) {
      input.t0[b] = input.t1[b] = store.newest().positions;
      input.radius_m[b] = store.newest().radius_m;
      continue;
    }
    store.positionsAt(step.from->stamp_ns, input.t0[b]);
    store.positionsAt(step.to->stamp_ns, input.t1[b]);
    if (input.rigid[b]) {
      input.pose_t0[b] = store.poseAt(step.from->stamp_ns);
      input.pose_t1[b] = store.poseAt(step.to->stamp_ns);
    }
    store.radiiOver(step.from->stamp_ns, step.to->stamp_ns, input.radius_m[b]);
    store.forgetBefore(step.to->stamp_ns);
  }
  keepReferences(input);
}

void Monitor::Impl::forgetReferences() {
  references.assign(bodies.size(), nullptr);
  reference_topologies.assign(bodies.size(), nullptr);
}

/// The first frame of each topology is what a minimum separation measures neighbours in. Radii that grow past those of
/// the reference make a new list; twice as large, so that it happens seldom.
void Monitor::Impl::keepReferences(StepInput& at) {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    const bool same = reference_topologies[b] && (reference_topologies[b] == at.topologies[b] ||
                                                  *reference_topologies[b] == *at.topologies[b]);
    if (!same) {
      reference_topologies[b] = at.topologies[b];
      const bool needed = bodies[b].self_collision && !bodies[b].rigid && separates(b, at.radius_m[b]);
      references[b] = needed ? std::make_shared<const ReferenceFrame>(ReferenceFrame{at.t0[b], {}}) : nullptr;
    }
    const double now_m = largest(at.radius_m[b]), listed_m = references[b] ? largest(references[b]->radius_m) : now_m;
    if (now_m > listed_m) {
      std::vector<double> radius_m(at.t0[b].size(), std::max(now_m, 2 * listed_m));
      references[b] =
          std::make_shared<const ReferenceFrame>(ReferenceFrame{references[b]->positions, std::move(radius_m)});
    }
    at.references[b] = references[b];
  }
}

bool Monitor::Impl::separates(std::size_t body, const std::vector<double>& radius_m) const {
  const auto named = [](const SeparationFrom& from) { return from.separation_m > 0; };
  return bodies[body].minimum_separation_m > 0 || !radius_m.empty() ||
         std::any_of(bodies[body].separations.begin(), bodies[body].separations.end(), named);
}

MonitorMap Monitor::Impl::usableMap(StampNs stamp_ns) const {
  MonitorMap used = map;
  if (!options.obstacle_expected) return used;
  if (!used.surface) {
    if (used.problem.empty()) used.problem = "no octomap has been received yet";
  } else if (options.octomap_timeout_s > 0 && used.stamp_ns > 0 &&
             seconds(used.stamp_ns, stamp_ns) > options.octomap_timeout_s) {
    used.surface = nullptr;
    used.problem = "the octomap is older than octomap_timeout_s";
  }
  return used;
}

MonitorMap Monitor::Impl::withoutExcluded(MonitorMap used) {
  if (options.exclude_boxes.empty() || !used.surface) return used;
  if (reduced_from != used.surface) {
    RemainingLeaves remaining = leavesOutside(used.surface->leaves(), used.surface->resolution(),
                                              used.map_from_fixed.inverse(), options.exclude_boxes);
    reduced = remaining.excluded_voxels == 0
                  ? used.surface
                  : VoxelSurface::build(used.surface->resolution(), std::move(remaining.leaves));
    excluded_voxels = remaining.excluded_voxels;
    reduced_from = used.surface;
  }
  used.surface = reduced;
  return used;
}

void Monitor::Impl::finishOutcome(StepOutcome& outcome, const MonitorMap& used) const {
  if (!options.obstacle_expected || used.surface) return;
  outcome.status = StepStatus::NO_MAP;
  outcome.reason = used.problem + "; checked without it";
  outcome.clear = false;
}

void Monitor::Impl::runStep(const Pending& step, StepOutcome& outcome) {
  place(step);
  outcome.start_ns = step.from->stamp_ns;
  const MonitorMap used = usableMap(step.to->stamp_ns);
  // Interpolated ends repeat bit for bit as long as every body stays in its run.
  const bool continues = has_last && !map_changed && last_end_ns == outcome.start_ns && last_runs == runs;
  has_last = false;
  if (listener) {
    listener->onStep({outcome.start_ns, outcome.stamp_ns, outcome.sequence, &bodies, &options, &input.topologies,
                      &input.t0, &input.t1, &input.rigid, &input.pose_t0, &input.pose_t1, &input.radius_m, &input.references, &used});
  }
  runner.run(input, bodies, options, withoutExcluded(used), continues, outcome);
  if (used.surface && !options.exclude_boxes.empty()) outcome.excluded_voxels = excluded_voxels;
  finishOutcome(outcome, used);
  has_last = true;
  map_changed = map_changed && !used.surface && map.surface;
  last_end_ns = outcome.stamp_ns;
  last_duration_s = outcome.duration_s();
  last_runs = runs;
}

bool Monitor::next(std::int64_t now_ns, StepOutcome& outcome) {
  Impl& m = *impl_;
  if (m.pending.empty()) return false;
  Impl::Pending& step = m.pending.front();
  if (step.status == StepStatus::OK) {
    const bool timed_out = m.finishing || seconds(step.since_ns, now_ns) >= m.options.sync_timeout_s;
    if (m.ready(step, timed_out) == Impl::Ready::WAIT) return false;
  }
  outcome = StepOutcome{};
  outcome.status = step.status;
  outcome.reason = step.reason;
  outcome.sequence = step.sequence;
  outcome.start_ns = outcome.stamp_ns = step.stamp_ns;
  if (step.status == StepStatus::OK) {
    try {
      m.runStep(step, outcome);
    } catch (const std::exception& error) {
      const std::string what = error.what();
      outcome = StepOutcome{};
      outcome.status = StepStatus::INTERNAL_ERROR;
      outcome.reason = what;
      outcome.sequence = step.sequence;
      outcome.start_ns = outcome.stamp_ns = step.stamp_ns;
    }
    if (m.listener) m.listener->onOutcome(outcome);
  } else {
    m.has_last = m.has_last && !isSeam(step.status);
  }
  m.counters[m.options.clock_body].count(outcome.status);
  m.pending.pop_front();
  return true;
}

StepRunner& Monitor::Impl::side() {
  if (!side_runner) side_runner = std::make_unique<StepRunner>(options.detector);
  return *side_runner;
}

StepOutcome Monitor::checkNow() {
  Impl& m = *impl_;
  StepOutcome outcome;
  outcome.status = StepStatus::NO_BODY;
  m.side_input.resize(m.bodies.size());
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    if (m.stores[b].empty()) {
      outcome.reason = "body '" + m.bodies[b].name + "' has not been received yet";
      return outcome;
    }
    const MeshFrame& frame = m.stores[b].newest();
    m.side_input.t0[b] = m.side_input.t1[b] = frame.positions;
    m.side_input.topologies[b] = frame.topology;
    m.side_input.rigid[b] = 0;
    m.side_input.radius_m[b] = frame.radius_m;
  }
  m.keepReferences(m.side_input);
  outcome.start_ns = outcome.stamp_ns = m.stores[m.options.clock_body].newest().stamp_ns;
  const MonitorMap used = m.usableMap(outcome.stamp_ns);
  m.side().run(m.side_input, m.bodies, m.options, m.withoutExcluded(used), false, outcome);
  m.finishOutcome(outcome, used);
  return outcome;
}

StepOutcome Monitor::predict() {
  Impl& m = *impl_;
  StepOutcome outcome;
  outcome.status = StepStatus::NO_BODY;
  outcome.reason = "no step has been answered yet";
  if (!m.has_last || !(m.options.look_ahead_s > 0) || !(m.last_duration_s > 0)) return outcome;
  const double ahead = m.options.look_ahead_s / m.last_duration_s;
  m.side_input.resize(m.bodies.size());
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    m.side_input.topologies[b] = m.input.topologies[b];
    m.side_input.rigid[b] = m.input.rigid[b];
    m.side_input.radius_m[b] = m.input.radius_m[b];
    m.side_input.references[b] = m.input.references[b];
    m.side_input.t0[b] = m.input.t1[b];
    Positions& to = m.side_input.t1[b];
    to.resize(m.input.t1[b].size());
    if (m.input.rigid[b]) {
      m.side_input.pose_t0[b] = m.input.pose_t1[b];
      m.side_input.pose_t1[b] = interpolate(m.input.pose_t0[b], m.input.pose_t1[b], 1 + ahead);
      const Eigen::Isometry3d moved = m.side_input.pose_t1[b] * m.input.pose_t1[b].inverse();
      for (std::size_t v = 0; v < to.size(); ++v) to[v] = moved * m.input.t1[b][v];
    } else {
      for (std::size_t v = 0; v < to.size(); ++v) {
        to[v] = m.input.t1[b][v] + ahead * (m.input.t1[b][v] - m.input.t0[b][v]);
      }
    }
  }
  outcome.reason.clear();
  outcome.start_ns = m.last_end_ns;
  outcome.stamp_ns = m.last_end_ns + static_cast<StampNs>(std::llround(m.options.look_ahead_s * 1e9));
  const MonitorMap used = m.usableMap(m.last_end_ns);
  m.side().run(m.side_input, m.bodies, m.options, m.withoutExcluded(used), false, outcome);
  m.finishOutcome(outcome, used);
  return outcome;
}

}  // namespace deformable_ccd
