#include "node/collision_monitor_impl.h"

#include <algorithm>
#include <cctype>
#include <cstdlib>
#include <utility>

#include <std_msgs/Bool.h>
#include <tf2_msgs/TFMessage.h>

#include "input/known_types.h"
#include "input/message_bytes.h"
#include "node/robot_source.h"

namespace dccd {
namespace {

using topic_tools::ShapeShifter;

// Of the second in which the process is to end.
constexpr std::chrono::milliseconds END_AFTER{700};

/// `~state` and `~clear` of a node that cannot begin yet: until StateReporter publishes them.
class EarlyState {
 public:
  explicit EarlyState(const ros::NodeHandle& private_node) : node_(private_node) {}
  void say(const std::string& reason) {
    if (!state_) {
      state_ = node_.advertise<deformable_ccd::State>("state", TOPIC_QUEUE, true);
      clear_ = node_.advertise<std_msgs::Bool>("clear", TOPIC_QUEUE, true);
    }
    Statement statement;
    statement.assurance.missing.push_back(reason);
    deformable_ccd::State message = toState(Outcome(), "");
    fillState(statement, message);
    message.header.stamp = ros::Time::now();
    clear_.publish(std_msgs::Bool());
    state_.publish(message);
  }

 private:
  ros::NodeHandle node_;
  ros::Publisher state_, clear_;
};

MonitorConfig configOf(const ros::NodeHandle& node, const ros::NodeHandle& private_node,
                       const std::function<bool()>& goes_on, EarlyState&& early) {
  XmlRpc::XmlRpcValue tree;
  private_node.getParam(private_node.getNamespace(), tree);
  MonitorConfig config =
      readConfig(tree, "~", robotOfParameters(node, goes_on, [&](const std::string& what) { early.say(what); }));
  for (const std::string& sentence : config.robot.missing) ROS_WARN_STREAM(sentence);
  for (const std::string& sentence : config.robot.hints) ROS_WARN_STREAM("robot: " << sentence);
  takeRemappings(node, config);
  limitLive(config);
  config.monitor.own_voxels_beside = config.takesClouds();  // there is always a map on its way: no step waits for one
  return config;
}

}  // namespace

LivenessLimits livenessLimits(const MonitorConfig& config) {
  return {config.answer_timeout_s, config.monitor.store.max_step_s, config.monitor.octomap_timeout_s,
          config.takesClouds()};
}

CollisionMonitor::Impl::Impl(const ros::NodeHandle& node_handle, const ros::NodeHandle& private_handle,
                             MonitorConfig given)
    : node(node_handle),
      private_node(private_handle),
      pipeline(given, feed, mapSourceOf(node, given)),
      config(pipeline.config()),
      recorder(config, pipeline.monitor(), private_node.getNamespace()),
      outputs(private_node, config),
      state(private_node, livenessLimits(config), config.speed_law),
      queue(config.bodies.size(), config.queue_size, config.queue_policy, config.max_queue_bytes),
      diagnostics(private_node.getNamespace()),
      diagnostics_publisher(node.advertise<diagnostic_msgs::DiagnosticArray>(DIAGNOSTICS_TOPIC, 10)),
      log(node, private_node.getNamespace(), config),
      disabled_frames(config.bodies.size()),
      mesh_drops(config.bodies.size()),
      mesh_lacks(config.bodies.size()) {
  // Of a static body the newest frame alone counts.
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    if (pipeline.isStatic(b)) queue.keepNewest(b);
  }
}

// --- input thread ----------------------------------------------------------------------------------------------------

/// Of a static body the newest frame alone counts: that it is there is said before anything can go wrong with it.
void CollisionMonitor::Impl::onMeshNumber(std::size_t body, std::uint64_t number) {
  if (pipeline.isStatic(body)) return state.staticCame(config.bodies[body].body.name, number);
  if (mesh_drops[body].mayLack(input_callbacks)) ++mesh_lacks[body];
}

void CollisionMonitor::Impl::onMesh(std::size_t body, MeshMessage message) {
  const std::int64_t now_ns = steadyNs();
  frames_handed_over += message.object.type && message.sender == ros::this_node::getName();
  message.number += mesh_lacks[body];  // numbers that are missing
  // A static body's newest frame holds at all times, also those to come: it may be the only one that is ever sent. Own
  // voxels are followed by where the bodies were.
  if (!enabled && !pipeline.isStatic(body) && !config.ownsVoxels()) {
    ++disabled_frames[body];
    return;
  }
  if (body == config.monitor.clock_body && enabled) state.frameCame(now_ns);
  message.receipt_ns = static_cast<StampNs>(ros::Time::now().toNSec());
  message.arrival_ns = now_ns;
  message.since_ns = waiting_clock.now();
  queue.push(body, std::move(message));
}

void CollisionMonitor::Impl::onTransforms(const ros::MessageEvent<RawMessage>& event, bool is_static) try {
  if (tf_drops[is_static].mayLack(input_callbacks)) feed.lose(is_static);
  const auto message = feed.read(is_static ? "/tf_static" : "/tf", std::move(event.getMessage()->bytes));
  const auto arrival_ns = static_cast<StampNs>(ros::Time::now().toNSec());
  if (message) feed.add(*message, is_static, event.getPublisherName(), arrival_ns);
  for (const std::string& line : feed.takeProblems()) ROS_WARN_STREAM((is_static ? "/tf_static: " : "/tf: ") << line);
} catch (const std::exception& error) {
  feed.lose(is_static);
  tellLost(is_static ? "/tf_static" : "/tf", error);
}

/// A trajectory of joints, or a twist of a frame.
void CollisionMonitor::Impl::onIntended(const ShapeShifter::ConstPtr& message) try {
  queue.command([this, intend = pipeline.intention(*message)] {
    const std::string problem = intend();
    if (!problem.empty()) complainOfIntended(problem);
  });
} catch (const std::exception& error) {
  tellLost(private_node.resolveName("intended"), error);
}

void CollisionMonitor::Impl::complainOfIntended(const std::string& problem) {
  log.complain("intended " + IntendedMotion::kindOf(problem), private_node.resolveName("intended"), problem);
}

void CollisionMonitor::Impl::onMap(std::size_t source, const ros::MessageEvent<RawMessage>& event) try {
  RawMessage& message = *event.getMessage();
  queue.command(
      [this, topic = config.liveMapNames()[source], sender = event.getPublisherName(),
       frame_id = config.takesClouds() ? frameIdOf(message.bytes) : ""] { pipeline.hearMap(topic, frame_id, sender); });
  const std::int64_t now_ns = steadyNs();
  state.mapCame(now_ns);
  if (map_drops.mayLack(map_callbacks)) maps->lose(source);
  map_publisher_seen = true;
  const auto receipt_ns = static_cast<StampNs>(ros::Time::now().toNSec());
  const auto refuse = [&](const std::string& problem) { maps->refuse(source, problem, receipt_ns, now_ns); };
  const std::size_t size = message.bytes.size();
  const std::string problem = mapMessageProblem(message.datatype, message.md5, size, config);
  if (!problem.empty()) return refuse(problem);
  if (!hasMemoryFor(size)) return refuse("there is not enough memory for a map of " + std::to_string(size) + " bytes");
  if (needsCameraInfo(message.datatype)) listenToCameraInfo(source);
  maps->submit({source, std::move(message.datatype), std::move(message.bytes), receipt_ns}, now_ns);
} catch (const std::exception& error) {
  maps->lose(source);
  tellLost(config.liveMapNames()[source], error);
}

/// From the first picture on: clouds need none.
void CollisionMonitor::Impl::listenToCameraInfo(std::size_t source) {
  if (camera_info_subscribers.count(source) > 0) return;
  const std::string topic = cameraInfoTopic(config.clouds[source]);
  ros::NodeHandle input(node);
  input.setCallbackQueue(&input_callbacks);
  camera_info_subscribers[source] = input.subscribe<ShapeShifter>(
      topic, SUBSCRIBER_QUEUE, [this, source, topic](const ShapeShifter::ConstPtr& message) {
        try {
          const std::string why_void = maps->setCameraInfo(
              source, cameraInfoProblem(message->getDataType(), message->getMD5Sum()), bytesOf(*message));
          if (why_void.empty()) return;
          const std::int64_t now_ns = steadyNs();
          state.mapCame(now_ns);
          maps->refuse(source, why_void, static_cast<StampNs>(ros::Time::now().toNSec()), now_ns);
        } catch (const std::exception& error) {
          tellLost(topic, error);
        }
      });
}

void CollisionMonitor::Impl::subscribe() {
  ros::NodeHandle input(node);
  input.setCallbackQueue(&input_callbacks);
  mesh_subscriptions.resize(config.bodies.size());
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    if (config.bodies[b].isRigid()) continue;
    const BodyConfig& body = config.bodies[b];
    mesh_subscriptions[b] = std::make_unique<MeshSubscription>(
        input, body.topic, owns_process ? nullptr : findMeshTypeNamed(body.input.type),
        [this, b](std::uint64_t number) { onMeshNumber(b, number); },
        [this, b](MeshMessage message) { onMesh(b, std::move(message)); });
  }
  const auto listenTo = [&](const std::string& topic, bool is_static) {
    ros::SubscribeOptions options;
    using Event = const ros::MessageEvent<RawMessage>&;
    options.initByFullCallbackType<Event>(topic, SUBSCRIBER_QUEUE,
                                          [this, is_static](Event event) { onTransforms(event, is_static); });
    options.md5sum = ros::message_traits::md5sum<tf2_msgs::TFMessage>();
    options.datatype = ros::message_traits::datatype<tf2_msgs::TFMessage>();
    options.transport_hints = ros::TransportHints().tcpNoDelay();
    return input.subscribe(options);
  };
  if (config.intent) {
    ros::NodeHandle motion(private_node);
    motion.setCallbackQueue(&input_callbacks);
    intended_subscriber = motion.subscribe<ShapeShifter>(
        "intended", SUBSCRIBER_QUEUE, [this](const ShapeShifter::ConstPtr& message) { onIntended(message); });
  }
  tf_subscriber = listenTo("/tf", false);
  tf_static_subscriber = listenTo("/tf_static", true);
  ROS_INFO_STREAM("listens to " << inputsOf(node, config) << "; publishes under " << private_node.getNamespace());
  if (!pipeline.effects().mayUseMap()) return;
  maps = std::make_unique<MapLoader>(config, feed, [this] { queue.wake(); });
  if (config.takesMapFileAlone()) return maps->submitFile(config.octomap_file, steadyNs());
  if (!config.octomap_file.empty()) pipeline.setMap(loadMapFile(config.octomap_file, config), waiting_clock.now());
  for (const std::string& topic : config.liveMapNames()) {
    const std::size_t source = map_subscribers.size();
    ros::SubscribeOptions options;  // for messages that nobody else holds, so that their bytes can go on
    options.initByFullCallbackType<const ros::MessageEvent<RawMessage>&>(
        topic, MAP_QUEUE, [this, source](const ros::MessageEvent<RawMessage>& event) { onMap(source, event); });
    options.callback_queue = &map_callbacks;
    map_subscribers.push_back(input.subscribe(options));
  }
}

// --- start and stop --------------------------------------------------------------------------------------------------

void CollisionMonitor::Impl::start() {
  subscribe();
  ros::NodeHandle service(private_node);
  service.setCallbackQueue(&service_callbacks);
  advertiseServices(service);
  advertiseExpectations(service);
  advertiseObjects(service);
  listenToChanges(service);
  master = std::make_unique<MasterWatch>(
      mesh_subscriptions, map_subscribers, [this] { queue.wake(); }, [this] { map_publisher_seen = true; });
  master->watchParameters(config.robot.parameters, [this](const std::vector<std::string>& changed) {
    queue.command([this, changed] {
      for (const std::string& sentence : pipeline.robotChanged(changed))
        log.complain(config.monitor.clock_body, "robot", sentence);
    });
  });
  master->start();
  worker = std::thread([this] { work(); });
  input_spinner.start();
  map_spinner.start();
  service_spinner.start();
}

void CollisionMonitor::Impl::stop() {
  state.stop();
  stopping = true;
  if (owns_process) endInTime();
  pipeline.monitor().cancel();
  input_spinner.stop();
  map_spinner.stop();
  queue.wake();
  if (worker.joinable()) worker.join();
  queue.close();  // before the service thread is waited for: it may itself wait for a command
  service_spinner.stop();
  reconfigure.reset();
  maps.reset();
  master.reset();
}

/// What is left is to leave: the last state has been said. A map that is decoded, a start state that is looked for or a
/// master that hangs must not hold the process up; a file that is written may.
void CollisionMonitor::Impl::endInTime() {
  std::thread([] {
    std::this_thread::sleep_for(END_AFTER);
    for (int i = 0; i < 100 && FlightRecorder::filesUnderWay() > 0; ++i) std::this_thread::sleep_for(END_AFTER / 5);
    std::_Exit(0);
  }).detach();
}

CollisionMonitor::CollisionMonitor(const ros::NodeHandle& node, const ros::NodeHandle& private_node, Process process,
                                   const std::function<bool()>& goes_on)
    // The early state lives until the whole is made: its topics stay.
    : impl_(
          std::make_unique<Impl>(node, private_node, configOf(node, private_node, goes_on, EarlyState(private_node)))) {
  impl_->owns_process = process == Process::OWN;
  impl_->start();
}

CollisionMonitor::~CollisionMonitor() { impl_->stop(); }

}  // namespace dccd
