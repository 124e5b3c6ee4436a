#include "node/monitor_pipeline.h"

#include <algorithm>
#include <array>
#include <new>
#include <set>
#include <sstream>
#include <utility>

#include "base/contact_fields.h"
#include "input/short_text.h"
#include "input/transforms.h"
#include "node/liveness.h"
#include "output/advice.h"

namespace dccd {

MonitorPipeline::MonitorPipeline(MonitorConfig config, TransformFeed& transforms, const std::string& map_source)
    : config_(std::move(config)),
      effects_(config_, map_source),
      transforms_(transforms),
      fixed_frame_(config_.fixed_frame) {
  hints_.resize(config_.bodies.size());
  file_hints_.resize(config_.bodies.size());
  doubts_.resize(config_.bodies.size());
  map_doubts_.resize(config_.bodies.size());
  loadFiles();
  findSets();
  config_.monitor.detector.expected = config_.expectedIn(config_.phase);
  config_.monitor.held = config_.held();
  excluded_ = config_.monitor.detector.excluded;
  config_.monitor.in_cell = true;
  monitor_ = std::make_unique<Monitor>(config_.monitor, config_.monitorBodies());
  monitor_->setTracks(&tracks_);
  for (const BodyConfig& body : config_.bodies) decoders_.emplace_back(body.input);
  waiting_.resize(config_.bodies.size());
  placed_.resize(config_.bodies.size());
  problems_.resize(config_.bodies.size());
  refused_.resize(config_.bodies.size());
  checked_.resize(config_.bodies.size());
  static_meshes_.resize(config_.bodies.size());
  passed_over_.resize(config_.bodies.size());
  came_.resize(config_.bodies.size());
  sources_.resize(config_.bodies.size());
  seen_from_.resize(config_.bodies.size());
  if (config_.intent)
    motion_.emplace(*config_.intent, config_.robot.description, config_.monitor.detector.rigid_tolerance_m);
}

void MonitorPipeline::skip(std::size_t body, StepStatus status, StampNs stamp_ns, std::int64_t arrival_ns,
                           const std::string& reason) {
  const std::string text = shortText(reason);
  monitor_->skip(body, status, stamp_ns, text, arrival_ns);
  problems_[body] = "refused: " + text;
}

void MonitorPipeline::take(std::size_t body, const MeshMessage& message) {
  // First of all: what is refused, or lost to a fault, is missed between the frames before and after it.
  came_[body] = message.number > 0 ? message.number : came_[body] + 1;
  finishing_ = false;
  Waiting waiting;
  waiting.since_ns = message.since_ns < 0 ? message.arrival_ns : message.since_ns;
  const auto refuse = [&](StepStatus status, const std::string& reason) {
    monitor_->countReceived(body);
    skip(body, status, message.receipt_ns, message.arrival_ns, reason);
    if (isStatic(body)) refused_[body] = shortText(reason);
  };
  if (message.too_large > 0) {
    return refuse(StepStatus::BAD_MESSAGE, "a message of " + std::to_string(message.too_large) +
                                               " bytes is more than the quarter of max_memory_mb that queues may hold");
  }
  const auto noMemory = [&](std::size_t bytes) {
    refuse(StepStatus::BAD_MESSAGE,
           "there is not enough memory for this message of " + std::to_string(bytes) + " bytes");
  };
  if (message.no_memory > 0) return noMemory(message.no_memory);
  const std::string type_problem = meshTypeProblem(message.datatype, message.md5, message.definition);
  if (!type_problem.empty()) return refuse(StepStatus::BAD_MESSAGE, type_problem);
  try {
    waiting.mesh =
        decoders_[body].decode(message.datatype, {message.bytes.data(), message.bytes.size()}, message.object);
    waiting.mesh.arrival_ns = message.arrival_ns;
    waiting.mesh.number = came_[body] - passed_over_[body].messages;  // which are no frames
    waiting.mesh.thinned = message.thinned;
    if (topology_filter_) waiting.mesh.topology = topology_filter_(body, waiting.mesh.topology);
  } catch (const PassedOver& other) {
    return passed_over_[body].add(other);
  } catch (const MeshError& error) {
    return refuse(error.status, error.what());
  } catch (const std::bad_alloc&) {
    return noMemory(message.size());
  }
  // Of a mesh that is the last one's, all is known.
  const bool is_new = checked_[body] != waiting.mesh.topology;
  if (const std::string problem = is_new ? indexProblem(body, *waiting.mesh.topology) : ""; !problem.empty()) {
    return refuse(StepStatus::VERTEX_COUNT, problem);
  }
  refused_[body].clear();
  checked_[body] = waiting.mesh.topology;
  keepHint(body, waiting.mesh, is_new);
  const bool unstamped = waiting.mesh.stamp_ns == 0;
  if (unstamped) waiting.mesh.stamp_ns = message.receipt_ns;
  const double back_s = sources_[body].hear(waiting.mesh, message);
  if (body == config_.monitor.clock_body && back_s > tolerance::LATE_FRAME_S)
    transforms_.beginAnew(waiting.mesh.stamp_ns);
  monitor_->countReceived(body, 1, unstamped);
  weld_changes_ += waiting.mesh.weld_changes;
  points_no_measurement_ += waiting.mesh.no_measurement;
  if (fixed_frame_.empty() && body == config_.monitor.clock_body) fixed_frame_ = waiting.mesh.frame_id;
  if (waiting_[body]) {  // one that was kept; steps have waited for its transform, and need not do so once more
    monitor_->countDropped(body, StepStatus::NO_TRANSFORM);
    waiting.kept = true;
    waiting.reason = std::move(waiting_[body]->reason);
  }
  waiting_[body] = std::move(waiting);
}

/// Again where something else is to be said of it than of the last one.
void MonitorPipeline::keepHint(std::size_t body, const DecodedMesh& mesh, bool is_new) {
  const bool first_wrong = !mesh.row_step_hint.empty() && wrong_row_steps_++ == 0;
  const bool others_unread = std::exchange(passed_over_[body].unread, mesh.unread_markers) != mesh.unread_markers;
  passed_over_[body].may_be_things = passed_over_[body].may_be_things || mesh.has_others;
  if (!is_new && !first_wrong && !others_unread) return;
  doubts_[body] = meshDoubt(mesh, config_.bodies[body].input);
  hints_[body] = joined(joined(file_hints_[body], doubts_[body]), meshHint(mesh));
}

void MonitorPipeline::reconfigure(const std::function<void(MonitorOptions&, MarkerConfig&)>& change) {
  MonitorOptions options = config_.monitor;
  MarkerConfig markers = config_.markers;
  change(options, markers);
  const bool expects_others = !(options.detector.expected == config_.monitor.detector.expected);
  effects_.decide(options);
  monitor_->setOptions(options);
  // In place, so that nothing else is written: the threads of topics and maps read the rest of it meanwhile.
  change(config_.monitor, config_.markers);
  if (expects_others) voidWhatWasSaid("other contacts are expected now");
}

void MonitorPipeline::voidWhatWasSaid(const std::string& why) {
  promises_.revoke(why);
  answered_.reset();
  changed_ = why;
  changed_ns_ = call_ns_;
  newest_ns_ = sources_[config_.monitor.clock_body].stamp_ns;
  if (voided_.empty()) voided_ = why;  // the first reason: what else changes follows from it
}

void MonitorPipeline::setMap(LoadedMap map, std::int64_t now_ns) {
  expectMap();
  // The maps that clouds make have numbers of their own, and one that is refused has one if the cloud is in the next.
  if (map.number == 0 && !config_.takesClouds()) map.number = map_number_ + 1;
  map_number_ = std::max(map_number_, map.number);
  if (map.trusted && !config_.takesMapFileAlone()) {
    trusted_map_ = std::move(map);
    return;
  }
  if (!map.hint.empty() && map_hints_.insert(map.hint).second) map_hint_ = map.hint;
  map_slow_ = map.slow;
  if (!map.missed.empty()) missed_clouds_ = std::move(map.missed);
  if (map.first_ns != 0) first_cloud_ns_ = map.first_ns;
  if (!map.placed_by.empty()) clouds_placed_by_ = std::move(map.placed_by);
  if (map.surface) map_lead_.add(map.stamp_ns, map.receipt_ns);
  map.is_late = isLate(map.stamp_ns, map_stamp_ns_);
  if (!map.is_late) map_stamp_ns_ = map.stamp_ns;
  unplaced_maps_.push_back({std::move(map), now_ns});
  limitUnplacedMaps();
}

bool MonitorPipeline::nextOutcome(std::int64_t now_ns, Outcome& outcome) {
  if (MonitorOptions options = monitor_->options(); effects_.decide(options)) monitor_->setOptions(options);
  placeMaps(now_ns);
  // Static bodies first: the clock body's frame is a step, which is to find them where they are.
  for (const bool statics : {true, false}) {
    for (std::size_t b = 0; b < waiting_.size(); ++b) {
      if (waiting_[b] && isStatic(b) == statics) placeFrame(b, now_ns);
    }
  }
  if (finishing_) giveUp();
  // Nor do steps that wait for other bodies find a static one where it is no more.
  if (const std::size_t body = misplaced(); body < waiting_.size()) {
    if (!isHopeless(body)) return false;
    monitor_->dropSteps(StepStatus::NO_BODY, missing(body));
  }
  if (resting_) monitor_->dropSteps(StepStatus::DISABLED, "the monitor is disabled");
  const std::vector<SpeedBound> bounds = speedBounds();
  if (config_.promises() && !config_.intent && !config_.limits && !effects_.areAllDistancesRead()) {
    monitor_->readDistancesBy(bounds, config_.speed_law);
  } else {
    monitor_->readAllDistances();
  }
  if (!monitor_->next(now_ns, outcome)) return false;
  if (resting_) return true;
  effects_.learn(outcome);
  frame_answered_ = frame_answered_ || outcome.answered;
  answerForCell(outcome.arrival_ns, now_ns, outcome);
  doubtMap(outcome);
  // From now on Liveness watches. On a line of its own, so that run_mutants.py finds where the witness ends.
  if (outcome.answered) outcome.claim.answer(Question::NEWEST_FRAME, "");
  if (config_.promises()) {
    promises_.setBounds(bounds);
    promises_.follow(outcome);
    intended_ = {};
    intended_.along.unused = "no answer";
    if (motion_ && outcome.answered) {
      answered_ = outcome;
      intends_anew_ = false;
      followIntended();
    }
  }
  statement_ = statementOf(outcome, effects_.mapSource(), promises_.broken(), doubts());
  if (!map_slow_.empty()) {
    statement_.hint = outcome.status == StepStatus::NO_MAP ? map_slow_ : joined(statement_.hint, map_slow_);
  }
  return true;
}

void MonitorPipeline::hearMap(const std::string& topic, const std::string& frame_id, const std::string& sender) {
  constexpr std::size_t MOST_VIEWS = 64;  // a publisher may make up a frame_id for each cloud
  const std::string view = frame_id.empty() ? topic : topic + " of frame '" + frame_id + "'";
  map_senders_[map_senders_.size() < MOST_VIEWS || map_senders_.count(view) > 0 ? view : topic].hear(sender);
}

StatsContext MonitorPipeline::counters() const {
  StatsContext context;
  context.frames = monitor_->total();
  context.weld_changes = weld_changes_;
  context.transforms_unusable = transforms_.unusable();
  context.wrong_row_steps = wrong_row_steps_;
  for (const auto& body : passed_over_) context.markers_passed_over += body.messages;
  context.points_no_measurement = points_no_measurement_;
  context.parameter_hash = config_.hash();
  context.promises = promises_.counts();
  return context;
}

bool MonitorPipeline::waiting() const {
  if (!unplaced_maps_.empty() || monitor_->waiting()) return true;
  for (const auto& one : waiting_) {
    if (one) return true;
  }
  return false;
}

void MonitorPipeline::finish() { finishing_ = true; }

void MonitorPipeline::giveUp() {
  for (std::size_t b = 0; b < waiting_.size(); ++b) {
    if (!waiting_[b]) continue;
    const Waiting done = std::move(*waiting_[b]);
    waiting_[b].reset();
    if (placed_[b]) refused_[b] = done.reason;
    skip(b, StepStatus::NO_TRANSFORM, done.mesh.stamp_ns, done.mesh.arrival_ns, done.reason);
  }
  monitor_->finish();
}

void MonitorPipeline::reset(StepStatus status, const std::string& why) {
  for (std::size_t b = 0; b < waiting_.size(); ++b) {
    if (!waiting_[b] || isStatic(b)) continue;
    monitor_->countDropped(b, status);
    waiting_[b].reset();
  }
  monitor_->reset(status);
  promises_.forget(why);
  if (motion_) motion_->forget();
  intended_ = {};
  answered_.reset();
  if (status != StepStatus::RESET) return;
  for (MeshDecoder& decoder : decoders_) decoder.forgetWeld();
  map_doubts_.assign(config_.bodies.size(), std::nullopt);
  for (Source& source : sources_) {
    source.lead = {}, source.senders = {}, source.vertices = 0, source.is_renumbered = false;
  }
  map_lead_ = {};
  map_senders_.clear();
  missed_before_.clear();
  for (const MissedClouds& missed : missed_clouds_) missed_before_.push_back(missed.count);
  learnAnew(status);
}

Outcome MonitorPipeline::checkNow(std::int64_t now_ns) {
  Outcome outcome;
  if (const std::size_t body = misplaced(); body < waiting_.size()) {
    outcome.status = StepStatus::NO_BODY;
    outcome.reason = missing(body);
    return outcome;
  }
  outcome = monitor_->checkNow();
  answerForCell(now_ns, now_ns, outcome);
  if (!outcome.answered) return outcome;
  const double silent_s = secondsBetween(outcome.arrival_ns, now_ns), most_s = config_.monitor.store.max_step_s;
  outcome.claim.answer(Question::NEWEST_FRAME, silent_s > most_s ? noFrameFor(most_s) : "");
  return outcome;
}

std::string MonitorPipeline::onlyPassedOver(std::size_t body) const {
  const OtherMarkers& others = passed_over_[body];
  if (checked_[body] || others.messages == 0) return {};
  return "all messages so far, " + std::to_string(others.messages) + ", are passed over: " + others.newest;
}

std::vector<SpeedBound> MonitorPipeline::speedBounds() const {
  std::vector<SpeedBound> bounds = config_.speedBounds(monitor_->bodies().size());
  for (std::size_t b = 0; b < config_.bodies.size(); ++b) {
    if (rigid_[b] && !fixed_frame_.empty() && rigid_[b]->frame == fixed_frame_) bounds[b].max_m_s = 0;
  }
  for (std::size_t i = 0; i < attached_.size(); ++i) {
    if (!attached_[i]) continue;
    SpeedBound& bound = bounds[config_.bodies.size() + i];
    const std::string& frame = rigid_[config_.bodies.size() + i]->frame;
    for (std::size_t b = 0; b < config_.bodies.size(); ++b) {  // it goes with what carries it
      if (!rigid_[b] || rigid_[b]->frame != frame) continue;
      bound.max_m_s = std::max(bound.max_m_s, bounds[b].max_m_s);
      bound.slows_down = bound.slows_down && bounds[b].slows_down;
    }
  }
  return bounds;
}

void MonitorPipeline::doubtMap(const Outcome& outcome) {
  if (!outcome.answered || !outcome.obstacle || !outcome.start_state_complete) return;
  for (std::size_t b = 0; b < map_doubts_.size(); ++b) {
    const Body& body = outcome.step->bodies[b];
    if (map_doubts_[b] || !meetsMap(body)) continue;
    // Own voxels are looked for already, or cannot be; a file's are nobody's.
    if (ownsVoxels(body) || config_.takesMapFileAlone() || config_.unknown_space == UnknownSpace::OCCUPIED) continue;
    std::set<Index> occupied;
    const auto isMet = [b](const std::array<std::uint16_t, 2>& pair, bool expected) {
      return !expected && pair == std::array<std::uint16_t, 2>{static_cast<std::uint16_t>(b), OBSTACLE_BODY};
    };
    for (const StartIntersection& one : outcome.intersections) {
      if (isMet(one.body, one.expected)) occupied.insert(one.vertex[0]);
    }
    // Noise has half of the vertices beside the voxels that hold them; their edges and faces meet those.
    bool came_there = false;
    for (const Contact& one : outcome.contacts) {
      if (!isMet(one.body, one.expected)) continue;
      came_there = true;
      if (one.initial) forContactVertices(one, [&](std::uint16_t, Index v) { occupied.insert(v); });
    }
    if (occupied.empty() && !came_there) continue;  // a later map may hold it
    const bool holds = 2 * occupied.size() >= body.topology->vertexCount();
    map_doubts_[b] = holds ? "the map was occupied where '" + body.name + "' was: does it hold '" + body.name +
                                 "' itself? Then set own_voxels_m: auto"
                           : "";
  }
}

std::vector<std::string> MonitorPipeline::doubts() const {
  std::vector<std::string> sentences;
  for (const auto& doubt : map_doubts_) {
    if (doubt && !doubt->empty()) sentences.push_back(*doubt);
  }
  for (std::size_t b = 0; b < doubts_.size(); ++b) {
    if (!doubts_[b].empty()) sentences.push_back("body '" + config_.bodies[b].body.name + "': " + doubts_[b]);
  }
  sentences.insert(sentences.end(), config_.robot.doubts.begin(), config_.robot.doubts.end());
  return sentences;
}

std::string MonitorPipeline::takeProblem(std::size_t body) { return std::exchange(problems_[body], {}); }

}  // namespace dccd
