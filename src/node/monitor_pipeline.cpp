#include "node/monitor_pipeline.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <new>
#include <set>
#include <utility>

#include "input/mesh_resource.h"
#include "input/short_text.h"
#include "input/transforms.h"
#include "output/advice.h"

namespace dccd {

namespace {

/// What `load` makes of a file; its error as the parameter's.
template <typename Load>
auto loadFile(const BodyConfig& body, const std::string& parameter, const std::string& formats, Load load) {
  try {
    return load();
  } catch (const std::invalid_argument& error) {
    throw ParameterError("parameter " + parameter + " of body '" + body.body.name + "': " + error.what() +
                         "; write the path of " + formats + " mesh, or package://NAME/PATH");
  }
}

/// The groups of an OBJ are sets of the body; the vertices only of those that are wanted.
void addGroups(const MeshResource& mesh, const std::string& file, const std::set<std::string>& wanted,
               BodyConfig& body) {
  for (const auto& group : mesh.groups) {
    if (body.sets.count(group.first) > 0) {
      throw ParameterError("parameter topology/sets/" + group.first + " of body '" + body.body.name + "': " + file +
                           " has a group of this name, too; rename one of the two");
    }
    body.sets[group.first] = wanted.count(group.first) > 0 ? mesh.verticesOf(group.first) : std::vector<Index>();
  }
}

std::string joined(const std::string& a, const std::string& b) { return a + (a.empty() || b.empty() ? "" : "; ") + b; }

/// What of a file was skipped.
std::string remarksOf(const std::string& file, const MeshResource& mesh) {
  std::string text;
  for (const std::string& remark : mesh.remarks) text = joined(text, file + ": " + remark);
  return text;
}

std::string setsOf(const BodyConfig& body) {
  std::string text;
  for (const auto& set : body.sets) text += (text.empty() ? "'" : ", '") + set.first + "'";
  return text.empty() ? "it has none; give them under topology/sets" : "it has " + text;
}

void checkGrid(const BodyConfig& body) {
  const std::size_t rows = body.input.rows, cols = body.input.cols, points = body.input.file_topology->vertexCount();
  if (rows == 0 || rows * cols == points) return;
  throw ParameterError("parameter topology/rows of body '" + body.body.name + "': " + std::to_string(rows) + " x " +
                       std::to_string(cols) + " = " + std::to_string(rows * cols) + ", but " + body.topology_file +
                       " has " + std::to_string(points) + " points; remove rows and cols, or file");
}

}  // namespace

MonitorPipeline::MonitorPipeline(MonitorConfig config, const TransformFeed& transforms, const std::string& map_source)
    : config_(std::move(config)),
      effects_(config_, map_source),
      transforms_(transforms),
      fixed_frame_(config_.fixed_frame) {
  hints_.resize(config_.bodies.size());
  remarks_.resize(config_.bodies.size());
  loadFiles();
  findSets();
  config_.monitor.detector.expected = config_.expectedIn(config_.phase);
  excluded_ = config_.monitor.detector.excluded;
  monitor_ = std::make_unique<Monitor>(config_.monitor, config_.monitorBodies());
  for (const BodyConfig& body : config_.bodies) decoders_.emplace_back(body.input);
  waiting_.resize(config_.bodies.size());
  placed_.resize(config_.bodies.size());
  complaints_.resize(config_.bodies.size());
  refused_.resize(config_.bodies.size());
  checked_.resize(config_.bodies.size());
  static_meshes_.resize(config_.bodies.size());
}

void MonitorPipeline::loadFiles() {
  rigid_.resize(config_.bodies.size());
  for (std::size_t b = 0; b < config_.bodies.size(); ++b) {
    BodyConfig& body = config_.bodies[b];
    if (!body.topology_file.empty()) {
      const MeshResource file =
          loadFile(body, "topology/file", "an STL, OBJ or PLY", [&] { return loadTopologyFile(body.topology_file); });
      body.input.file_topology = file.topology;
      body.input.file_dropped_faces = file.dropped_faces;
      remarks_[b] = remarksOf(body.topology_file, file);
      addGroups(file, body.topology_file, setsNamed(b), body);
      checkGrid(body);
    }
    if (!body.isRigid()) continue;
    if (body.link_mesh) {
      setRigid(b, *body.link_mesh);
      continue;
    }
    const MeshResource mesh = loadFile(body, "rigid/mesh", "an STL, OBJ, PLY or DAE",
                                       [&] { return loadMeshResource(body.mesh_file, body.mesh_scale); });
    addGroups(mesh, body.mesh_file, setsNamed(b), body);
    remarks_[b] = remarksOf(body.mesh_file, mesh);
    hints_[b] = joined(remarks_[b], rigidHint(body.mesh_file, mesh.positions, body.mesh_scale));
    setRigid(b, mesh);
  }
}

MonitorPipeline::Rigid MonitorPipeline::rigidOf(const MeshResource& mesh) {
  Rigid rigid;
  rigid.mesh.topology = mesh.topology;
  rigid.reference = mesh.positions;
  rigid.mesh.dropped_faces = mesh.dropped_faces;
  rigid.mesh.rigid = true;
  return rigid;
}

void MonitorPipeline::setRigid(std::size_t body, const MeshResource& mesh) {
  const BodyConfig& config = config_.bodies[body];
  Rigid& rigid = rigid_[body].emplace(rigidOf(mesh));
  rigid.name = config.body.name;
  rigid.frame = config.tf_frame;
  rigid.may_be_lost = !config.link.empty();
  const double radius_m = config.input.noise_radius_m;
  if (radius_m > 0) rigid.mesh.radius_m.assign(rigid.reference.size(), radius_m);
}

std::string MonitorPipeline::expectedEntry(std::size_t expectation) const {
  return "expected_contacts[" + std::to_string(config_.expected_entry[expectation]) + "]";
}

std::set<std::string> MonitorPipeline::setsNamed(std::size_t body) const {
  std::set<std::string> names;
  for (const Expectation& one : config_.expected_contacts) {
    for (const ExpectedPartner& partner : one.partners) {
      if (partner.body == body && !partner.set.empty()) names.insert(partner.set);
    }
  }
  return names;
}

void MonitorPipeline::findSets() {
  for (std::size_t e = 0; e < config_.expected_contacts.size(); ++e) {
    for (ExpectedPartner& partner : config_.expected_contacts[e].partners) {
      if (partner.set.empty()) continue;
      const BodyConfig& body = config_.bodies[partner.body];
      const auto found = body.sets.find(partner.set);
      if (found == body.sets.end()) {
        throw ParameterError("parameter " + expectedEntry(e) + "/vertices names '" + partner.set +
                             "', which is no set of body '" + body.body.name + "'; " + setsOf(body));
      }
      if (found->second.empty()) {
        throw ParameterError("parameter " + expectedEntry(e) + "/vertices names '" + partner.set + "' of body '" +
                             body.body.name + "', a group without faces");
      }
      partner.vertices = found->second;
    }
  }
  for (std::size_t b = 0; b < config_.bodies.size(); ++b) {
    const Topology* known = rigid_[b] ? rigid_[b]->mesh.topology.get() : config_.bodies[b].input.file_topology.get();
    const std::string problem = known ? indexProblem(b, *known) : "";
    if (!problem.empty()) throw ParameterError(problem);
  }
}

void MonitorPipeline::setPhase(const std::string& phase) {
  const std::vector<std::string> known = config_.phases();
  if (!phase.empty() && std::find(known.begin(), known.end(), phase) == known.end()) {
    throw ParameterError("phase '" + phase + "' is unknown; " + config_.phasesInWords());
  }
  expectNow(phase);
  config_.phase = phase;
}

std::string MonitorPipeline::phaseInWords() const {
  std::string text = config_.phase.empty() ? "no phase" : "phase '" + config_.phase + "'";
  const std::vector<std::string> expected = describe(config_.monitor.detector.expected, monitor_->bodies());
  if (expected.empty()) return text + ", no contact is expected";
  for (std::size_t i = 0; i < expected.size(); ++i) text += (i == 0 ? ", expected: " : "; ") + expected[i];
  return text;
}

void MonitorPipeline::measureUnknown(Outcome& outcome) const {
  if (config_.unknown_space != UnknownSpace::REPORT || !outcome.answered || !outcome.obstacle) return;
  const std::shared_ptr<const KnownSpace>& known = outcome.step->map.known;
  if (!known) return;
  const auto start = std::chrono::steady_clock::now();
  const Deadline deadline = monitor_->restOf(outcome);
  SweptSpace sum;
  Positions map_t0, map_t1;
  std::vector<std::uint8_t> active;
  for (const Body& body : outcome.step->bodies) {
    if (!meetsMap(body)) continue;
    const Topology& topology = *body.topology;
    active.assign(topology.vertexCount(), 1);
    for (const Index v : body.vertex_mask) active[v] = 0;
    map_t0 = *body.t0;
    map_t1 = *body.t1;
    transform(outcome.step->map.map_from_fixed, map_t0);
    transform(outcome.step->map.map_from_fixed, map_t1);
    const SweptSpace one =
        known->sweptSpace(topology, map_t0, map_t1, active.data(), KnownSpace::MOST_BLOCKS, deadline);
    sum.voxels += one.voxels;
    sum.unknown += one.unknown;
    sum.complete = sum.complete && one.complete;
  }
  // Of a sweep too large to be counted there is no share: that of a part may be anything.
  outcome.unknown_fraction = sum.complete ? sum.unknownFraction() : std::numeric_limits<double>::quiet_NaN();
  const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - start;
  outcome.stats[Effect::UNKNOWN_SPACE] = {sum.voxels, sum.unknown, spent.count()};
  outcome.stats.total_ms += spent.count();
}

void MonitorPipeline::skip(std::size_t body, StepStatus status, StampNs stamp_ns, std::int64_t arrival_ns,
                           const std::string& reason) {
  const std::string text = shortText(reason);
  monitor_->skip(body, status, stamp_ns, text, arrival_ns);
  complaints_[body] = "refused: " + text;
}

std::string MonitorPipeline::indexProblem(std::size_t body, const Topology& topology) const {
  const auto problem = [&](const std::string& parameter, const std::vector<Index>& vertices) -> std::string {
    const auto largest = std::max_element(vertices.begin(), vertices.end());
    if (largest == vertices.end() || *largest < topology.vertexCount()) return {};
    return "parameter " + parameter + " of body '" + config_.bodies[body].body.name + "' names vertex " +
           std::to_string(*largest) + ", but the mesh has " + std::to_string(topology.vertexCount());
  };
  std::string found = problem("vertex_mask", config_.bodies[body].body.vertex_mask);
  for (std::size_t e = 0; e < config_.expected_contacts.size(); ++e) {
    for (const ExpectedPartner& partner : config_.expected_contacts[e].partners) {
      if (!found.empty() || partner.body != body) continue;
      const std::string set = partner.set.empty() ? "" : " (set '" + partner.set + "')";
      found = problem(expectedEntry(e) + "/vertices" + set, partner.vertices);
    }
  }
  return found;
}

void MonitorPipeline::take(std::size_t body, const MeshMessage& message) {
  finishing_ = false;
  Waiting waiting;
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
  const std::string type_problem = meshTypeProblem(message.datatype, message.md5);
  if (!type_problem.empty()) return refuse(StepStatus::BAD_MESSAGE, type_problem);
  try {
    waiting.mesh =
        decoders_[body].decode(message.datatype, {message.bytes.data(), message.bytes.size()}, message.object);
    waiting.mesh.arrival_ns = message.arrival_ns;
    if (topology_filter_) {
      waiting.mesh.topology = topology_filter_(body, waiting.mesh.topology, waiting.mesh.positions);
    }
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
  const bool first_remark = !waiting.mesh.row_step_remark.empty() && wrong_row_steps_++ == 0;
  if (is_new || first_remark) {
    hints_[body] = joined(remarks_[body], meshHint(waiting.mesh, config_.bodies[body].input));
  }
  const bool unstamped = waiting.mesh.stamp_ns == 0;
  if (unstamped) waiting.mesh.stamp_ns = message.receipt_ns;
  monitor_->countReceived(body, 1, unstamped);
  weld_changes_ += waiting.mesh.weld_changes;
  if (fixed_frame_.empty() && body == config_.monitor.clock_body) fixed_frame_ = waiting.mesh.frame_id;
  if (waiting_[body]) {  // one that was kept; steps have waited for its transform, and need not do so once more
    monitor_->countDropped(body, StepStatus::NO_TRANSFORM);
    waiting.kept = true;
    waiting.reason = std::move(waiting_[body]->reason);
  }
  waiting_[body] = std::move(waiting);
}

void MonitorPipeline::reconfigure(const std::function<void(MonitorOptions&, MarkerConfig&)>& change) {
  MonitorOptions options = config_.monitor;
  MarkerConfig markers = config_.markers;
  change(options, markers);
  effects_.decide(options);
  monitor_->setOptions(options);
  // In place, so that nothing else is written: the threads of topics and maps read the rest of it meanwhile.
  change(config_.monitor, config_.markers);
}

void MonitorPipeline::setMap(LoadedMap map, std::int64_t now_ns) {
  expectMap();
  if (map.trusted && !config_.takesMapFileAlone()) {
    trusted_map_ = std::move(map);
    return;
  }
  // What is own follows from each map, not from the newest alone.
  if (config_.ownsVoxels()) placeMap(now_ns);
  if (!unplaced_map_) unplaced_since_ns_ = now_ns;
  unplaced_map_ = std::move(map);
}

bool MonitorPipeline::nextOutcome(std::int64_t now_ns, Outcome& outcome) {
  if (MonitorOptions options = monitor_->options(); effects_.decide(options)) monitor_->setOptions(options);
  placeMap(now_ns);
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
  if (!monitor_->next(now_ns, outcome)) return false;
  effects_.learn(outcome, *monitor_);
  frame_answered_ = frame_answered_ || outcome.answered;
  nameMissing(outcome);
  nameUnwatched(outcome);
  measureUnknown(outcome);
  if (config_.promises()) {
    promises_.setBounds(speedBounds());
    promises_.follow(outcome);
  }
  return true;
}

bool MonitorPipeline::waiting() const {
  if (unplaced_map_ || monitor_->waiting()) return true;
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

void MonitorPipeline::reset(StepStatus status) {
  for (std::size_t b = 0; b < waiting_.size(); ++b) {
    if (!waiting_[b] || isStatic(b)) continue;
    monitor_->countDropped(b, status);
    waiting_[b].reset();
  }
  monitor_->reset(status);
  promises_.forget();
  if (status != StepStatus::RESET) return;
  for (MeshDecoder& decoder : decoders_) decoder.forgetWeld();
  learnAnew(status);
}

Outcome MonitorPipeline::checkNow() {
  Outcome outcome;
  if (const std::size_t body = misplaced(); body < waiting_.size()) {
    outcome.status = StepStatus::NO_BODY;
    outcome.reason = missing(body);
    return outcome;
  }
  outcome = monitor_->checkNow();
  nameMissing(outcome);
  nameUnwatched(outcome);
  return outcome;
}

std::string MonitorPipeline::takeComplaint(std::size_t body) { return std::exchange(complaints_[body], {}); }

}  // namespace dccd
