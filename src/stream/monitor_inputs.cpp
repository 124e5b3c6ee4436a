// What a step is computed from: where every body is at both of its ends, reference frames, the map.
#include <algorithm>
#include <sstream>
#include <utility>

#include "obstacle/excluded_leaves.h"
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
void Monitor::Impl::lookBetween(std::size_t body, StampNs from_ns, StampNs to_ns) {
  const std::size_t frames = stores[body].framesWithin(from_ns, to_ns);
  if (frames == 0) return;
  const double off_m = stores[body].offPath(from_ns, to_ns, input.t0[body], input.t1[body]);
  if (off_m <= options.rigid_tolerance_m) return;
  std::ostringstream text;
  text << "body '" << bodies[body].name << "' was seen up to " << off_m << " m off the path of this step, in " << frames
       << " frames between its ends; make it the clock_body";
  off_path = text.str();
}

void Monitor::Impl::place(const Pending& step) {
  off_path.clear();
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
      store.forgetBefore(step.to->stamp_ns);
      continue;
    }
    // Not the newest frame, which may have begun another run with another topology while the step waited.
    const MeshFrame& frame = isStream(b) ? store.frameAtOrAfter(step.to->stamp_ns) : store.newest();
    input.topologies[b] = frame.topology;
    input.rigid[b] = isStream(b) && frame.rigid;
    if (!isStream(b)) {
      input.t0[b] = input.t1[b] = frame.positions;
      input.radius_m[b] = frame.radius_m;
      continue;
    }
    store.positionsAt(step.from->stamp_ns, input.t0[b]);
    store.positionsAt(step.to->stamp_ns, input.t1[b]);
    if (input.rigid[b]) {
      input.pose_t0[b] = store.poseAt(step.from->stamp_ns);
      input.pose_t1[b] = store.poseAt(step.to->stamp_ns);
    }
    store.radiiOver(step.from->stamp_ns, step.to->stamp_ns, input.radius_m[b]);
    lookBetween(b, step.from->stamp_ns, step.to->stamp_ns);
    store.forgetBefore(step.to->stamp_ns);
  }
  keepReferences(input, references);
}

void Monitor::Impl::forgetReferences() {
  references.frames.assign(bodies.size(), nullptr);
  references.topologies.assign(bodies.size(), nullptr);
}

/// The first frame of each topology is what a minimum separation measures neighbours in: the first that asks for a
/// distance, for radii may come later. Radii that grow past those of the reference make a new list; twice as large, so
/// that it happens seldom.
void Monitor::Impl::keepReferences(StepInput& at, References& kept) const {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    std::shared_ptr<const Topology>& topology = kept.topologies[b];
    std::shared_ptr<const ReferenceFrame>& frame = kept.frames[b];
    if (!topology || (topology != at.topologies[b] && *topology != *at.topologies[b])) {
      topology = at.topologies[b];
      frame = nullptr;
    }
    const bool needed = bodies[b].self_collision && !bodies[b].rigid && separates(b, at.radius_m[b]);
    if (needed && !frame) frame = std::make_shared<const ReferenceFrame>(ReferenceFrame{at.t0[b], {}});
    const double now_m = largest(at.radius_m[b]), listed_m = frame ? largest(frame->radius_m) : now_m;
    if (now_m > listed_m) {
      std::vector<double> radius_m(at.t0[b].size(), std::max(now_m, 2 * listed_m));
      frame = std::make_shared<const ReferenceFrame>(ReferenceFrame{frame->positions, std::move(radius_m)});
    }
    at.references[b] = frame;
  }
}

bool Monitor::Impl::separates(std::size_t body, const std::vector<double>& radius_m) const {
  const auto named = [](const SeparationFrom& from) { return from.separation_m > 0; };
  return bodies[body].minimum_separation_m > 0 || !radius_m.empty() ||
         std::any_of(bodies[body].separations.begin(), bodies[body].separations.end(), named);
}

void Monitor::setReference(std::size_t body, std::shared_ptr<const Topology> topology,
                           std::shared_ptr<const ReferenceFrame> reference) {
  impl_->references.topologies.at(body) = std::move(topology);
  impl_->references.frames.at(body) = std::move(reference);
}

void Monitor::setMap(MonitorMap map) {
  impl_->map = std::move(map);
  impl_->reduced_from = nullptr;
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

}  // namespace dccd
