// What a step is made of: where every body is at both of its ends, reference frames, the map.
#include <algorithm>
#include <cmath>
#include <sstream>
#include <utility>

#include "stream/monitor_impl.h"

namespace dccd {
namespace {

std::vector<double> largerRadii(const std::vector<double>& a, const std::vector<double>& b) {
  if (a.empty() || b.empty()) return a.empty() ? b : a;
  std::vector<double> larger(a.size());
  for (std::size_t v = 0; v < a.size(); ++v) larger[v] = std::max(a[v], b[v]);
  return larger;
}

double largest(const std::vector<double>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

}  // namespace

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
    drop(step, StepStatus::NO_BODY,
         name + (store.empty() ? "has not been received yet" : "has no frame at or after the end of the step"));
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

/// A body that is seen more often than the clock body goes straight from where it is at the step's one end to the
/// other. What was seen of it in between must not be contradicted in silence.
void Monitor::Impl::lookBetween(std::size_t b, Step& step) const {
  const std::size_t frames = stores[b].framesWithin(step.start_ns, step.stamp_ns);
  if (frames == 0) return;
  const Body& body = step.bodies[b];
  const double off_m = stores[b].offPath(step.start_ns, step.stamp_ns, *body.t0, *body.t1);
  if (off_m <= options.detector.rigid_tolerance_m) return;
  std::ostringstream text;
  text << "body '" << body.name << "' was seen up to " << off_m << " m off the path of this step, in " << frames
       << " frames between its ends; make it the clock_body";
  step.off_path = text.str();
}

void Monitor::Impl::placeStream(std::size_t b, const Pending& pending, Body& out) {
  const StampNs from_ns = pending.from->stamp_ns, to_ns = pending.to->stamp_ns;
  Positions t0, t1;
  stores[b].positionsAt(from_ns, t0);
  stores[b].positionsAt(to_ns, t1);
  out.t0 = share(std::move(t0));
  out.t1 = share(std::move(t1));
  if (out.turns) {
    out.pose_t0 = stores[b].poseAt(from_ns);
    out.pose_t1 = stores[b].poseAt(to_ns);
  }
  std::vector<double> radius_m;
  stores[b].radiiOver(from_ns, to_ns, radius_m);
  out.radius_m = radii(std::move(radius_m));
}

Step Monitor::Impl::place(const Pending& pending) {
  Step step;
  step.bodies = bodies;
  step.start_ns = pending.from->stamp_ns;
  step.stamp_ns = pending.to->stamp_ns;
  step.sequence = pending.sequence;
  step.map = usableMap(step.stamp_ns);
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Body& body = step.bodies[b];
    if (b == options.clock_body) {
      body.topology = pending.to->topology;
      body.t0 = positionsOf(pending.from);
      body.t1 = positionsOf(pending.to);
      body.turns = pending.to->rigid;
      body.pose_t0 = pending.from->pose;
      body.pose_t1 = pending.to->pose;
      body.radius_m = radii(largerRadii(pending.from->radius_m, pending.to->radius_m));
      body.dropped_faces = std::max(pending.from->dropped_faces, pending.to->dropped_faces);
    } else if (isStream(b)) {
      // Not the newest frame, which may have begun another run with another topology while the step waited.
      const MeshFrame& frame = stores[b].frameAtOrAfter(step.stamp_ns);
      body.topology = frame.topology;
      body.turns = frame.rigid;
      body.dropped_faces = stores[b].droppedFacesOver(step.start_ns, step.stamp_ns);
      placeStream(b, pending, body);
      lookBetween(b, step);
    } else {
      hold(stores[b].newestShared(), body);
      continue;
    }
    stores[b].forgetBefore(step.stamp_ns);
  }
  keepReferences(step, references);
  return step;
}

void Monitor::Impl::forgetReferences() {
  references.frames.assign(bodies.size(), nullptr);
  references.topologies.assign(bodies.size(), nullptr);
}

/// A minimum separation tells neighbours by a reference frame: the first one with this topology, or if no distance was
/// asked for then (radii may come later), the first one for which it is. Radii that grow past those of the reference
/// make a new list of left-out pairs; it is made for twice as large ones, so that this happens seldom.
void Monitor::Impl::keepReferences(Step& step, References& kept) const {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Body& body = step.bodies[b];
    std::shared_ptr<const Topology>& topology = kept.topologies[b];
    std::shared_ptr<const ReferenceFrame>& frame = kept.frames[b];
    if (!topology || (topology != body.topology && *topology != *body.topology)) {
      topology = body.topology;
      frame = nullptr;
    }
    const bool needed = meetsItself(body) && separates(body);
    if (needed && !frame) frame = share(ReferenceFrame{*body.t0, {}});
    const double now_m = body.radius_m ? largest(*body.radius_m) : 0;
    const double listed_m = frame ? largest(frame->radius_m) : now_m;
    if (now_m > listed_m) {
      std::vector<double> radius_m(body.t0->size(), std::max(now_m, 2 * listed_m));
      frame = share(ReferenceFrame{frame->positions, std::move(radius_m)});
    }
    body.reference = frame;
  }
}

bool Monitor::Impl::separates(const Body& body) const {
  const auto named = [](const SeparationFrom& from) { return from.separation_m > 0; };
  return body.minimum_separation_m > 0 || body.radius_m ||
         std::any_of(body.separations.begin(), body.separations.end(), named);
}

void Monitor::setMap(ObstacleMap map) { impl_->map = std::move(map); }

ObstacleMap Monitor::Impl::usableMap(StampNs stamp_ns) const {
  ObstacleMap used = map;
  if (!options.detector.obstacle_expected) return used;
  if (!used.surface) {
    if (used.problem.empty()) used.problem = "no octomap has been received yet";
    return used;
  }
  if (!(options.octomap_timeout_s > 0) || used.stamp_ns <= 0) return used;
  // Also one from the future: by its stamp it would be fresh for ever, and its clock is not that of the meshes.
  const double age_s = secondsBetween(used.stamp_ns, stamp_ns);
  if (std::abs(age_s) <= options.octomap_timeout_s) return used;
  used.surface = nullptr;
  std::ostringstream problem;
  if (age_s > 0) {
    problem << "the octomap is older than octomap_timeout_s";
  } else {
    problem << "the octomap is stamped " << -age_s << " s after the end of the step, more than octomap_timeout_s";
  }
  used.problem = problem.str();
  return used;
}

}  // namespace dccd
