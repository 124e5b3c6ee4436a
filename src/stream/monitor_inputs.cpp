// What a step is made of: where every body is at both of its ends, reference frames, the map.
#include <algorithm>
#include <sstream>
#include <utility>

#include "stream/monitor_impl.h"
#include "stream/radii.h"

namespace dccd {
namespace {

constexpr double STILL = 1e-12;  // of a pose's numbers: what interpolating between two equal ones may round

const char* const FORGOTTEN = "stamps of tf went back, or a static transform is another one";

std::shared_ptr<const std::vector<double>> radii(std::vector<double> radius_m) {
  return radius_m.empty() ? nullptr : share(std::move(radius_m));
}

double largest(const std::vector<double>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

/// How far the frame is from the path that the body takes, at this time of the step: straight or, of one that turns,
/// along the shorter arc [m].
double offPath(const MeshFrame& frame, const Body& body, double u) {
  const Eigen::Isometry3d moved = interpolate(body.pose_t0, body.pose_t1, u) * body.pose_t0.inverse();
  double off = 0;
  for (std::size_t v = 0; v < frame.positions.size(); ++v) {
    const Vec3 &t0 = (*body.t0)[v], &t1 = (*body.t1)[v];
    const Vec3 on_path = body.turns ? Vec3(moved * t0) : Vec3(t0 + u * (t1 - t0));
    off = std::max(off, (frame.positions[v] - on_path).norm());  // a vertex that is not finite is not compared
  }
  return off;
}

double fractionOf(const Step& step, StampNs stamp_ns) {
  return static_cast<double>(stamp_ns - step.start_ns) / static_cast<double>(step.stamp_ns - step.start_ns);
}

/// How far the two poses bring points within the bounds from each other: the most that they do its corners [m].
double apart(const Eigen::Isometry3d& seen, const Eigen::Isometry3d& expected, const Eigen::AlignedBox3d& bounds) {
  double off = 0;
  if (bounds.isEmpty()) return off;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p = bounds.corner(static_cast<Eigen::AlignedBox3d::CornerType>(corner));
    off = std::max(off, (seen * p - expected * p).norm());
  }
  return off;
}

Eigen::AlignedBox3d boundsOf(const Body& body) {
  Eigen::AlignedBox3d bounds;
  for (const Positions* positions : {body.t0.get(), body.t1.get()}) {
    for (const Vec3& p : *positions) {
      if (p.allFinite()) bounds.extend(p);
    }
  }
  return bounds;
}

Eigen::AlignedBox3d boundsOfThoseThatMeetTheMap(const Step& step) {
  Eigen::AlignedBox3d bounds;
  for (const Body& body : step.bodies) {
    if (meetsMap(body)) bounds.extend(boundsOf(body));
  }
  return bounds;
}

/// How far a rigid body leaves the path of the step on that of what carries it, of which the knots begin where the body
/// is in this frame [m].
double offArc(const std::vector<Knot>& knots, const MeshFrame& from, const Body& body, const Step& step) {
  const Eigen::Isometry3d carrier_from_t0 = knots.front().pose.inverse() * from.pose * body.pose_t0.inverse();
  const Eigen::AlignedBox3d bounds = boundsOf(body);
  double off = 0;
  for (const Knot& knot : knots) {
    if (knot.stamp_ns < step.start_ns || knot.stamp_ns > step.stamp_ns) continue;
    const Eigen::Isometry3d on_path = interpolate(body.pose_t0, body.pose_t1, fractionOf(step, knot.stamp_ns));
    off = std::max(off, apart(knot.pose * carrier_from_t0, on_path * body.pose_t0.inverse(), bounds));
  }
  return off;
}

/// How far vertices leave the straight way between two frames on that of what carries them, of which the knots are
/// [m].
double offChord(const std::vector<Knot>& knots, const MeshFrame& from, const MeshFrame& to) {
  const Eigen::Isometry3d &from_pose = knots.front().pose, &to_pose = knots.back().pose;
  const Eigen::Isometry3d from_back = from_pose.inverse(), to_back = to_pose.inverse();
  double off = 0;
  for (const Knot& knot : knots) {
    // A frame that stands still, as a camera's on its mount, costs no look at the vertices.
    if (knot.pose.isApprox(to_pose, STILL) && from_pose.isApprox(to_pose, STILL)) continue;
    const double u =
        static_cast<double>(knot.stamp_ns - from.stamp_ns) / static_cast<double>(to.stamp_ns - from.stamp_ns);
    for (std::size_t v = 0; v < to.positions.size(); ++v) {
      const Vec3 &t0 = from.positions[v], &t1 = to.positions[v];
      const Vec3 carried = knot.pose * ((1 - u) * (from_back * t0) + u * (to_back * t1));
      off = std::max(off, (carried - ((1 - u) * t0 + u * t1)).norm());
    }
  }
  return off;
}

std::string unknown(const std::string& name, const std::string& why) {
  return "where " + name + " was is not known for all of this step" + (why.empty() ? "" : " (" + why + ")");
}

/// Has the frame lost a vertex that is to be looked at?
bool hasLost(const MeshFrame& frame, const Body& body) {
  const std::vector<Index>& used = frame.topology->usedVertices();
  return std::any_of(used.begin(), used.end(), [&](Index v) {
    return !frame.positions[v].allFinite() &&
           std::find(body.vertex_mask.begin(), body.vertex_mask.end(), v) == body.vertex_mask.end();
  });
}

void addSentence(std::string& text, const std::string& sentence) { text += (text.empty() ? "" : "; ") + sentence; }

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

/// A body that is seen more often than the clock body goes straight from where it is at the step's one end to the
/// other. What was seen of it in between must not be contradicted in silence: where it was, how uncertain, and what was
/// missing of it.
void Monitor::Impl::lookBetween(std::size_t b, Step& step) const {
  Body& body = step.bodies[b];
  const auto frames = stores[b].framesWithin(step.start_ns, step.stamp_ns);
  double off_m = 0;
  bool lost = false;
  for (const std::shared_ptr<const MeshFrame>& frame : frames) {
    lost = lost || hasLost(*frame, body);
    off_m = std::max(off_m, offPath(*frame, body, fractionOf(step, frame->stamp_ns)));
    if (!frame->radius_m.empty()) {
      body.radius_m = radii(largerRadii(body.radius_m ? *body.radius_m : std::vector<double>(), frame->radius_m));
    }
    body.dropped_faces = std::max(body.dropped_faces, frame->dropped_faces);
  }
  if (lost) {
    addSentence(step.off_path, unknown("body '" + body.name + "'", "a frame between its ends has lost vertices"));
  }
  if (off_m > options.detector.rigid_tolerance_m) {
    std::ostringstream text;
    text << "body '" << body.name << "' was seen up to " << off_m << " m off the path of this step, in "
         << frames.size() << " frames between its ends; make it the clock_body";
    addSentence(step.off_path, text.str());
  }
  for (const MeshStore::Stretch& stretch : stores[b].pathWithin(step.start_ns + 1, step.stamp_ns - 1)) {
    lookAtCarrier(b, *stretch.from, *stretch.to, step);
  }
}

/// Between two frames of a mesh its vertices go straight in the frame that carries it, and that one as tf has it. A
/// step takes them straight in the fixed frame; a rigid body along its arc from the step's one end to the other.
void Monitor::Impl::lookAtCarrier(std::size_t b, const MeshFrame& from, const MeshFrame& to, Step& step) const {
  const Body& body = step.bodies[b];
  const auto say = [&](const std::string& why) {
    addSentence(step.off_path, unknown("body '" + body.name + "'", why));
  };
  if (!tracks || (from.carrier.frame.empty() && to.carrier.frame.empty())) return;
  if (from.carrier.frame != to.carrier.frame) return say("the frame that carries it is another one than before");
  if (from.carrier.epoch != tracks->epoch() || to.carrier.epoch != tracks->epoch()) return say(FORGOTTEN);
  const std::vector<Knot> knots = tracks->between({}, to.carrier.frame, from.stamp_ns, to.stamp_ns, to.carrier.silence);
  const auto why = std::find_if(knots.begin(), knots.end(), [](const Knot& knot) { return !knot.why_unknown.empty(); });
  if (why != knots.end()) return say(why->why_unknown);
  if (knots.empty() || from.stamp_ns == to.stamp_ns) return;
  const double off_m = to.rigid ? offArc(knots, from, body, step) : offChord(knots, from, to);
  if (off_m <= options.detector.rigid_tolerance_m) return;
  std::ostringstream text;
  if (!to.rigid) {
    text << "between two of its frames tf has its frame '" << to.carrier.frame << "' up to " << off_m
         << " m off the straight way; send its mesh more often, or in the fixed frame";
    return say(text.str());
  }
  text << "body '" << body.name << "' was seen up to " << off_m << " m off the path of this step, in poses of tf "
       << "between its ends; send the mesh of '" << bodies[options.clock_body].name << "' more often";
  addSentence(step.off_path, text.str());
}

/// What came and was not used may have had the body anywhere.
void Monitor::Impl::lookForUnused(std::size_t body, StampNs from_ns, StampNs to_ns, Step& step) const {
  const std::string why = stores[body].unknownWithin(from_ns, to_ns);
  if (!why.empty()) addSentence(step.off_path, unknown("body '" + bodies[body].name + "'", why));
}

/// What tf says since they were placed must not be contradicted in silence.
void Monitor::Impl::lookAtHeld(std::uint64_t epoch, Step& step) const {
  for (std::size_t b = 0; b <= bodies.size(); ++b) {
    const bool is_map = b == bodies.size();
    if (is_map ? !step.map.surface : isStream(b) || stores[b].empty()) continue;
    const MeshFrame* const frame = is_map ? nullptr : &stores[b].newest();
    const std::string& carrier = is_map ? step.map.frame_id : frame->carrier.frame;
    const std::string name =
        is_map ? "the octomap's frame '" + carrier + "'" : "the frame of the static body '" + bodies[b].name + "'";
    const auto say = [&](const std::string& why) { addSentence(step.off_path, unknown(name, why)); };
    if (frame && !frame->doubt.empty()) say(frame->doubt);
    if (!tracks || carrier.empty()) continue;
    const std::vector<Knot> knots =
        is_map ? tracks->between(carrier, {}, step.start_ns, step.stamp_ns, Silence::UNKNOWN)
               : tracks->between({}, carrier, step.start_ns, step.stamp_ns, frame->carrier.silence);
    if (!knots.empty() && epoch != tracks->epoch()) {
      say(FORGOTTEN);
      continue;
    }
    const Eigen::Isometry3d held = is_map ? step.map.map_from_fixed : frame->pose;
    double off_m = 0;
    Eigen::AlignedBox3d bounds;
    for (const Knot& knot : knots) {
      if (!knot.why_unknown.empty()) {
        say(knot.why_unknown);
        break;
      }
      if (knot.pose.matrix() == held.matrix()) continue;
      if (bounds.isEmpty()) bounds = is_map ? boundsOfThoseThatMeetTheMap(step) : boundsOf(step.bodies[b]);
      off_m = std::max(off_m, is_map ? apart(knot.pose, held, bounds)
                                     : apart(knot.pose * held.inverse(), Eigen::Isometry3d::Identity(), bounds));
    }
    if (off_m <= options.detector.rigid_tolerance_m) continue;
    std::ostringstream text;
    text << name << " was seen up to " << off_m << " m from where it was at its stamp; "
         << (is_map ? "set fixed_frame to it" : "send it again, or set fixed_frame to what is at rest");
    addSentence(step.off_path, text.str());
  }
}

Step Monitor::Impl::place(const Pending& pending) {
  Step step;
  step.bodies = bodies;
  step.start_ns = pending.from->stamp_ns;
  step.stamp_ns = pending.to->stamp_ns;
  step.sequence = pending.sequence;
  takeMaps(step.stamp_ns);
  step.map = usableMap(step.stamp_ns);
  thinned_out.clear();
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
      lookAtCarrier(b, *pending.from, *pending.to, step);
    } else {
      placeBetween(stores[b].frameAt(step.start_ns), stores[b].frameAt(step.stamp_ns), body);
      lookBetween(b, step);
    }
    stores[b].forgetBefore(wayNeededFrom(b, step.stamp_ns));
  }
  lookAtHeld(pending.from->carrier.epoch, step);
  keepReferences(step, references);
  return step;
}

void Monitor::Impl::forgetReferences() {
  references.frames.assign(bodies.size(), nullptr);
  references.topologies.assign(bodies.size(), nullptr);
}

/// A minimum separation, and a body's distance from itself, tell neighbours by a reference frame: the first one with
/// this topology, or if no distance was asked for then (radii may come later), the first one for which it is. Radii
/// that grow past those of the reference make a new list of left-out pairs; it is made for twice as large ones, so that
/// this happens seldom.
void Monitor::Impl::keepReferences(Step& step, References& kept) const {
  for (std::size_t b = 0; b < bodies.size(); ++b) {
    Body& body = step.bodies[b];
    std::shared_ptr<const Topology>& topology = kept.topologies[b];
    std::shared_ptr<const ReferenceFrame>& frame = kept.frames[b];
    if (!topology || (topology != body.topology && *topology != *body.topology)) {
      topology = body.topology;
      frame = nullptr;
    }
    const bool needed = meetsItself(body) && (separates(body) || options.detector.clearance.self_m > 0);
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

}  // namespace dccd
