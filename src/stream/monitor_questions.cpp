// What is asked between steps: is anything in contact now, and what would be next if all went on as it does?
#include <cmath>
#include <limits>

#include "step/history.h"
#include "stream/monitor_impl.h"

namespace dccd {
namespace {

/// Nobody reads the distances of what is asked between steps.
Options withoutDistances(Options options) {
  options.clearance.wanted = false;
  return options;
}

}  // namespace

Outcome Monitor::checkNow() {
  Impl& m = *impl_;
  Step step;
  step.bodies = m.bodies;
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    if (!m.stores[b].empty()) {
      placeBetween(m.stores[b].newestShared(), m.stores[b].newestShared(), step.bodies[b]);
      continue;
    }
    Outcome outcome;
    outcome.status = StepStatus::NO_BODY;
    outcome.reason = "body '" + m.bodies[b].name + "' has not been received yet";
    return outcome;
  }
  // A copy: what waiting steps are measured in must not depend on whether somebody asked.
  Impl::References references = m.references;
  m.keepReferences(step, references);
  step.start_ns = step.stamp_ns = m.stores[m.options.clock_body].newest().stamp_ns;
  step.map = m.usableMap(step.stamp_ns);
  Impl::Shown shown(m.bodies.size() + 1);
  m.lookAtHeld(m.stores[m.options.clock_body].newest().carrier.epoch, shown, step);
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    if (!m.isStream(b)) continue;
    const MeshFrame& newest = m.stores[b].newest();
    std::string why;
    m.trackOf(newest, newest, why);
    if (!why.empty()) m.sayUnknown("body '" + m.bodies[b].name + "'", why, step);
    m.lookForUnused(b, newest.stamp_ns, std::numeric_limits<StampNs>::max(), step);  // what came after it
    const double apart_s = std::abs(secondsBetween(newest.stamp_ns, step.stamp_ns));
    if (apart_s > m.options.store.max_step_s) {
      m.sayUnknown("body '" + m.bodies[b].name + "'",
                   "its newest frame is " + std::to_string(apart_s) + " s from that of the clock body", step);
    }
    shown[b] = true;
  }
  m.sayUnshown(shown, step);
  m.side_history.clear();
  // Without a budget: nothing is carried over from one question to the next, so a cut answer would stay one.
  Outcome outcome = detect(step, withoutDistances(m.options.detector), m.side_history, Deadline().orWhen(m.cancelled));
  if (m.options.in_cell) outcome.claim.askOfCell();
  outcome.arrival_ns = m.stores[m.options.clock_body].newest().arrival_ns;
  if (m.options.detector.patches) m.tracker.recognise(History::Impl::of(m.side_history).patches, outcome);
  return outcome;
}

Outcome Monitor::predict() {
  Impl& m = *impl_;
  const double last_s = m.last ? m.last->duration_s() : 0;
  if (!(m.options.look_ahead_s > 0) || !(last_s > 0)) {
    Outcome outcome;
    outcome.status = StepStatus::NO_BODY;
    outcome.reason = "no step has been answered yet";
    return outcome;
  }
  const Deadline deadline = m.deadlineAfter(tolerance::LOOK_AHEAD_SHARE * timeLimitMs(m.options.detector));
  const double ahead = m.options.look_ahead_s / last_s;
  Step step = *m.last;
  step.start_ns = m.last->stamp_ns;
  step.stamp_ns = step.start_ns + static_cast<StampNs>(std::llround(m.options.look_ahead_s * 1e9));
  step.sequence = 0;
  step.map = m.usableMap(step.start_ns);
  const ObstacleMap& before_map = m.last->map;
  if (step.map.frame_id == before_map.frame_id && !before_map.way.empty()) {
    step.map.map_from_fixed = before_map.fromFixedAt(1);
  }
  step.pose_scale = ahead;
  for (Body& body : step.bodies) {
    const Positions &before = *body.t0, &now = *body.t1;
    Positions to(now.size());
    if (body.turns) {
      // The last step once more, `ahead` times as far, which may be more than half a turn.
      const Eigen::Isometry3d pose_t0 = body.pose_t1, pose_t1 = interpolate(body.pose_t0, body.pose_t1, 2);
      const Eigen::Isometry3d moved = interpolate(pose_t0, pose_t1, ahead) * pose_t0.inverse();
      for (std::size_t v = 0; v < to.size(); ++v) to[v] = moved * now[v];
      body.pose_t0 = pose_t0;
      body.pose_t1 = pose_t1;
    } else {
      for (std::size_t v = 0; v < to.size(); ++v) to[v] = now[v] + ahead * (now[v] - before[v]);
    }
    body.waypoints.clear();
    body.t0 = body.t1;
    body.t1 = share(std::move(to));
  }
  m.side_history.clear();
  Outcome outcome = detect(step, withoutDistances(m.options.detector), m.side_history, deadline);
  if (m.options.detector.patches) m.tracker.recognise(History::Impl::of(m.side_history).patches, outcome);
  return outcome;
}

}  // namespace dccd
