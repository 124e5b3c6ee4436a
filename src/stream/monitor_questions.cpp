// What is asked between steps: is anything in contact now, and what would be next if all went on as it does?
#include <cmath>

#include "stream/monitor_impl.h"

namespace dccd {

StepRunner& Monitor::Impl::side(double budget_ms) {
  DetectorOptions side_options = options.detector;
  side_options.step_budget_ms = budget_ms;
  if (!side_runner) {
    side_runner = std::make_unique<StepRunner>(side_options);
  } else if (budget_ms != side_budget_ms) {
    side_runner->setOptions(side_options);
  }
  side_budget_ms = budget_ms;
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
  // A copy: what waiting steps are measured in must not depend on whether somebody asked.
  Impl::References references = m.references;
  m.keepReferences(m.side_input, references);
  outcome.start_ns = outcome.stamp_ns = m.stores[m.options.clock_body].newest().stamp_ns;
  // Without a budget: nothing is carried over from one question to the next, so a cut answer would stay one.
  m.runOn(m.side(0), m.side_input, m.usableMap(outcome.stamp_ns), false, outcome);
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
  m.side_input.pose_scale = ahead;
  for (std::size_t b = 0; b < m.bodies.size(); ++b) {
    m.side_input.topologies[b] = m.input.topologies[b];
    m.side_input.rigid[b] = m.input.rigid[b];
    m.side_input.radius_m[b] = m.input.radius_m[b];
    m.side_input.references[b] = m.input.references[b];
    m.side_input.t0[b] = m.input.t1[b];
    Positions& to = m.side_input.t1[b];
    to.resize(m.input.t1[b].size());
    if (m.input.rigid[b]) {
      // The last step once more, `ahead` times as far, which may be more than half a turn.
      m.side_input.pose_t0[b] = m.input.pose_t1[b];
      m.side_input.pose_t1[b] = interpolate(m.input.pose_t0[b], m.input.pose_t1[b], 2);
      const Eigen::Isometry3d moved =
          interpolate(m.side_input.pose_t0[b], m.side_input.pose_t1[b], ahead) * m.input.pose_t1[b].inverse();
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
  m.runOn(m.side(m.options.detector.step_budget_ms), m.side_input, m.usableMap(m.last_end_ns), false, outcome,
          &m.runner);
  return outcome;
}

}  // namespace dccd
