// Where bodies are: frames and rigid bodies wait for their transforms and are moved into the fixed frame, which may be
// learnt, and learnt anew.
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <iterator>
#include <limits>
#include <optional>
#include <sstream>
#include <utility>

#include "input/short_text.h"
#include "input/transforms.h"
#include "node/monitor_pipeline.h"

namespace dccd {

namespace {

SeenPose unknownAt(StampNs stamp_ns, std::string why) {
  SeenPose seen{stamp_ns, Eigen::Isometry3d::Identity(), std::move(why)};
  seen.pose.translation().setConstant(std::numeric_limits<double>::quiet_NaN());
  return seen;
}

std::string secondsOf(StampNs stamp_ns) {
  std::ostringstream text;
  text << stamp_ns / 1'000'000'000 << '.' << std::setw(9) << std::setfill('0') << stamp_ns % 1'000'000'000 << " s";
  return text.str();
}

constexpr double STILL = 1e-12;  // of a pose's numbers: what interpolating between two equal ones may round

const char* const FORGOTTEN = "stamps of tf went back, or a static transform is another one";

std::string noTransformAt(StampNs stamp_ns) { return "no transform of its frame at " + secondsOf(stamp_ns); }

/// How tf has it before the change is as good as unknown: what carried the frame until then may have gone anywhere
/// after it was last sent.
SeenPose unknownBefore(const TransformFeed::NewParent& change) {
  const std::string name = "'" + shortText(*change.frame, MAX_NAME) + "'";
  if (!change.now) {
    return unknownAt(change.stamp_ns - 1, "a transform of frame " + name +
                                              " came that cannot be used, or that has it elsewhere at a stamp that it "
                                              "had already");
  }
  if (!change.before) {
    return unknownAt(change.stamp_ns - 1,
                     "tf keeps nothing of frame " + name + " before " + secondsOf(change.stamp_ns));
  }
  return unknownAt(change.stamp_ns - 1, "frame " + name + " changed its parent from '" +
                                            shortText(*change.before, MAX_NAME) + "' to '" +
                                            shortText(*change.now, MAX_NAME) + "' at " + secondsOf(change.stamp_ns));
}

}  // namespace

bool MonitorPipeline::placeOne(const Rigid& rigid, const ClockFrame* since, StampNs stamp_ns, MeshFrame& frame,
                               std::string& reason) const {
  frame = rigid.mesh;
  frame.stamp_ns = stamp_ns;
  if (rigid.isNone()) return true;
  if (!transforms_.lookup(fixed_frame_, rigid.frame, stamp_ns, frame.pose, reason)) {
    // It stays where it was, and all of it is unknown there: unchecked.
    frame.pose = rigid.pose.value_or(Eigen::Isometry3d::Identity());
    frame.positions.assign(rigid.reference.size(), Vec3::Constant(std::numeric_limits<double>::quiet_NaN()));
    frame.seen.assign(1, unknownAt(stamp_ns - 1, noTransformAt(stamp_ns)));
    reason = transforms_.noTransform(rigid.frame, "'" + fixed_frame_ + "'", reason) + "; body '" + rigid.name +
             "' is carried by it";
    return false;
  }
  frame.pose = frame.pose * rigid.frame_from_mesh;
  frame.positions = transformed(frame.pose, rigid.reference);
  if (since) frame.seen = posesBetween(fixed_frame_, rigid.frame, *since, stamp_ns);
  for (SeenPose& seen : frame.seen) seen.pose = seen.pose * rigid.frame_from_mesh;
  return true;
}

/// lost: why it has no place; empty: it has.
void MonitorPipeline::pushRigid(std::size_t body, MeshFrame frame, const std::string& lost, std::int64_t now_ns) {
  Rigid& rigid = *rigid_[body];
  if (lost.empty()) {
    // It was lost at the start of the step that ends here.
    if (rigid.lost) frame.seen.push_back(unknownAt(frame.stamp_ns - 1, "no transform of its frame where it begins"));
    rigid.pose = frame.pose;
  } else if (!rigid.lost && body < problems_.size()) {
    problems_[body] = "not watched meanwhile: " + lost;
  }
  rigid.lost = !lost.empty();
  monitor_->countReceived(body);
  monitor_->push(body, std::move(frame), now_ns);
}

bool MonitorPipeline::placeOthers(std::int64_t now_ns, bool overdue, StepStatus& problem, std::string& reason) {
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
    if (!placeOne(*rigid_[b], clock_frames_.empty() ? nullptr : &clock_frames_.back(), stamp_ns, one.frame, reason)) {
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
  // Where steps to come begin, so that the next one is answered with it.
  const StampNs start_ns = monitor_->nextStart();
  const ClockFrame* before = nullptr;
  for (const ClockFrame& at : clock_frames_) {
    if (start_ns == 0 || at.stamp_ns < start_ns) continue;
    MeshFrame frame;
    std::string reason;
    const bool placed = placeOne(*rigid_[body], before, at.stamp_ns, frame, reason);
    pushRigid(body, std::move(frame), placed ? "" : reason, 0);
    before = &at;
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

void MonitorPipeline::nameMissing(Outcome& outcome) const {
  if (outcome.status != StepStatus::NO_BODY) return;
  for (std::size_t b = 0; b < waiting_.size(); ++b) {
    if (refused_[b].empty() && !(waiting_[b] && waiting_[b]->kept)) continue;
    outcome.reason = missing(b);
    return;
  }
}

void MonitorPipeline::nameNewerMap(std::int64_t came_ns, Outcome& outcome) const {
  if (!outcome.answered || !outcome.step->map.surface) return;
  for (const UnplacedMap& one : unplaced_maps_) {
    if (one.map.arrival_ns > came_ns) continue;
    outcome.unproved.push_back("an octomap that came before this frame has no place: no transform of its frame '" +
                               one.map.frame_id + "' at " + secondsOf(one.map.stamp_ns) +
                               "; raise transform_timeout_s to what tf lags behind");
    return;
  }
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
  const std::uint64_t times_forgotten = transforms_.timesForgotten();
  const bool overdue = finishing_ || secondsBetween(waiting.mesh.arrival_ns, now_ns) >= config_.transform_timeout_s;
  std::string reason = fixed_frame_.empty() ? "the fixed frame is not known before the clock body's first message" : "";
  StepStatus problem = StepStatus::NO_TRANSFORM;
  Eigen::Isometry3d fixed_from_mesh;
  const bool is_clock = body == config_.monitor.clock_body;
  const bool has_place = !fixed_frame_.empty() && transforms_.lookup(fixed_frame_, waiting.mesh.frame_id,
                                                                     waiting.mesh.stamp_ns, fixed_from_mesh, reason);
  SeenPoses held;
  if (is_clock && has_place) {
    if (mapMayCome(waiting.mesh.arrival_ns, now_ns)) return false;
    // In time for a step that says so, if it does not come.
    if (!findHeld(waiting.mesh.stamp_ns, held) && !overdue) return false;
  }
  const bool placed = has_place && (!is_clock || placeOthers(now_ns, overdue, problem, reason));
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
  done.mesh.doubt = doubtOf(body, done.mesh, times_forgotten);
  const std::string off_way = offWay(body, done.mesh, fixed_from_mesh, times_forgotten);
  if (done.mesh.doubt.empty()) done.mesh.doubt = off_way;
  if (isStatic(body)) {
    done.mesh.pose = fixed_from_mesh;
    // A camera may move, and what it saw is where it was then.
    const bool is_sensors = config_.bodies[body].input.source == TopologySource::DEPTH_IMAGE;
    static_frames_[body] = is_sensors && !config_.fixed_frame.empty() ? "" : done.mesh.frame_id;
    if (config_.fixed_frame.empty()) {
      static_meshes_[body] = done.mesh;
      monitor_->seen(body, lookBack(fixed_frame_, done.mesh.frame_id));
    }
  }
  transform(fixed_from_mesh, done.mesh.positions);
  if (is_clock) {
    keepClockFrame({done.mesh.stamp_ns, times_forgotten});
    for (const auto& [number, poses] : held.bodies) monitor_->seen(number, poses);
    for (const auto& [frame, poses] : held.maps) monitor_->mapSeen(frame, poses);
  }
  widen(body, done.mesh);
  monitor_->push(body, std::move(done.mesh), now_ns);
  placed_[body] = isStatic(body);
  return true;
}

bool MonitorPipeline::findHeld(StampNs stamp_ns, SeenPoses& held) const {
  bool all_known = true;
  const auto find = [&](const std::string& target, const std::string& source) {
    std::vector<SeenPose> seen;
    if (!clock_frames_.empty()) seen = posesFrom(target, source, clock_frames_.back(), stamp_ns);
    std::string unused;
    SeenPose last{stamp_ns, {}};
    const bool known = transforms_.lookup(target, source, stamp_ns, last.pose, unused);
    seen.push_back(known ? last : unknownAt(stamp_ns, noTransformAt(stamp_ns)));
    all_known = all_known && known;
    return seen;
  };
  for (const std::string& frame : monitor_->mapFrames()) {
    if (frame != fixed_frame_) held.maps[frame] = find(frame, fixed_frame_);
  }
  // A fixed frame that was learnt may be a camera's that moves. In one that was named a static body may be of a frame
  // that was sent once: what is not sent is not elsewhere.
  for (std::size_t b = 0; b < placed_.size(); ++b) {
    const std::string& frame = static_frames_[b];
    if (!placed_[b] || frame.empty() || frame == fixed_frame_) continue;
    held.bodies[b] = config_.fixed_frame.empty() ? find(fixed_frame_, frame) : findStatic(frame, stamp_ns);
  }
  return all_known;
}

/// As far as tf says where it is.
std::vector<SeenPose> MonitorPipeline::findStatic(const std::string& frame, StampNs stamp_ns) const {
  std::vector<SeenPose> seen;
  if (!clock_frames_.empty()) seen = posesBetween(fixed_frame_, frame, clock_frames_.back(), stamp_ns);
  std::string unused;
  SeenPose last{stamp_ns, {}};
  const bool known = transforms_.lookup(fixed_frame_, frame, stamp_ns, last.pose, unused) ||
                     transforms_.lookup(fixed_frame_, frame, 0, last.pose, unused);  // the newest
  if (known) seen.push_back(last);
  return seen;
}

std::string MonitorPipeline::doubtOf(std::size_t body, const DecodedMesh& mesh, std::uint64_t times_forgotten) {
  const std::uint64_t before = std::exchange(forgotten_[body], times_forgotten).value_or(times_forgotten);
  if (mesh.frame_id == fixed_frame_) return {};
  // Where the frame before was, tf may say otherwise by now.
  if (!isStatic(body) && before != times_forgotten) return FORGOTTEN;
  return doubtAt(fixed_frame_, mesh.frame_id, mesh.stamp_ns);
}

/// Between two frames of a mesh its vertices go straight in the frame that carries it, and that one as tf has it. A
/// step takes them straight in the fixed frame.
std::string MonitorPipeline::offWay(std::size_t body, const DecodedMesh& mesh, const Eigen::Isometry3d& fixed_from_mesh,
                                    std::uint64_t times_forgotten) {
  if (isStatic(body)) return {};
  const bool is_fixed = mesh.frame_id == fixed_frame_;
  const std::optional<Carried> last = std::exchange(
      carried_[body],
      Carried{
          mesh.frame_id, {mesh.stamp_ns, times_forgotten}, fixed_from_mesh, is_fixed ? Positions() : mesh.positions});
  if (!last) return {};
  if (last->frame_id != mesh.frame_id) {
    if (!mayBeAStep(last->at.stamp_ns, mesh.stamp_ns)) return {};
    return "its frame_id was '" + shortText(last->frame_id, MAX_NAME) + "' in the frame before, is '" +
           shortText(mesh.frame_id, MAX_NAME) + "' now, and nobody says how it went from the one to the other";
  }
  // With another number of vertices there is no step.
  if (is_fixed || last->positions.size() != mesh.positions.size()) return {};
  const std::vector<SeenPose> seen = posesBetween(fixed_frame_, mesh.frame_id, last->at, mesh.stamp_ns);
  double off_m = 0;
  for (const SeenPose& one : seen) {
    if (!one.pose.matrix().allFinite()) return one.why_unknown;
    // A frame that stands still, as a camera's on its mount, costs no look at the vertices.
    if (one.pose.isApprox(fixed_from_mesh, STILL) && last->pose.isApprox(fixed_from_mesh, STILL)) continue;
    const double u =
        static_cast<double>(one.stamp_ns - last->at.stamp_ns) / static_cast<double>(mesh.stamp_ns - last->at.stamp_ns);
    for (std::size_t v = 0; v < mesh.positions.size(); ++v) {
      const Vec3 &from = last->positions[v], &to = mesh.positions[v];
      const Vec3 straight = (1 - u) * (last->pose * from) + u * (fixed_from_mesh * to);
      off_m = std::max(off_m, (one.pose * ((1 - u) * from + u * to) - straight).norm());
    }
  }
  if (off_m <= config_.monitor.detector.rigid_tolerance_m) return {};
  std::ostringstream text;
  text << "between two of its frames tf has its frame '" << shortText(mesh.frame_id, MAX_NAME) << "' up to " << off_m
       << " m off the straight way; send its mesh more often, or in the fixed frame";
  return text.str();
}

/// Next to the stamp something of the way is missing.
std::string MonitorPipeline::doubtAt(const std::string& target, const std::string& source, StampNs stamp_ns) const {
  if (target == source) return {};
  std::vector<TransformFeed::NewParent> changes;
  transforms_.stampsBetween(target, source, stamp_ns - 1, stamp_ns + 1, changes);
  for (const TransformFeed::NewParent& change : changes) {
    if (!change.now) return unknownBefore(change).why_unknown;
  }
  return {};
}

/// Steps that wait for other bodies will be answered with what is held only now, and the next one begins where the
/// last of them ends.
std::vector<SeenPose> MonitorPipeline::lookBack(const std::string& target, const std::string& source) const {
  std::vector<SeenPose> seen;
  if (target == source) return seen;
  const StampNs start_ns = monitor_->nextStart();
  for (auto frame = clock_frames_.begin(); frame != clock_frames_.end(); ++frame) {
    const auto next = std::next(frame);
    if (next == clock_frames_.end()) {
      SeenPose last{frame->stamp_ns, {}};
      std::string unused;  // the next frame asks again
      if (transforms_.lookup(target, source, frame->stamp_ns, last.pose, unused)) seen.push_back(last);
    } else if (start_ns != 0 && frame->stamp_ns >= start_ns) {
      const std::vector<SeenPose> step = posesFrom(target, source, *frame, next->stamp_ns);
      seen.insert(seen.end(), step.begin(), step.end());
    }
  }
  return seen;
}

void MonitorPipeline::keepClockFrame(const ClockFrame& frame) {
  if (frame.stamp_ns == clockNs()) return;  // a duplicate, at which no step ends
  if (frame.stamp_ns < clockNs()) clock_frames_.clear();
  clock_frames_.push_back(frame);
  const StampNs start_ns = monitor_->nextStart();
  while (clock_frames_.size() > 1 && (start_ns == 0 || clock_frames_.front().stamp_ns < start_ns)) {
    clock_frames_.pop_front();
  }
}

/// As posesBetween(), and where it was at the first of the two, which may lie between two stamps of tf.
std::vector<SeenPose> MonitorPipeline::posesFrom(const std::string& target, const std::string& source,
                                                 const ClockFrame& from, StampNs to_ns) const {
  std::vector<SeenPose> seen = posesBetween(target, source, from, to_ns);
  if (!mayBeAStep(from.stamp_ns, to_ns)) return seen;
  std::string unused;
  SeenPose first{from.stamp_ns, {}};
  const bool known = transforms_.lookup(target, source, from.stamp_ns, first.pose, unused);
  // Of the step that ends there it may be known.
  seen.push_back(known ? first : unknownAt(from.stamp_ns + 1, noTransformAt(from.stamp_ns)));
  return seen;
}

bool MonitorPipeline::mayBeAStep(StampNs from_ns, StampNs to_ns) const {
  return from_ns < to_ns && secondsBetween(from_ns, to_ns) <= config_.monitor.store.max_step_s + 1e-6;
}

/// Target_from_source at each stamp of tf between the two, as far back as a step may reach, and in the middle between
/// such stamps: joint by joint a chain goes otherwise than from one pose to the other.
std::vector<SeenPose> MonitorPipeline::posesBetween(const std::string& target, const std::string& source,
                                                    const ClockFrame& from, StampNs to_ns) const {
  std::vector<SeenPose> seen;
  if (!mayBeAStep(from.stamp_ns, to_ns)) return seen;
  // What tf saw before that, nobody knows any more.
  if (transforms_.timesForgotten() != from.times_forgotten) {
    return {unknownAt(to_ns - 1, FORGOTTEN)};
  }
  std::vector<TransformFeed::NewParent> changes;
  std::vector<StampNs> stamps = transforms_.stampsBetween(target, source, from.stamp_ns, to_ns, changes);
  if (stamps.size() > tolerance::MOST_POSES_A_STEP) {
    return {unknownAt(stamps.back(), "more than " + std::to_string(tolerance::MOST_POSES_A_STEP) + " transforms")};
  }
  StampNs before_ns = from.stamp_ns;
  stamps.push_back(to_ns);
  std::string unused;
  const auto look = [&](StampNs stamp_ns) {
    SeenPose one{stamp_ns, {}};
    if (transforms_.lookup(target, source, stamp_ns, one.pose, unused)) seen.push_back(one);
  };
  for (const StampNs stamp_ns : stamps) {
    if (stamp_ns - before_ns > 1) look(before_ns + (stamp_ns - before_ns) / 2);
    if (stamp_ns < to_ns) look(stamp_ns);
    before_ns = stamp_ns;
  }
  std::transform(changes.begin(), changes.end(), std::back_inserter(seen), unknownBefore);
  const auto isBefore = [](const SeenPose& a, const SeenPose& b) { return a.stamp_ns < b.stamp_ns; };
  std::stable_sort(seen.begin(), seen.end(), isBefore);  // of equal stamps the last one counts
  return seen;
}

void MonitorPipeline::learnAnew(StepStatus status) {
  if (!config_.fixed_frame.empty()) return;
  trusted_placed_ = false;
  fixed_frame_.clear();
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
