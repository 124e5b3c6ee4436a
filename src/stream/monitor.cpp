#include "dccd/stream.h"

#include <algorithm>
#include <cmath>
#include <new>
#include <set>
#include <stdexcept>
#include <utility>

#include "step/history.h"
#include "stream/monitor_impl.h"
#include "stream/read_distances.h"
#include "stream/seam_reason.h"

namespace dccd {

namespace {

void checkStream(const MonitorOptions& options, std::size_t bodies) {
  const auto require = [](bool good, const std::string& text) {
    if (!good) throw std::invalid_argument(text);
  };
  require(options.clock_body < bodies, "clock_body is not one of the bodies");
  require(options.sync_timeout_s >= 0 && std::isfinite(options.sync_timeout_s),
          "sync_timeout_s must be finite and 0 or more, is " + std::to_string(options.sync_timeout_s));
  require(options.max_waiting >= 1, "max_waiting must be 1 or more");
  require(options.octomap_timeout_s >= 0, "octomap_timeout_s must be 0 (never) or more");
  require(options.look_ahead_s >= 0 && options.look_ahead_s <= 1e8,
          "look_ahead_s must be 0 (off) to 1e8, is " + std::to_string(options.look_ahead_s));
  require(options.own_voxels_lag_s >= 0 && options.own_voxels_lag_s <= tolerance::OWN_PATH_S,
          "own_voxels_lag_s must be 0 to " + std::to_string(static_cast<int>(tolerance::OWN_PATH_S)) + ", is " +
              std::to_string(options.own_voxels_lag_s));
  require(options.patch_gap_s >= 0 && std::isfinite(options.patch_gap_s),
          "patch_gap_s must be finite and 0 or more, is " + std::to_string(options.patch_gap_s));
}

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

Monitor::Monitor(const MonitorOptions& options, std::vector<Body> bodies) {
  checkStream(options, bodies.size());
  check(options.detector);
  if (bodies[options.clock_body].motion == BodyMotionKind::STATIC) {
    throw std::invalid_argument("clock_body '" + bodies[options.clock_body].name + "' is static and has no clock");
  }
  for (const Body& body : bodies) {
    if (body.own_voxels_m == ONE_VOXEL || (body.own_voxels_m >= 0 && std::isfinite(body.own_voxels_m))) continue;
    throw std::invalid_argument("own_voxels_m of body '" + body.name +
                                "' must be ONE_VOXEL or finite and 0 or more, is " + std::to_string(body.own_voxels_m));
  }
  impl_ = std::make_unique<Impl>(options, std::move(bodies));
}

Monitor::~Monitor() = default;

const MonitorOptions& Monitor::options() const { return impl_->options; }
const std::vector<Body>& Monitor::bodies() const { return impl_->bodies; }
double Monitor::stepMs() const {
  const double limit_ms = timeLimitMs(impl_->options.detector);
  return impl_->options.look_ahead_s > 0 ? (1 - tolerance::LOOK_AHEAD_SHARE) * limit_ms : limit_ms;
}
const FrameCounters& Monitor::counters(std::size_t body) const { return impl_->counters.at(body); }

void Monitor::setOptions(const MonitorOptions& options) {
  checkStream(options, impl_->bodies.size());
  check(options.detector, impl_->bodies);
  if (options.clock_body != impl_->options.clock_body) throw std::invalid_argument("clock_body must stay");
  // All of it or nothing: what may refuse comes first.
  const MeshStore checked(options.store);
  for (MeshStore& store : impl_->stores) store.setOptions(options.store);
  impl_->options = options;
}

void Monitor::countReceived(std::size_t body, std::uint64_t count, std::uint64_t receipt_stamps) {
  impl_->counters.at(body).received += count;
  impl_->counters.at(body).receipt_stamps += receipt_stamps;
}

void Monitor::countDropped(std::size_t body, StepStatus status, std::uint64_t count) {
  impl_->counters.at(body).by_status.at(static_cast<std::size_t>(status)) += count;
  if (count > 0) impl_->stores[body].passOver(count, toString(status));
}

void Monitor::setListener(StepListener* listener) { impl_->listener = listener; }

FrameCounters Monitor::total() const {
  FrameCounters sum;
  for (const FrameCounters& counters : impl_->counters) sum += counters;
  return sum;
}

StepStatus Monitor::push(std::size_t body, MeshFrame frame, std::int64_t now_ns) {
  try {
    return impl_->push(body, std::move(frame), now_ns);
  } catch (...) {
    impl_->counters.at(body).count(StepStatus::INTERNAL_ERROR);  // every frame ends in a count
    throw;
  }
}

StepStatus Monitor::Impl::push(std::size_t body, MeshFrame frame, std::int64_t now_ns) {
  finishing = false;
  if (!isStream(body)) {
    // In a store of its own, so that the newest push counts whatever its stamp: a static body's frame holds at all
    // times.
    MeshStore store(options.store);
    store.replace(stores[body], frame.stamp_ns);
    const StepStatus status = store.push(std::move(frame));
    if (isSeam(status)) {
      stores[body] = std::move(store);
      forgetLast();
    }
    counters[body].count(isSeam(status) ? StepStatus::OK : status);
    return status;
  }
  MeshStore& store = stores[body];
  if (body != options.clock_body) {
    const StepStatus status = store.push(std::move(frame));
    counters[body].count(status);
    return status;
  }
  const std::shared_ptr<const MeshFrame> before = store.empty() ? nullptr : store.newestShared();
  // Its place comes first: from where the store has the frame, nothing may throw.
  Pending& step = pending.emplace_back();
  step.stamp_ns = frame.stamp_ns;
  step.arrival_ns = frame.arrival_ns;
  try {
    step.status = store.push(std::move(frame));
  } catch (...) {
    pending.pop_back();
    throw;
  }
  step.since_ns = now_ns;
  step.sequence = ++sequence;
  try {
    if (before) step.reason = seamReason(step.status, *before, store.newest(), options.store);
  } catch (const std::bad_alloc&) {  // the status alone tells
  }
  if (step.status == StepStatus::OK) {
    step.from = store.previous();
    step.to = store.newestShared();
  }
  if (step.status == StepStatus::TIME_JUMP) jumpBackTo(step.stamp_ns);
  const auto waits = [](const Pending& one) { return one.status == StepStatus::OK; };
  const auto oldest = std::find_if(pending.begin(), pending.end() - 1, waits);
  if (pending.size() > options.max_waiting && oldest != pending.end() - 1) {
    drop(*oldest, StepStatus::NO_BODY, "more than max_waiting steps wait for other bodies");
  }
  return step.status;
}

/// Steps that wait for other bodies will not get them any more, and those bodies' frames from before the jump, whose
/// stamps lie after its new time, are of no use.
void Monitor::Impl::jumpBackTo(StampNs stamp_ns) {
  dropWaiting(StepStatus::NO_BODY, "time jumped back while waiting");
  for (std::size_t b = 0; b < stores.size(); ++b) {
    const bool stale = b != options.clock_body && isStream(b) && !stores[b].empty() &&
                       secondsBetween(stamp_ns, stores[b].newest().stamp_ns) > options.store.max_step_s;
    if (stale) stores[b].clear();
  }
}

void Monitor::skip(std::size_t body, StepStatus status, StampNs stamp_ns, const std::string& reason,
                   std::int64_t arrival_ns) {
  Impl& m = *impl_;
  if (body != m.options.clock_body) m.counters.at(body).count(status);
  m.stores.at(body).passOver(1, toString(status) + (reason.empty() ? "" : ": " + reason));
  if (body != m.options.clock_body) return;
  Impl::Pending step;
  step.status = status;
  step.stamp_ns = stamp_ns;
  step.arrival_ns = arrival_ns;
  step.sequence = ++m.sequence;
  step.reason = reason;
  m.pending.push_back(std::move(step));
}

void Monitor::setBody(std::size_t body, Body what) {
  Impl& m = *impl_;
  if (body > m.bodies.size()) throw std::invalid_argument("there is no body " + std::to_string(body));
  if (body == m.options.clock_body) throw std::invalid_argument("clock_body must stay");
  std::vector<Body> bodies = m.bodies;
  bodies.resize(std::max(bodies.size(), body + 1));
  bodies[body] = std::move(what);
  check(m.options.detector, bodies);
  // Should memory end before, there is no body of the new ones.
  m.counters.resize(bodies.size());
  m.runs.resize(bodies.size());
  m.told_runs.resize(bodies.size());
  m.references.positions.resize(bodies.size());
  m.references.topologies.resize(bodies.size());
  m.stores.resize(bodies.size(), MeshStore(m.options.store));
  m.bodies = std::move(bodies);
  m.stores[body].clear();
  m.told_runs[body] = 0;
  m.references.positions[body] = nullptr;
  m.references.topologies[body] = nullptr;
  m.forgetOwnVoxels(body);
}

void Monitor::readDistancesBy(const std::vector<SpeedBound>& bounds, const std::optional<SpeedLaw>& law) {
  impl_->distances_read = DistancesRead{bounds, law};
}

void Monitor::readAllDistances() { impl_->distances_read.reset(); }

void Monitor::setTracks(const FrameTracks* tracks) { impl_->tracks = tracks; }

std::vector<StampNs> Monitor::stampsToCome() const {
  std::set<StampNs> stamps;
  for (const Impl::Pending& step : impl_->pending) {
    if (step.from) stamps.insert({step.from->stamp_ns, step.to->stamp_ns});
  }
  const MeshStore& clock = impl_->stores[impl_->options.clock_body];
  if (!clock.empty()) stamps.insert(clock.newest().stamp_ns);
  return {stamps.begin(), stamps.end()};
}

void Monitor::withdraw(std::size_t body) {
  Impl& m = *impl_;
  if (m.isStream(body) || m.stores.at(body).empty()) return;
  m.stores[body].clear();
  --m.counters[body].by_status[static_cast<std::size_t>(StepStatus::OK)];
  m.forgetLast();
}

void Monitor::cancel() { impl_->cancelled = true; }

void Monitor::dropSteps(StepStatus status, const std::string& reason) { impl_->dropWaiting(status, reason); }

bool Monitor::waiting() const { return !impl_->pending.empty(); }

void Monitor::finish() { impl_->finishing = true; }

void Monitor::reset(StepStatus status) {
  Impl& m = *impl_;
  for (const auto& step : m.pending) {
    m.counters[m.options.clock_body].count(step.status == StepStatus::OK ? status : step.status);
  }
  m.pending.clear();
  for (std::size_t b = 0; b < m.stores.size(); ++b) {
    if (m.isStream(b)) m.stores[b].clear();
  }
  if (status == StepStatus::RESET) m.forgetReferences();
  m.told_runs.assign(m.bodies.size(), 0);
  m.forgetLast();
  m.tracker.seam();
}

void Monitor::Impl::forgetLast() {
  last = nullptr;
  history.clear();
}

Outcome Monitor::Impl::runStep(const Pending& pending, const Deadline& deadline) {
  Step step = place(pending);
  settleDoubt(step, deadline);
  // A step continues the last one if it begins at that one's end and no body has begun a new run in between (ready()
  // has set the runs): only then are interpolated positions at the stamp in common the same bits.
  if (!last || last->stamp_ns != step.start_ns || last_runs != runs) forgetLast();
  for (std::size_t b = 0; b < last_runs.size(); ++b) {
    if (last_runs[b] != runs[b]) tracker.seam(b);
  }
  last = nullptr;  // until this one is done
  if (listener) listener->onStep(step, options.detector);
  std::optional<ReadDistances> readers;
  if (distances_read) readers.emplace(step, distances_read->bounds, distances_read->law);
  History::Impl::of(history).readers = readers ? &*readers : nullptr;
  Outcome outcome = detect(step, options.detector, history, deadline);
  last = outcome.step;
  last_runs = runs;
  outcome.excluded.insert(outcome.excluded.end(), thinned_out.begin(), thinned_out.end());
  const double own_ms = std::exchange(own_voxels_ms, 0);
  outcome.stats[Effect::OWN_VOXELS].ms += own_ms;
  outcome.stats.total_ms += own_ms;
  if (!options.detector.patches) {
    tracker.seam();
    return outcome;
  }
  const auto start = Deadline::Clock::now();
  try {
    tracker.expect(options.detector.expected);
    tracker.follow(History::Impl::of(history).patches, options.patch_gap_s, outcome);
  } catch (...) {
    tracker.forget(outcome);
    throw;
  }
  const double ms = msSince(start);
  outcome.stats[Effect::PATCHES].ms += ms;
  outcome.stats.total_ms += ms;
  return outcome;
}

bool Monitor::next(std::int64_t now_ns, Outcome& outcome) {
  Impl& m = *impl_;
  if (m.pending.empty()) {
    m.tellBetweenSteps();
    return false;
  }
  Impl::Pending& step = m.pending.front();
  const bool timed_out = m.finishing || secondsBetween(step.since_ns, now_ns) >= m.options.sync_timeout_s;
  bool waits = false;
  for (std::size_t b = 0; b < m.bodies.size() && step.status == StepStatus::OK; ++b) {
    if (b != m.options.clock_body && m.waitsFor(b, step, timed_out)) waits = true;
  }
  if (waits && step.status == StepStatus::OK) {
    m.tellBetweenSteps();
    return false;
  }
  const auto without = [&](StepStatus status, const std::string& reason) {
    outcome = Outcome{};
    outcome.status = status;
    outcome.reason = reason;
    outcome.sequence = step.sequence;
    outcome.start_ns = outcome.stamp_ns = step.stamp_ns;
  };
  if (step.status == StepStatus::OK) {
    try {
      outcome = m.runStep(step, m.deadlineAfter(stepMs()));
    } catch (const std::exception& error) {
      without(StepStatus::INTERNAL_ERROR, error.what());
      m.forgetLast();
    }
    m.tracker.tell(outcome);
    if (m.listener) m.listener->onOutcome(outcome);
    if (m.options.in_cell) outcome.claim.askOfCell();
  } else {
    without(step.status, step.reason);
    if (step.status == StepStatus::DISABLED) m.followOwnVoxels(step.stamp_ns);
    if (isSeam(step.status)) {
      m.forgetLast();
      if (!step.to) {  // else it is another body's, which runStep() sees
        m.tracker.seam();
        m.told_runs.assign(m.bodies.size(), 0);
      }
    }
    m.tracker.tell(outcome);
  }
  outcome.arrival_ns = step.arrival_ns;
  m.counters[m.options.clock_body].count(outcome.status);
  m.pending.pop_front();
  return true;
}

}  // namespace dccd
