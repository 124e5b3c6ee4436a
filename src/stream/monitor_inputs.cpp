// What a step is made of: where every body is at both of its ends, reference frames, the map.
#include <algorithm>
#include <utility>

#include "stream/monitor_impl.h"
#include "stream/radii.h"

namespace dccd {
namespace {

std::shared_ptr<const std::vector<double>> radii(std::vector<double> radius_m) {
  return radius_m.empty() ? nullptr : share(std::move(radius_m));
}

}  // namespace

void placeBetween(const std::shared_ptr<const MeshFrame>& from, const std::shared_ptr<const MeshFrame>& to,
                  Body& body) {
  const auto positionsOf = [](const std::shared_ptr<const MeshFrame>& frame) {
    return std::shared_ptr<const Positions>(frame, &frame->positions);
  };
  body.topology = to->topology;
  body.t0 = positionsOf(from);
  body.t1 = positionsOf(to);
  body.turns = to->rigid && from != to;
  body.pose_t0 = from->pose;
  body.pose_t1 = to->pose;
  body.radius_m = radii(largerRadii(from->radius_m, to->radius_m));
  body.dropped_faces = std::max(from->dropped_faces, to->dropped_faces);
}

bool Monitor::Impl::waitsFor(std::size_t body, Pending& step, bool timed_out) {
  const MeshStore& store = stores[body];
  const auto name = [&] { return "body '" + bodies[body].name + "' "; };  // most of the time nobody asks
  if (!isStream(body)) {
    if (store.empty() && timed_out) drop(step, StepStatus::NO_BODY, name() + "has not been received yet");
    return store.empty() && !timed_out;
  }
  std::uint64_t run_t0 = 0;
  const Lookup at_t1 = store.lookup(step.to->stamp_ns, &runs[body]);
  if (at_t1 == Lookup::NOT_YET) {
    if (timed_out) {
      drop(step, StepStatus::NO_BODY,
           name() + (store.empty() ? "has not been received yet" : "has no frame at or after the end of the step"));
    }
    return !timed_out;
  }
  const Lookup at_t0 = store.lookup(step.from->stamp_ns, &run_t0);
  if (at_t1 == Lookup::READY && at_t0 == Lookup::READY && run_t0 == runs[body]) {
    dropAtSeam(body, step);
    return false;
  }
  if (at_t1 == Lookup::READY) told_runs[body] = runs[body];
  drop(step, store.runReason() == StepStatus::FIRST_FRAME ? StepStatus::NO_BODY : store.runReason(),
       name() + "has no unbroken frames around the step (" + toString(store.runReason()) + ")");
  return false;
}

/// A run that began by a jump back may reach over the whole of a step that follows one of the run before: both alone
/// are whole, and what happened between the two nobody saw.
void Monitor::Impl::dropAtSeam(std::size_t body, Pending& step) {
  const bool was_told = told_runs[body] == 0 || told_runs[body] == runs[body];
  told_runs[body] = runs[body];
  if (was_told) return;
  const StepStatus reason = stores[body].runReason();
  drop(step, reason, "body '" + bodies[body].name + "' began anew since the last step (" + toString(reason) + ")");
}

Step Monitor::Impl::place(const Pending& pending) {
  Step step;
  step.bodies = bodies;
  step.start_ns = pending.from->stamp_ns;
  step.stamp_ns = pending.to->stamp_ns;
  step.sequence = pending.sequence;
  if (tellsBeside()) {
    finishTelling();
  } else {
    takeMaps(step.stamp_ns);
  }
  step.map = usableMap(step.stamp_ns);
  thinned_out.clear();
  Shown shown(bodies.size() + 1);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Body& body = step.bodies[b];
    if (!isStream(b)) {
      placeBetween(stores[b].newestShared(), stores[b].newestShared(), body);
      continue;
    }
    lookForUnused(b, step.start_ns, step.stamp_ns, step);
    if (const std::uint64_t count = stores[b].thinnedWithin(step.start_ns, step.stamp_ns); count > 0) {
      thinned_out.push_back(std::to_string(count) + (count == 1 ? " frame" : " frames") + " of body '" + body.name +
                            "' by queue_policy: thin");
    }
    if (b == options.clock_body) {  // of a step that has waited the store may have forgotten them
      placeBetween(pending.from, pending.to, body);
      shown[b] = follow("body '" + body.name + "'", {{pending.from, pending.to, 0, 1}}, body, step);
    } else {
      placeBetween(frameAt(b, step.start_ns, step), frameAt(b, step.stamp_ns, step), body);
      lookBetween(b, step);
      auto stretches = stores[b].pathWithin(step.start_ns + 1, step.stamp_ns - 1);
      std::reverse(stretches.begin(), stretches.end());
      shown[b] = follow("body '" + body.name + "'", stretches, body, step);
    }
    stores[b].forgetBefore(wayNeededFrom(b, step.stamp_ns));
  }
  lookAtHeld(pending.from->carrier.epoch, shown, step);
  sayUnshown(shown, step);
  keepReferences(step, references);
  return step;
}

void Monitor::Impl::forgetReferences() {
  references.positions.assign(bodies.size(), nullptr);
  references.topologies.assign(bodies.size(), nullptr);
}

/// A minimum separation, and a body's distance from itself, tell neighbours by a reference frame: the first one with
/// this topology, or if no distance was asked for then (radii may come later), the first one for which it is.
void Monitor::Impl::keepReferences(Step& step, References& kept) const {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Body& body = step.bodies[b];
    std::shared_ptr<const Topology>& topology = kept.topologies[b];
    std::shared_ptr<const Positions>& at = kept.positions[b];
    if (!topology || (topology != body.topology && *topology != *body.topology)) {
      topology = body.topology;
      at = nullptr;
    }
    const bool needed = meetsItself(body) && (separates(body) || options.detector.clearance.self_m > 0);
    if (needed && !at) at = body.t0;
    body.reference = at;
  }
}

bool Monitor::Impl::separates(const Body& body) const {
  const auto named = [](const SeparationFrom& from) { return from.separation_m > 0; };
  return body.minimum_separation_m > 0 || body.radius_m ||
         std::any_of(body.separations.begin(), body.separations.end(), named);
}

}  // namespace dccd
