#include "ros/outputs.h"

#include "ros/collision_monitor.h"

#include <atomic>
#include <chrono>
#include <thread>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>
#include <topic_tools/shape_shifter.h>

#include "deformable_ccd/simd_target.h"
#include "ros/advice.h"
#include "ros/diagnostics.h"
#include "ros/effects.h"
#include "ros/input_queue.h"
#include "ros/known_types.h"
#include "ros/map_loader.h"
#include "ros/monitor_log.h"
#include "ros/monitor_pipeline.h"
#include "ros/reconfigure.h"
#include "ros/step_recorder.h"
#include "ros/transforms.h"

namespace deformable_ccd {

namespace {

using topic_tools::ShapeShifter;
using std::chrono::microseconds;

// While something waits for tf or another body the worker looks again this often; else it sleeps until it is woken, and
// this long at most, for diagnostics.
constexpr microseconds POLL{2000}, SLEEP{100000};
constexpr std::uint32_t SUBSCRIBER_QUEUE = 256;
constexpr double SERVICE_TIMEOUT_S = 10;
const ros::WallDuration RENEWAL(0.05);

std::int64_t steadyNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

std::vector<std::uint8_t> bytesOf(const ShapeShifter& message) {
  std::vector<std::uint8_t> bytes(message.size());
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  message.write(stream);
  return bytes;
}

MonitorConfig configOf(const ros::NodeHandle& private_node) {
  XmlRpc::XmlRpcValue tree;
  private_node.getParam(private_node.getNamespace(), tree);
  MonitorConfig config = readConfig(tree);
  setSimdTarget(config.simd_target);
  return config;
}

}  // namespace

struct CollisionMonitor::Impl {
  ros::NodeHandle node, private_node;
  MonitorConfig config;
  tf2::BufferCore transforms;
  TransformFeed feed{transforms};
  MonitorPipeline pipeline;
  StepRecorder recorder;
  Outputs outputs;
  InputQueue queue;
  Diagnostics diagnostics;
  MonitorLog log;
  EffectTracker effects;
  LookAheadScore look_ahead;
  std::unique_ptr<MapLoader> maps;

  ros::CallbackQueue input_callbacks, service_callbacks;
  ros::AsyncSpinner input_spinner{1, &input_callbacks}, service_spinner{1, &service_callbacks};
  std::vector<std::unique_ptr<MeshSubscription>> mesh_subscriptions;  // one a body; none for rigid ones
  ros::SteadyTimer renewal;
  ros::Subscriber map_subscriber, tf_subscriber, tf_static_subscriber;
  std::vector<ros::ServiceServer> services;
  std::unique_ptr<Reconfigure> reconfigure;
  std::atomic<bool> stopping{false}, enabled{true}, map_publisher_seen{false};
  std::atomic<std::uint64_t> frames_handed_over{0};
  std::thread worker;
  StampNs newest_ns = 0;  // stamp of the last outcome; the worker's
  std::uint64_t steps_unpublished = 0;  // the worker's, too

  Impl(const ros::NodeHandle& n, const ros::NodeHandle& p)
      : node(n),
        private_node(p),
        config(configOf(p)),
        pipeline(config, transforms),
        recorder(config, pipeline.monitor()),
        outputs(private_node, config.monitor.look_ahead_s > 0, config.holdsDistance()),
        queue(config.bodies.size(), config.queue_size, config.queue_policy),
        diagnostics(private_node.getNamespace(), node),
        log(node, private_node.getNamespace(), config),
        effects(config, log.mapSource()),
        look_ahead(config.monitor.look_ahead_s, LOOK_AHEAD_SAMPLES) {}

  void start();
  void stop();

  // Input thread.
  void subscribe();
  void onMesh(std::size_t body, MeshMessage message);
  void onMap(const ShapeShifter::ConstPtr& message);

  // Service thread.
  void advertiseServices();
  void reconfigureNow(MonitorOptions options, const MarkerConfig& markers);

  // Worker.
  void work();
  void run(const std::function<void()>& command);
  void takeMaps();
  void takeMessage(std::size_t body, const QueuedMessage& queued);
  void takeMessages();
  void tellComplaints();
  void publish(StepOutcome& outcome);
  void publishAll(StepOutcome& outcome);
  void predict(StepOutcome& outcome);
  void publishPrediction(const StepOutcome& prediction);
  void publishEffects(const ros::Time& stamp);
  void accountDropped();
  void lookIntoSilence();
  void resetNow(StepStatus status);
  StatsContext statsContext() const;
};

// --- input thread ----------------------------------------------------------------------------------------------------

void CollisionMonitor::Impl::onMesh(std::size_t body, MeshMessage message) {
  const std::int64_t now_ns = steadyNs();
  frames_handed_over += std::holds_alternative<TypedMesh>(message);
  // A static body's newest frame holds at all times, also those to come: it may be the only one that is ever sent.
  if (!enabled && !pipeline.isStatic(body)) {
    queue.command([this, body] {
      pipeline.monitor().countReceived(body);
      pipeline.monitor().countDropped(body, StepStatus::DISABLED);
    });
    return;
  }
  queue.push(body, {std::move(message), static_cast<StampNs>(ros::Time::now().toNSec()), now_ns});
}

void CollisionMonitor::Impl::onMap(const ShapeShifter::ConstPtr& message) {
  map_publisher_seen = true;
  const std::string problem = mapTypeProblem(message->getDataType(), message->getMD5Sum());
  if (!problem.empty()) {
    maps->countRefused();
    queue.command([this, problem] { log.complain(config.bodies.size(), "map type", problem); });
    return;
  }
  if (message->size() > config.max_map_bytes) {
    maps->countRefused();
    queue.command([this, size = message->size()] {
      log.complain(config.bodies.size(), "map size",
               "octomap of " + std::to_string(size) + " bytes is more than max_map_mb and was refused");
      LoadedMap refused;
      refused.problem = "the octomap is larger than max_map_mb";
      pipeline.setMap(std::move(refused), steadyNs());
    });
    return;
  }
  maps->submit(bytesOf(*message), static_cast<StampNs>(ros::Time::now().toNSec()));
}

void CollisionMonitor::Impl::subscribe() {
  ros::NodeHandle input(node);
  input.setCallbackQueue(&input_callbacks);
  const ros::TransportHints hints = ros::TransportHints().tcpNoDelay();
  mesh_subscriptions.resize(config.bodies.size());
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    if (config.bodies[b].isRigid()) continue;
    mesh_subscriptions[b] = std::make_unique<MeshSubscription>(
        input, config.bodies[b].topic, [this, b](MeshMessage message) { onMesh(b, std::move(message)); });
  }
  renewal = input.createSteadyTimer(RENEWAL, [this](const ros::SteadyTimerEvent&) {
    for (const auto& subscription : mesh_subscriptions) {
      if (subscription) subscription->renew();
    }
  });
  tf_subscriber = input.subscribe<tf2_msgs::TFMessage>(
      "/tf", SUBSCRIBER_QUEUE, [this](const tf2_msgs::TFMessageConstPtr& m) { feed.add(*m, false); },
      ros::VoidConstPtr(), hints);
  tf_static_subscriber = input.subscribe<tf2_msgs::TFMessage>(
      "/tf_static", SUBSCRIBER_QUEUE, [this](const tf2_msgs::TFMessageConstPtr& m) { feed.add(*m, true); });
  if (!effects.mayUseMap()) return;
  maps = std::make_unique<MapLoader>(config, [this] { queue.wake(); });
  if (!config.octomap_file.empty()) {
    maps->submitFile(config.octomap_file);
  } else {
    map_subscriber = input.subscribe<ShapeShifter>(config.octomap_topic, 2,
                                                   [this](const ShapeShifter::ConstPtr& m) { onMap(m); });
  }
}

// --- service thread --------------------------------------------------------------------------------------------------

void CollisionMonitor::Impl::advertiseServices() {
  using Trigger = std_srvs::Trigger;
  using SetBool = std_srvs::SetBool;
  ros::NodeHandle service(private_node);
  service.setCallbackQueue(&service_callbacks);
  const auto advertise = [&](const char* name, const std::function<Reply()>& run) {
    services.push_back(service.advertiseService<Trigger::Request, Trigger::Response>(
        name, [this, run](Trigger::Request&, Trigger::Response& response) {
          const Reply reply = queue.call(run, SERVICE_TIMEOUT_S);
          response.success = reply.success;
          response.message = reply.message;
          return true;
        }));
  };
  advertise("reset", [this] {
    resetNow(StepStatus::RESET);
    return Reply{true, "frames forgotten; the next one is a first frame"};
  });
  advertise("check_now", [this] {
    const StepOutcome outcome = pipeline.checkNow();
    return Reply{outcome.answered, describe(outcome)};
  });
  advertise("record_step", [this] {
    Reply reply;
    reply.success = recorder.record(reply.message);
    return reply;
  });
  services.push_back(service.advertiseService<SetBool::Request, SetBool::Response>(
      "enable", [this](SetBool::Request& request, SetBool::Response& response) {
        enabled = request.data;
        const auto run = [this, on = request.data] {
          resetNow(StepStatus::DISABLED);
          return Reply{true, on ? "enabled" : "disabled; frames are counted and dropped, but for static bodies'"};
        };
        const Reply reply = queue.call(run, SERVICE_TIMEOUT_S);
        response.success = reply.success;
        response.message = reply.message;
        return true;
      }));
  reconfigure = std::make_unique<Reconfigure>(
      service, config, [this](const MonitorOptions& options, const MarkerConfig& markers) {
        queue.command([this, options, markers] { reconfigureNow(options, markers); });
      });
}

// --- worker ----------------------------------------------------------------------------------------------------------

void CollisionMonitor::Impl::reconfigureNow(MonitorOptions options, const MarkerConfig& markers) {
  config.markers = markers;
  // What the effect plan decides stays with it.
  options.obstacle_expected = pipeline.monitor().options().obstacle_expected;
  options.detector.check_start_state = pipeline.monitor().options().detector.check_start_state;
  try {
    pipeline.monitor().setOptions(options);
    config.monitor = options;
  } catch (const std::invalid_argument& error) {
    ROS_WARN_STREAM("reconfiguration refused: " << error.what());
  }
}

void CollisionMonitor::Impl::resetNow(StepStatus status) {
  accountDropped();
  std::vector<bool> spared(config.bodies.size());
  for (std::size_t b = 0; b < spared.size(); ++b) spared[b] = pipeline.isStatic(b);
  const auto cleared = queue.clear(spared);
  for (std::size_t b = 0; b < cleared.size(); ++b) {
    pipeline.monitor().countReceived(b, cleared[b]);
    pipeline.monitor().countDropped(b, status, cleared[b]);
  }
  pipeline.reset(status);
  outputs.publishNotClear(pipeline.fixedFrame());
  if (!outputs.wantsPrediction()) return;
  StepOutcome none;
  none.status = status;
  none.start_ns = none.stamp_ns = newest_ns;
  publishPrediction(none);
}

void CollisionMonitor::Impl::accountDropped() {
  const auto dropped = queue.takeDropped();
  for (std::size_t b = 0; b < dropped.size(); ++b) {
    if (dropped[b] == 0) continue;
    pipeline.monitor().countReceived(b, dropped[b]);
    pipeline.monitor().countDropped(b, StepStatus::QUEUE_FULL, dropped[b]);
    log.complain(b, "queue", std::to_string(dropped[b]) + " frames dropped, steps take longer than frames come; " +
                             adviceFor(StepStatus::QUEUE_FULL, {}, log.mapSource()));
  }
}

void CollisionMonitor::Impl::takeMaps() {
  LoadedMap map;
  if (!maps || !maps->take(map)) return;
  if (!map.surface) {
    log.complain(config.bodies.size(), "map", "refused: " + map.problem);
    map.problem = "the octomap was refused: " + map.problem;
  }
  map_publisher_seen = true;
  pipeline.setMap(std::move(map), steadyNs());
}

void CollisionMonitor::Impl::takeMessage(std::size_t body, const QueuedMessage& queued) {
  if (const auto* typed = std::get_if<TypedMesh>(&queued.message)) {
    return pipeline.take(body, *typed, queued.receipt_ns, queued.arrival_ns);
  }
  const ShapeShifter& message = *std::get<ShapeShifter::ConstPtr>(queued.message);
  const std::string problem = meshTypeProblem(message.getDataType(), message.getMD5Sum());
  if (problem.empty()) {
    pipeline.take(body, {message.getDataType(), bytesOf(message), queued.receipt_ns, queued.arrival_ns});
  } else {
    pipeline.refuse(body, queued.receipt_ns, queued.arrival_ns, problem);
  }
}

void CollisionMonitor::Impl::takeMessages() {
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    QueuedMessage queued;
    if (!pipeline.idle(b) || !queue.pop(b, queued)) continue;
    takeMessage(b, queued);
  }
}

void CollisionMonitor::Impl::tellComplaints() {
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    const std::string complaint = pipeline.takeComplaint(b);
    // The clock body's come as outcomes, which are logged when they are published.
    if (!complaint.empty() && b != config.monitor.clock_body) log.complain(b, "message", complaint);
  }
}

void CollisionMonitor::Impl::lookIntoSilence() {
  if (!log.isSilenceDue(steadyNs())) return;
  std::vector<AwaitedTopic> silent;
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    if (!mesh_subscriptions[b] || pipeline.monitor().counters(b).received > 0) continue;
    silent.push_back({log.topicOf(b), mesh_subscriptions[b]->getNumPublishers()});
  }
  log.hintAt(silent, pipeline);
}

StatsContext CollisionMonitor::Impl::statsContext() const {
  StatsContext context;
  context.frames = pipeline.monitor().total();
  context.weld_changes = pipeline.weldChanges();
  if (config.monitor.look_ahead_s > 0) context.look_ahead = look_ahead.summary();
  context.steps_unpublished = steps_unpublished;
  context.maps_received = maps ? maps->received() : 0;
  context.frames_handed_over = frames_handed_over;
  context.maps_refused = maps ? maps->refused() : 0;
  context.parameter_hash = config.hash();
  return context;
}

/// Whatever a step's messages throw, the node goes on; but nobody is to take what was said before for the whole answer.
void CollisionMonitor::Impl::publish(StepOutcome& outcome) {
  try {
    publishAll(outcome);
  } catch (const std::exception& error) {
    ++steps_unpublished;
    log.complain(config.monitor.clock_body, "publishing",
                 std::string("not all of a step's results could be published: ") + error.what());
    run([this] { outputs.publishNotClear(pipeline.fixedFrame()); });
  }
}

void CollisionMonitor::Impl::publishAll(StepOutcome& outcome) {
  const auto& bodies = pipeline.monitor().bodies();
  const std::string& frame = pipeline.fixedFrame();
  log.tell(outcome);
  newest_ns = outcome.stamp_ns;
  outputs.publishResult(outcome, bodies, frame);
  const double latency_s = static_cast<double>(steadyNs() - pipeline.arrivalOfOutcome()) * 1e-9;
  outputs.publishMarkers(outcome, bodies, config.markers, frame);
  effects.learn(outcome, pipeline.monitor());
  publishEffects(toRosTime(outcome.stamp_ns));
  if (effects.takeNewLeftOut(pipeline.monitor())) {
    outputs.publishLeftOut(toLeftOutPairs(pipeline.monitor().leftOut(), bodies, outcome.stamp_ns, frame));
  }
  predict(outcome);
  StatsContext context = statsContext();
  context.latency_s = latency_s;
  outputs.publishStats(outcome, context, frame);
  diagnostics.add(outcome, context);
}

void CollisionMonitor::Impl::publishEffects(const ros::Time& stamp) {
  if (!effects.takeNewPlan()) return;
  outputs.publishEffects(effects.message(stamp, pipeline.fixedFrame()));
  for (const std::string& line : effects.lines()) ROS_INFO_STREAM(line);
}

void CollisionMonitor::Impl::predict(StepOutcome& outcome) {
  if (!(config.monitor.look_ahead_s > 0) || !outputs.wantsPrediction()) return;
  look_ahead.observe(outcome);
  // Nothing to go on from, which whoever listens to predictions alone must hear, too.
  if (!outcome.answered) return publishPrediction(outcome);
  StepOutcome prediction;
  try {
    prediction = pipeline.monitor().predict();
  } catch (const std::exception& error) {
    prediction.status = StepStatus::INTERNAL_ERROR;
    prediction.reason = error.what();
    prediction.start_ns = prediction.stamp_ns = outcome.stamp_ns;
  }
  look_ahead.predict(prediction);
  outcome.stats[Effect::LOOK_AHEAD] = lookAheadStats(prediction);
  publishPrediction(prediction);
}

void CollisionMonitor::Impl::publishPrediction(const StepOutcome& prediction) {
  const double horizon_s = config.monitor.look_ahead_s;
  outputs.publishPrediction(prediction, horizon_s, pipeline.monitor().bodies(), pipeline.fixedFrame());
}

/// Whatever a command throws, the node goes on; a service's caller has been told by then (InputQueue::call).
void CollisionMonitor::Impl::run(const std::function<void()>& command) {
  try {
    command();
  } catch (const std::exception& error) {
    ROS_ERROR_STREAM("a command failed: " << error.what());
  }
}

void CollisionMonitor::Impl::work() {
  bool more = false;
  while (!stopping) {
    const auto commands = queue.wait(more ? microseconds(0) : pipeline.waiting() ? POLL : SLEEP);
    if (stopping) return;
    for (const auto& command : commands) run(command);
    if (map_subscriber && map_subscriber.getNumPublishers() > 0) map_publisher_seen = true;
    effects.apply(pipeline.monitor(), map_publisher_seen);
    publishEffects(ros::Time::now());  // the first plan comes before the first frame
    takeMaps();
    takeMessages();
    accountDropped();
    StepOutcome outcome;
    while (!stopping && pipeline.next(steadyNs(), outcome)) publish(outcome);
    tellComplaints();
    const std::string surprise = recorder.takeSurprise();
    if (!surprise.empty()) ROS_ERROR_STREAM(surprise);
    more = false;
    for (std::size_t b = 0; b < config.bodies.size(); ++b) more |= pipeline.idle(b) && queue.size(b) > 0;
    lookIntoSilence();
    diagnostics.publishWhenDue(steadyNs(), enabled, effects.mapExpected() ? log.mapSource() : "", log.hint());
  }
}

void CollisionMonitor::Impl::start() {
  subscribe();
  advertiseServices();
  worker = std::thread([this] { work(); });
  input_spinner.start();
  service_spinner.start();
}

void CollisionMonitor::Impl::stop() {
  stopping = true;
  renewal.stop();
  input_spinner.stop();
  queue.wake();
  if (worker.joinable()) worker.join();
  queue.close();  // before the service thread is waited for: it may itself wait for a command
  service_spinner.stop();
  reconfigure.reset();
  maps.reset();
}

CollisionMonitor::CollisionMonitor(const ros::NodeHandle& node, const ros::NodeHandle& private_node)
    : impl_(std::make_unique<Impl>(node, private_node)) {
  impl_->start();
}

CollisionMonitor::~CollisionMonitor() { impl_->stop(); }

void CollisionMonitor::installCrashHandler() {
  try {
    impl_->recorder.installCrashHandler();
  } catch (const std::runtime_error& error) {
    ROS_WARN_STREAM("a crash will not be recorded: " << error.what());
  }
}

}  // namespace deformable_ccd
