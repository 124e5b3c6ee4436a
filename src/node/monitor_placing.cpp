// Where bodies are: frames and rigid bodies wait for their transforms and are moved into the fixed frame, which may be
// learnt, and learnt anew.
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <limits>
#include <optional>
#include <set>
#include <sstream>
#include <utility>

#include "input/transform_tracks.h"
#include "node/liveness.h"
#include "node/monitor_pipeline.h"

namespace dccd {
Carrier MonitorPipeline::carrierOf(const std::string& frame, std::uint64_t epoch) const {
  return {frame == fixed_frame_ ? std::string() : frame, epoch};
}

bool MonitorPipeline::placeOne(Rigid& rigid, StampNs stamp_ns, std::uint64_t epoch, MeshFrame& frame,
                               std::string& reason) const {
  frame = rigid.mesh;
  frame.stamp_ns = stamp_ns;
  if (rigid.isNone()) return true;
  const StampNs held_ns = std::min(stamp_ns, rigid.let_go_ns);
  frame.carrier = carrierOf(rigid.frame, epoch);
  if (!transforms_.lookup(fixed_frame_, rigid.frame, held_ns, frame.pose, reason)) {
    // It stays where it was, and all of it is unknown there: unchecked.
    frame.pose = rigid.pose.value_or(Eigen::Isometry3d::Identity());
    frame.positions.assign(rigid.reference.size(), Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
    frame.doubt = noTransformAt(held_ns);
    reason = transforms_.noTransform(rigid.frame, "'" + fixed_frame_ + "'", reason) + "; body '" + rigid.name +
             "' is carried by it";
    return false;
  }
  frame.pose = frame.pose * rigid.frame_from_mesh;
  if (stamp_ns >= rigid.let_go_ns) {  // it stays where it was then
    rigid.doubt = tracks_.doubtAt(fixed_frame_, rigid.frame, held_ns);
    if (rigid.doubt.empty()) rigid.doubt = transforms_.doubtNextTo(fixed_frame_, rigid.frame, held_ns);
    rigid.frame_from_mesh = frame.pose;
    rigid.frame = fixed_frame_;
    rigid.let_go_ns = Rigid::NEVER;
    frame.carrier = carrierOf(rigid.frame, epoch);
  }
  frame.doubt = rigid.doubt;
  frame.positions = transformed(frame.pose, rigid.reference);
  return true;
}

/// lost: why it has no place; empty: it has.
void MonitorPipeline::pushRigid(std::size_t body, MeshFrame frame, const std::string& lost, std::int64_t now_ns) {
  Rigid& rigid = *rigid_[body];
  if (lost.empty()) {
    rigid.pose = frame.pose;
  } else if (!rigid.lost && body < problems_.size()) {
    problems_[body] = "not watched meanwhile: " + lost;
  }
  rigid.lost = !lost.empty();
  monitor_->countReceived(body);
  monitor_->push(body, std::move(frame), now_ns);
}

bool MonitorPipeline::placeOthers(std::uint64_t epoch, std::int64_t now_ns, bool overdue, StepStatus& problem,
                                  std::string& reason) {
  if (const std::size_t body = misplaced(); body < waiting_.size()) {
    problem = StepStatus::NO_BODY;
    reason = missing(body);
    return false;
  }
  const StampNs stamp_ns = waiting_[config_.monitor.clock_body]->mesh.stamp_ns;
  struct Placed {
    std::size_t body;
    MeshFrame frame;
    std::string lost;
  };
  std::vector<Placed> all;
  all.reserve(rigid_.size());
  for (std::size_t b = 0; b < rigid_.size(); ++b) {
    if (!rigid_[b]) continue;
    Placed& one = all.emplace_back(Placed{b, {}, {}});
    if (!placeOne(*rigid_[b], stamp_ns, epoch, one.frame, reason)) {
      if (!overdue || !rigid_[b]->may_be_lost) return false;
      one.lost = reason;
    }
  }
  for (Placed& one : all) pushRigid(one.body, std::move(one.frame), one.lost, now_ns);
  return true;
}

void MonitorPipeline::setBody(std::size_t body, const Body& what, Rigid rigid) {
  monitor_->setBody(body, what);
  effects_.setBody(body, what);
  rigid_.resize(std::max(rigid_.size(), body + 1));
  rigid_[body] = std::move(rigid);
  // So that the next one is answered with it.
  for (const StampNs stamp_ns : monitor_->stampsToCome()) {
    MeshFrame frame;
    std::string reason;
    const bool placed = placeOne(*rigid_[body], stamp_ns, tracks_.epoch(), frame, reason);
    pushRigid(body, std::move(frame), placed ? "" : reason, 0);
  }
}

void MonitorPipeline::keep(std::size_t body) {
  Waiting& waiting = *waiting_[body];
  waiting.kept = true;
  // Before the clock body's first message there may be no fixed frame, and nothing is wrong.
  if (fixed_frame_.empty() || waiting.told) return;
  waiting.told = true;
  problems_[body] = "waits: " + waiting.reason;
}

std::string MonitorPipeline::missing(std::size_t body) const {
  const std::string name = "body '" + config_.bodies[body].body.name + "'";
  if (!refused_[body].empty()) return "the newest frame of " + name + " was refused: " + refused_[body];
  return waiting_[body]->reason + "; " + name + " waits for it";
}

std::size_t MonitorPipeline::misplaced() const {
  std::size_t b = 0;
  while (b < waiting_.size() && !(waiting_[b] && placed_[b]) && refused_[b].empty()) ++b;
  return b;
}

/// Between two frames, h seconds apart, a vertex of at most the acceleration a goes within a h^2 / 8 of the straight
/// way: along any direction its way from the straight one is 0 at both ends, and its second derivative is a at the
/// most. Each frame carries this of the time before it, and a step takes the larger radius of the frames at its ends
/// and between them. The path of a step of which another body is the clock leaves the frames' straight ways by
/// rigid_tolerance_m at the most, or the step is PARTIAL.
void MonitorPipeline::widen(std::size_t body, MeshFrame& frame) {
  const double acceleration = config_.bodies[body].max_acceleration_m_s2;
  if (!(acceleration > 0)) return;
  widened_ns_.resize(config_.bodies.size());
  const StampNs before_ns = std::exchange(widened_ns_[body], frame.stamp_ns);
  const double h = secondsBetween(before_ns, frame.stamp_ns);
  const bool joined = before_ns != 0 && h > 0 && h <= config_.monitor.store.max_step_s;  // else a seam parts the two
  // Seven roundings, of half a unit in the last place each.
  double radius_m = joined ? acceleration * h * h / 8 * (1 + 8 * std::numeric_limits<double>::epsilon()) : 0;
  if (body != config_.monitor.clock_body) radius_m += config_.monitor.detector.rigid_tolerance_m;
  frame.radius_m.resize(frame.positions.size());
  for (double& radius : frame.radius_m) radius = std::nextafter(radius + radius_m, SpeedBound::NONE);
}

bool MonitorPipeline::placeFrame(std::size_t body, std::int64_t now_ns) {
  Waiting& waiting = *waiting_[body];
  const std::uint64_t epoch = tracks_.epoch();  // before tf is asked: what is forgotten since is told from it
  const bool overdue = finishing_ || secondsBetween(waiting.since_ns, now_ns) >= config_.transform_timeout_s;
  std::string reason = fixed_frame_.empty() ? "the fixed frame is not known before the clock body's first message" : "";
  StepStatus problem = StepStatus::NO_TRANSFORM;
  Eigen::Isometry3d fixed_from_mesh;
  const bool is_clock = body == config_.monitor.clock_body;
  const bool has_place = !fixed_frame_.empty() && transforms_.lookup(fixed_frame_, waiting.mesh.frame_id,
                                                                     waiting.mesh.stamp_ns, fixed_from_mesh, reason);
  if (is_clock && has_place) {
    if (mapMayCome(waiting.mesh.arrival_ns, now_ns)) return false;
    // In time for a step that says so, if it does not come.
    if (!overdue && !knowsHeld(waiting.mesh.stamp_ns)) return false;
  }
  const bool placed = has_place && (!is_clock || placeOthers(epoch, now_ns, overdue, problem, reason));
  if (!placed) {
    if (!has_place) reason = transforms_.noTransform(waiting.mesh.frame_id, "'" + fixed_frame_ + "'", reason);
    waiting.reason = reason;
    waiting.overdue = overdue;
    const bool timed_out =
        waiting.overdue || waiting.kept || (problem == StepStatus::NO_BODY && isHopeless(misplaced()));
    if (!timed_out) return false;
    if (isStatic(body)) {
      keep(body);
      return false;
    }
  }
  Waiting done = std::move(waiting);
  waiting_[body].reset();
  if (!placed) {
    if (is_clock && !has_place && !frame_answered_) learnAnew(StepStatus::NO_TRANSFORM);
    skip(body, problem, done.mesh.stamp_ns, done.mesh.arrival_ns, reason);
    return true;
  }
  done.mesh.pose = fixed_from_mesh;
  done.mesh.carrier = carrierOf(done.mesh.frame_id, epoch);
  if (isStatic(body)) {
    done.mesh.doubt = tracks_.doubtAt(fixed_frame_, done.mesh.frame_id, done.mesh.stamp_ns);
    // A fixed frame that was learnt may be a camera's that moves. In one that was named a static body may be of a frame
    // that was sent once: what is not sent is not elsewhere. A camera may move, and what it saw is where it was then.
    if (!config_.fixed_frame.empty()) done.mesh.carrier.silence = Silence::STANDS;
    const bool is_sensors = config_.bodies[body].input.source == TopologySource::DEPTH_IMAGE;
    done.mesh.carrier.takes_along = !is_sensors;
    if (is_sensors && !config_.fixed_frame.empty()) {
      done.mesh.carrier.frame.clear();
      seen_from_[body] = SeenFrom{done.mesh.frame_id, done.mesh.stamp_ns, epoch, {}};
    }
    if (config_.fixed_frame.empty()) static_meshes_[body] = done.mesh;
  }
  transform(fixed_from_mesh, done.mesh.positions);
  widen(body, done.mesh);
  monitor_->push(body, std::move(done.mesh), now_ns);
  placed_[body] = isStatic(body);
  return true;
}

bool MonitorPipeline::knowsHeld(StampNs stamp_ns) const {
  const std::set<std::string> frames = monitor_->heldFrames();
  return std::all_of(frames.begin(), frames.end(), [&](const std::string& frame) {
    Eigen::Isometry3d unused;
    std::string reason;
    return transforms_.lookup(fixed_frame_, frame, stamp_ns, unused, reason);
  });
}

void MonitorPipeline::learnAnew(StepStatus status) {
  if (!config_.fixed_frame.empty()) return;
  trusted_placed_ = false;
  fixed_frame_.clear();
  // The octree of clouds, and where something was let go, outlast it.
  if (!config_.takesClouds() && !hasLetGo()) learnt_frames_.forget();
  frame_answered_ = false;
  monitor_->reset(status);
  for (std::size_t b = 0; b < static_meshes_.size(); ++b) {
    if (!static_meshes_[b]) continue;
    monitor_->withdraw(b);
    placed_[b] = false;
    if (waiting_[b]) {  // a newer one
      monitor_->countDropped(b, status);
    } else {
      waiting_[b] = Waiting();
      waiting_[b]->kept = true;
      waiting_[b]->mesh = std::move(*static_meshes_[b]);
    }
    static_meshes_[b].reset();
  }
  if (!placed_map_) return;
  if (unplaced_maps_.empty()) unplaced_maps_.push_back({std::move(*placed_map_)});
  placed_map_.reset();
  for (UnplacedMap& one : unplaced_maps_) one.since_ns = 0;
  monitor_->setMap({});
}

}  // namespace dccd
