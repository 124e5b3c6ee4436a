// The worker's thread: messages into the pipeline, outcomes out of it.
#include "node/collision_monitor_impl.h"

#include <algorithm>
#include <utility>

#include "output/advice.h"
#include "report/look_ahead_score.h"

namespace dccd {
namespace {

using std::chrono::microseconds;

// While something waits for tf or another body the worker looks again this often; else it sleeps until it is woken, and
// this long at most, for diagnostics.
constexpr microseconds POLL{2000}, SLEEP{100000};

// A topic that was heard is looked into when it stays away for longer than max_step_s, and than this.
constexpr double LEAST_SILENCE_S = 1;

constexpr std::size_t SHORT_LIST = 1000;  // contacts, of which the message is made in 0.1 ms

}  // namespace

void CollisionMonitor::Impl::resetNow(StepStatus status) {
  accountDropped();
  std::vector<bool> spared(config.bodies.size());
  for (std::size_t b = 0; b < spared.size(); ++b) spared[b] = pipeline.isStatic(b);
  const auto cleared = queue.clear(spared);
  for (std::size_t b = 0; b < cleared.size(); ++b) {
    pipeline.monitor().countReceived(b, cleared[b]);
    pipeline.monitor().countDropped(b, status, cleared[b]);
  }
  const std::string frame = pipeline.fixedFrame();  // a reset forgets one that was learnt
  const std::string why = std::string("no frame has been answered since ") +
                          (status == StepStatus::RESET ? "the reset" : "~enable was called");
  pipeline.reset(status, why);
  state.forgotten(why);
  publishNoPromise();
  outputs.publishNothing(frame);
  if (!outputs.wantsPrediction()) return;
  Outcome none;
  none.status = status;
  none.start_ns = none.stamp_ns = newest_ns;
  publishPrediction(none);
}

void CollisionMonitor::Impl::accountDropped() {
  for (std::size_t b = 0; b < disabled_frames.size(); ++b) {
    const std::uint64_t count = disabled_frames[b].exchange(0);
    pipeline.monitor().countReceived(b, count);
    pipeline.monitor().countDropped(b, StepStatus::DISABLED, count);
  }
  const auto dropped = queue.takeDropped();
  for (std::size_t b = 0; b < dropped.size(); ++b) {
    if (dropped[b] == 0) continue;
    pipeline.monitor().countReceived(b, dropped[b]);
    pipeline.monitor().countDropped(b, StepStatus::QUEUE_FULL, dropped[b]);
    // Frames pile up while the first ones wait; the cure of a doubt is told alone.
    if (log.isStarting() || pipeline.statement().is_doubts_fault) continue;
    log.complain(b, "queue",
                 std::to_string(dropped[b]) +
                     " frames dropped: steps take longer than the time between frames, or frames are too large for "
                     "max_memory_mb; " +
                     adviceFor(StepStatus::QUEUE_FULL, {}, log.mapSource()));
  }
}

void CollisionMonitor::Impl::takeMaps() {
  for (LoadedMap map; maps && maps->take(map);) {
    if (!map.surface) {
      log.complain(config.bodies.size(), "map", "refused: " + map.problem);
      map.problem = whyRefused(map.problem, config);
    }
    pipeline.setMap(std::move(map), waiting_clock.now());
  }
}

/// A frame is answered with the map that came before it, as far as that is ready in time and the queue has room. Where
/// clouds make the map there is always one on its way: each has answer_timeout_s until it is in use.
bool CollisionMonitor::Impl::waitsForMap() {
  const std::optional<std::int64_t> since_ns = maps && !config.takesClouds() ? maps->busySince() : std::nullopt;
  return since_ns && secondsBetween(*since_ns, steadyNs()) < config.transform_timeout_s &&
         queue.size(config.monitor.clock_body) < config.queue_size;
}

bool CollisionMonitor::Impl::mayTake(std::size_t body) {
  return pipeline.idle(body) && queue.size(body) > 0 && !(body == config.monitor.clock_body && waitsForMap());
}

/// Which frames of static bodies came, and which are in use from here on: not one that waits for its place.
void CollisionMonitor::Impl::tellStaticFrames() {
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    if (!pipeline.isStatic(b) || !mesh_subscriptions[b]) continue;
    const std::string& name = config.bodies[b].body.name;
    state.staticCame(name, mesh_subscriptions[b]->came());  // also one that roscpp could not make
    if (pipeline.idle(b)) state.staticInUse(name, pipeline.lastTaken(b));
  }
}

void CollisionMonitor::Impl::tellProblems() {
  std::size_t first_link = config.bodies.size(), links = 0;
  std::string links_problem;
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    const std::string problem = pipeline.takeProblem(b);
    // The clock body's come as outcomes, which are logged when they are published.
    if (problem.empty() || b == config.monitor.clock_body) continue;
    const bool may_come = problem.compare(0, 6, "waits:") == 0 || !config.bodies[b].body.link.empty();
    if (may_come && log.waits(log.topicOf(b) + ": " + problem)) continue;
    if (config.bodies[b].body.link.empty()) {
      log.complain(b, "message", problem);
    } else if (links++ == 0) {
      first_link = b;
      links_problem = problem;
    }
  }
  // An arm's links are lost together: one line.
  const std::string more = links > 1 ? "and " + std::to_string(links - 1) + " more of the robot's links: " : "";
  if (links > 0) log.complain(first_link, "message", more + links_problem);
  const std::string hint = pipeline.takeMapHint();
  if (!hint.empty()) log.complain(config.bodies.size(), "map", hint);
}

/// Topics that should have said something. What holds at all times, a static body's or a map's, may be silent once it
/// has come, but for a map that is to be young.
std::vector<AwaitedTopic> CollisionMonitor::Impl::silentTopics() {
  std::vector<AwaitedTopic> silent;
  const std::int64_t now_ns = silence_clock.now();
  const double patience_s = std::max(config.monitor.store.max_step_s, LEAST_SILENCE_S);
  heard.resize(config.bodies.size());
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    if (!mesh_subscriptions[b]) continue;
    const std::uint64_t frames = pipeline.monitor().counters(b).received + pipeline.passedOver(b) + queue.size(b);
    if (frames != heard[b].frames) heard[b] = {frames, now_ns};
    if (frames > 0 && (pipeline.isStatic(b) || secondsBetween(heard[b].at_ns, now_ns) < patience_s)) continue;
    silent.push_back({log.topicOf(b), mesh_subscriptions[b]->getNumPublishers(),
                      config.bodies_listed ? "bodies/" + config.bodies[b].body.name + "/topic" : "mesh:=TOPIC",
                      frames > 0});
  }
  const bool may_rest = pipeline.effects().mapSeen() && config.monitor.octomap_timeout_s == 0;
  for (const ros::Subscriber& map : map_subscribers) {
    if (!pipeline.effects().mapExpected() || may_rest) continue;
    silent.push_back({map.getTopic(), map.getNumPublishers(), "", map_publisher_seen});
  }
  return silent;
}

void CollisionMonitor::Impl::lookIntoSilence() {
  if (const auto found = master->takeHint()) {
    log.hintAt(*found, pipeline);
    state.setHint(log.hint());
  }
  std::vector<AwaitedTopic> silent = silentTopics();
  const auto fell = [](const AwaitedTopic& topic) { return topic.heard && !topic.named_by.empty(); };
  const auto fallen = static_cast<std::size_t>(std::count_if(silent.begin(), silent.end(), fell));
  const bool news = std::exchange(fallen_silent, fallen) != fallen;
  if (!news && !log.isSilenceDue(steadyNs())) return;
  const bool mapless = pipeline.effects().mayUseMap() && !pipeline.effects().mapSeen();
  master->lookInto({std::move(silent), mapless ? log.mapSource() : ""});
}

StatsContext CollisionMonitor::Impl::statsContext() const {
  StatsContext context = pipeline.counters();
  context.steps_unpublished = steps_unpublished;
  context.maps_received = maps ? maps->received() : 0;
  context.frames_handed_over = frames_handed_over;
  context.requests_refused = requests_refused;
  context.maps_refused = maps ? maps->refused() : 0;
  context.maps_dropped = maps ? maps->dropped() : 0;
  const CloudCounters clouds = maps ? maps->cloudCounters() : CloudCounters();
  context.clouds_only_filled = clouds.only_filled;
  context.points_no_measurement += clouds.no_measurement;
  return context;
}

/// Whatever a step's messages throw, the node goes on; but nobody is to take what was said before for the whole answer.
void CollisionMonitor::Impl::publishOutcome(Outcome& outcome) try {
  const auto& bodies = pipeline.monitor().bodies();
  const std::string& frame = pipeline.fixedFrame();
  state.mapSettled(pipeline.settledMapNs(), pipeline.placedMapNs());
  log.tell(outcome, pipeline.statement());
  newest_ns = outcome.stamp_ns;
  // Once the state is published, roscpp's thread is awake and takes locks that each question for subscribers waits for:
  // results are ready by then. But a long list is not to keep a clear state standing that is over.
  std::function<void()> publish;
  if (outcome.contacts.size() <= SHORT_LIST) publish = outputs.makeResult(outcome, bodies, frame);
  state.tell(outcome, pipeline.statement(), frame, pipeline.speedScale(outcome));
  publishAhead(outcome);
  if (!publish) publish = outputs.makeResult(outcome, bodies, frame);
  publish();
  const double latency_s = secondsBetween(outcome.arrival_ns, steadyNs());
  outputs.publishMarkers(outcome, bodies, config.markers, frame, pipeline.intended().path);
  publishEffects(toRosTime(outcome.stamp_ns));
  predict(outcome);
  if (outputs.wantsStats()) {
    StatsContext context = statsContext();
    context.latency_s = latency_s;
    outputs.publishStats(outcome, context, frame);
  }
  diagnostics.add(outcome, latency_s);
} catch (const std::exception& error) {
  ++steps_unpublished;
  log.complain(config.monitor.clock_body, "publishing",
               std::string("not all of a step's results could be published: ") + error.what());
  state.takeBack("not all of a step's results could be published");
  carryOut([this] { outputs.publishNothing(pipeline.fixedFrame()); });
}

/// State and promise are latched: nobody is to go on by what a command made void.
void CollisionMonitor::Impl::publishVoided() {
  const std::string why = pipeline.takeVoided();
  if (why.empty()) return;
  state.takeBack(why + "; no step has been answered since");
  if (pipeline.promises().isRevoked()) publishNoPromise();  // else none was made that could be taken back
}

/// Beside the scale: until when nothing touches, and what is intended.
void CollisionMonitor::Impl::publishAhead(const Outcome& outcome) {
  if (config.promises()) outputs.publishSafeUntil(pipeline.safeUntilMessage(outcome, ros::Time::now()));
  if (config.limits) outputs.publishLimits([&] { return pipeline.limitsMessage(outcome); });
  if (!config.intent) return;
  outputs.publishAlongPath(pipeline.alongPathMessage(outcome));
  const std::string problem = pipeline.takeIntendedProblem();
  if (!problem.empty()) complainOfIntended(problem);
}

void CollisionMonitor::Impl::publishNoPromise() {
  if (!config.promises()) return;
  outputs.publishSafeUntil(toSafeUntil(Outcome(), pipeline.promises(), {}, ros::Time::now(), pipeline.fixedFrame()));
}

void CollisionMonitor::Impl::publishEffects(const ros::Time& stamp) {
  EffectTracker& effects = pipeline.effects();
  if (effects.takeNewPlan()) {
    outputs.publishEffects(effects.message(stamp, pipeline.fixedFrame()));
    plan_unsaid = true;
  }
}

/// Takes a quarter of a millisecond: after a step, not before it. The first step tells most of what decides, and after
/// that there is little news.
void CollisionMonitor::Impl::logEffects() {
  if (!plan_unsaid || log.isStarting() || !log.isDue("effects")) return;
  plan_unsaid = false;
  std::vector<std::string> lines = pipeline.effects().lines();
  for (const std::string& line : lines) {
    if (std::find(said_effects.begin(), said_effects.end(), line) == said_effects.end()) ROS_INFO_STREAM(line);
  }
  said_effects = std::move(lines);
}

void CollisionMonitor::Impl::predict(Outcome& outcome) {
  if (!(config.monitor.look_ahead_s > 0) || !outputs.wantsPrediction()) return;
  // Nothing to go on from, which whoever listens to predictions alone must hear, too.
  if (!outcome.answered) return publishPrediction(outcome);
  Outcome prediction;
  try {
    prediction = pipeline.monitor().predict();
  } catch (const std::exception& error) {
    prediction.status = StepStatus::INTERNAL_ERROR;
    prediction.reason = error.what();
    prediction.start_ns = prediction.stamp_ns = outcome.stamp_ns;
  }
  outcome.stats[Effect::LOOK_AHEAD] = lookAheadStats(prediction);
  publishPrediction(prediction);
}

void CollisionMonitor::Impl::publishPrediction(const Outcome& prediction) {
  const double horizon_s = config.monitor.look_ahead_s;
  outputs.publishPrediction(prediction, horizon_s, pipeline.monitor().bodies(), config.markers, pipeline.fixedFrame());
}

/// Whatever a command throws, the node goes on; a service's caller has been told by then (InputQueue::call).
void CollisionMonitor::Impl::carryOut(const std::function<void()>& command) {
  try {
    command();
  } catch (const std::exception& error) {
    log.alarm("command", std::string("a command failed: ") + error.what());
  }
}

/// Whatever fails, above all for want of memory, the node goes on; but what was said before is void.
void CollisionMonitor::Impl::work() {
  bool more = false;
  while (!stopping) {
    const bool waits = pipeline.waiting() || waitsForMap();
    const auto commands = queue.wait(more ? microseconds(0) : waits ? POLL : SLEEP);
    if (stopping) return;
    try {
      more = workOn(commands);
    } catch (const std::exception& error) {
      more = false;
      state.takeBack(std::string("a fault of the monitor: ") + error.what());
      log.complain(config.monitor.clock_body, "worker", std::string("a fault of the monitor: ") + error.what());
    }
  }
}

/// True when more can be done at once.
bool CollisionMonitor::Impl::workOn(const std::vector<std::function<void()>>& commands) {
  for (const auto& command : commands) carryOut(command);
  if (!commands.empty()) publishVoided();
  if (const Outcome* const outcome = pipeline.reconsider()) {
    state.tellSpeed(*outcome, pipeline.speedScale(*outcome));
    publishAhead(*outcome);
  }
  if (map_publisher_seen) pipeline.expectMap();
  pipeline.effects().hearPredictions(outputs.wantsPrediction());
  pipeline.effects().hearDistances(outputs.wantsDistances(), outputs.wantsMarkers());
  publishEffects(ros::Time::now());  // the first plan comes before the first frame
  takeMaps();
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    MeshMessage message;
    if (mayTake(b) && queue.pop(b, message)) pipeline.take(b, message);
  }
  if (maps) maps->setFixedFrame(pipeline.fixedFrame());
  accountDropped();
  tellStaticFrames();
  Outcome outcome;
  while (!stopping && pipeline.nextOutcome(waiting_clock.now(), outcome)) {
    if (!pipeline.isResting()) publishOutcome(outcome);
  }
  state.mapSettled(pipeline.settledMapNs(), pipeline.placedMapNs());
  tellProblems();
  const std::string surprise = recorder.takeSurprise();
  if (!surprise.empty()) log.alarm("surprise", surprise);
  bool more = false;
  for (std::size_t b = 0; b < config.bodies.size(); ++b) more |= mayTake(b);
  logEffects();
  lookIntoSilence();
  const std::int64_t now_ns = steadyNs();
  if (diagnostics.isDue(now_ns)) {
    const std::string map = pipeline.effects().mapExpected() ? log.mapSource() : "";
    diagnostics_publisher.publish(diagnostics.take(now_ns, ros::Time::now(), statsContext(), enabled, map, log.hint()));
  }
  return more;
}

}  // namespace dccd
