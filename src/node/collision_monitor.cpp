#include "node/collision_monitor_impl.h"

#include <cstdlib>

#include <deformable_ccd/AttachObject.h>
#include <deformable_ccd/DetachObject.h>
#include <deformable_ccd/RemoveObject.h>
#include <deformable_ccd/SetHold.h>
#include <deformable_ccd/SetPhase.h>
#include <std_msgs/Bool.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_msgs/TFMessage.h>

#include "dccd/simd_target.h"
#include "input/message_bytes.h"
#include "input/short_text.h"
#include "node/robot_source.h"

namespace dccd {
namespace {

using topic_tools::ShapeShifter;

constexpr std::uint32_t SUBSCRIBER_QUEUE = 256;
constexpr double SERVICE_TIMEOUT_S = 10;
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
    Assurance assurance;
    assurance.missing.push_back(reason);
    deformable_ccd::State message = toState(Outcome(), "");
    fillState(assurance, "", "", message);
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
  for (const std::string& sentence : config.robot.remarks) ROS_WARN_STREAM("robot: " << sentence);
  takeRemappings(node, config);
  limitLive(config);
  // It is the process's: another nodelet may have named one, and its worker may be at it.
  if (config.simd_target != "auto") setSimdTarget(config.simd_target);
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
      look_ahead(config.monitor.look_ahead_s, LOOK_AHEAD_SAMPLES),
      disabled_frames(config.bodies.size()) {
  // Of a static body the newest frame alone counts.
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    if (pipeline.isStatic(b)) queue.keepNewest(b);
  }
}

// --- input thread ----------------------------------------------------------------------------------------------------

void CollisionMonitor::Impl::onMesh(std::size_t body, MeshMessage message) {
  const std::int64_t now_ns = steadyNs();
  frames_handed_over += message.object.type != nullptr;
  // A static body's newest frame holds at all times, also those to come: it may be the only one that is ever sent.
  if (!enabled && !pipeline.isStatic(body)) {
    ++disabled_frames[body];
    return;
  }
  if (body == config.monitor.clock_body) state.frameCame(now_ns);
  message.receipt_ns = static_cast<StampNs>(ros::Time::now().toNSec());
  message.arrival_ns = now_ns;
  queue.push(body, std::move(message));
  if (pipeline.isStatic(body)) state.staticCame(config.bodies[body].body.name);  // after it, as of a map
}

void CollisionMonitor::Impl::onTransforms(const tf2_msgs::TFMessage& message, bool is_static) try {
  feed.add(message, is_static);
  for (const std::string& line : feed.takeComplaints()) ROS_WARN_STREAM((is_static ? "/tf_static: " : "/tf: ") << line);
} catch (const std::exception& error) {
  tellLost(is_static ? "/tf_static" : "/tf", error);
}

void CollisionMonitor::Impl::onMap(const ShapeShifter::ConstPtr& message) try {
  map_publisher_seen = true;
  const std::int64_t now_ns = steadyNs();
  state.mapCame(now_ns);
  const std::string problem = mapMessageProblem(message->getDataType(), message->getMD5Sum(), message->size(), config);
  if (!problem.empty()) return maps->refuse(problem, now_ns);  // before its bytes are copied
  if (!hasMemoryFor(message->size())) {
    return maps->refuse("there is not enough memory for a map of " + std::to_string(message->size()) + " bytes",
                        now_ns);
  }
  maps->submit(bytesOf(*message), static_cast<StampNs>(ros::Time::now().toNSec()), now_ns);
} catch (const std::exception& error) {
  tellLost(config.liveMapName(), error);
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
  tf_subscriber = input.subscribe<tf2_msgs::TFMessage>(
      "/tf", SUBSCRIBER_QUEUE, [this](const tf2_msgs::TFMessageConstPtr& m) { onTransforms(*m, false); },
      ros::VoidConstPtr(), hints);
  tf_static_subscriber = input.subscribe<tf2_msgs::TFMessage>(
      "/tf_static", SUBSCRIBER_QUEUE, [this](const tf2_msgs::TFMessageConstPtr& m) { onTransforms(*m, true); });
  ROS_INFO_STREAM("listens to " << inputsOf(node, config) << "; publishes under " << private_node.getNamespace());
  if (!pipeline.effects().mayUseMap()) return;
  maps = std::make_unique<MapLoader>(config, feed, [this] { queue.wake(); });
  if (config.takesMapFileAlone()) return maps->submitFile(config.octomap_file, steadyNs());
  if (!config.octomap_file.empty()) pipeline.setMap(loadMapFile(config.octomap_file, config), steadyNs());
  map_subscriber =
      input.subscribe<ShapeShifter>(config.liveMapName(), 2, [this](const ShapeShifter::ConstPtr& m) { onMap(m); });
}

// --- service thread --------------------------------------------------------------------------------------------------

void CollisionMonitor::Impl::advertiseServices(ros::NodeHandle& service) {
  using Trigger = std_srvs::Trigger;
  using SetBool = std_srvs::SetBool;
  const auto answer = [this](const std::function<Reply()>& run, auto& response) {
    const Reply reply = queue.call(run, SERVICE_TIMEOUT_S);
    response.success = reply.success;
    response.message = reply.message;
    return true;
  };
  const auto advertise = [&](const char* name, const std::function<Reply()>& run) {
    services.push_back(service.advertiseService<Trigger::Request, Trigger::Response>(
        name, [answer, run](Trigger::Request&, Trigger::Response& response) { return answer(run, response); }));
  };
  advertise("check_now", [this] {
    const Outcome outcome = pipeline.checkNow();
    return Reply{outcome.answered, describe(outcome)};
  });
  advertise("record_step", [this] {
    Reply reply;
    reply.success = recorder.record(reply.message);
    return reply;
  });
  services.push_back(service.advertiseService<Trigger::Request, Trigger::Response>(
      "reset", [this, answer](Trigger::Request&, Trigger::Response& response) {
        state.asked("a reset was asked for");
        const auto run = [this] {
          resetNow(StepStatus::RESET);
          return Reply{true, "frames forgotten; the next one is a first frame"};
        };
        return answer(run, response);
      }));
  services.push_back(service.advertiseService<SetBool::Request, SetBool::Response>(
      "enable", [this, answer](SetBool::Request& request, SetBool::Response& response) {
        enabled = request.data;
        state.setEnabled(enabled);
        state.asked("~enable was called");
        const auto run = [this, on = request.data] {
          resetNow(StepStatus::DISABLED);
          return Reply{true, on ? "enabled" : "disabled; frames are counted and dropped, but for static bodies'"};
        };
        return answer(run, response);
      }));
}

/// What is expected, by the phase of the task and by what hands hold.
void CollisionMonitor::Impl::advertiseExpectations(ros::NodeHandle& service) {
  using deformable_ccd::SetHold;
  using deformable_ccd::SetPhase;
  const auto answer = [this](const std::function<void()>& set, auto& response) {
    const auto run = [this, set] {
      try {
        set();
      } catch (const ParameterError& error) {
        return Reply{false, error.what() + std::string("; in force is ") + pipeline.phaseInWords()};
      }
      return Reply{true, "from the next step on: " + pipeline.phaseInWords()};
    };
    const Reply reply = queue.call(run, SERVICE_TIMEOUT_S);
    response.success = reply.success;
    response.message = reply.message;
    return true;
  };
  services.push_back(service.advertiseService<SetPhase::Request, SetPhase::Response>(
      "set_phase", [this, answer](SetPhase::Request& request, SetPhase::Response& response) {
        return answer([this, phase = request.phase] { pipeline.setPhase(phase); }, response);
      }));
  services.push_back(service.advertiseService<SetHold::Request, SetHold::Response>(
      "set_hold", [this, answer](SetHold::Request& request, SetHold::Response& response) {
        return answer([this, request] { pipeline.setHold(request.body, request.by, request.holds); }, response);
      }));
}

void CollisionMonitor::Impl::advertiseObjects(ros::NodeHandle& service) {
  using deformable_ccd::AttachObject;
  using deformable_ccd::DetachObject;
  using deformable_ccd::RemoveObject;
  // What is refused is counted, be it on this thread, where meshes are read, or on the worker's.
  const auto answer = [this](const std::string& done, const std::function<std::function<void()>()>& read,
                             auto& response) {
    Reply reply;
    try {
      const std::function<void()> change = read();
      reply = queue.call([change, done] { return change(), Reply{true, done}; }, SERVICE_TIMEOUT_S);
    } catch (const std::exception& error) {
      reply.message = error.what();
    }
    requests_refused += !reply.success;
    response.success = reply.success;
    response.message = shortText(reply.message);
    return true;
  };
  services.push_back(service.advertiseService<AttachObject::Request, AttachObject::Response>(
      "attach", [this, answer](AttachObject::Request& request, AttachObject::Response& response) {
        const auto read = [&] {
          return [this, object = readAttach(request, config)] {
            pipeline.attach(object);
            state.takeBack("no step has been answered since '" + object.name + "' was attached");
          };
        };
        return answer("from the next step on '" + request.name + "' moves with " + request.link, read, response);
      }));
  services.push_back(service.advertiseService<DetachObject::Request, DetachObject::Response>(
      "detach", [this, answer](DetachObject::Request& request, DetachObject::Response& response) {
        const auto read = [&] { return [this, name = request.name] { pipeline.detach(name); }; };
        return answer("from the next step on '" + request.name + "' stays where it is", read, response);
      }));
  services.push_back(service.advertiseService<RemoveObject::Request, RemoveObject::Response>(
      "remove", [this, answer](RemoveObject::Request& request, RemoveObject::Response& response) {
        const auto read = [&] { return [this, name = request.name] { pipeline.remove(name); }; };
        return answer("'" + request.name + "' is forgotten", read, response);
      }));
}

void CollisionMonitor::Impl::listenToChanges(const ros::NodeHandle& service) {
  Reconfigure::Events events;
  events.change = [this](const Reconfigure::Change& change) -> std::string {
    // Nobody knows what a worker will say that is busy for too long: then it is not to do it any more.
    const auto is_wanted = std::make_shared<std::atomic<bool>>(true);
    const auto run = [this, change, is_wanted] {
      if (!*is_wanted) return Reply{};
      pipeline.reconfigure(change);
      state.setLimits(livenessLimits(config));
      return Reply{true, ""};
    };
    const Reply reply = queue.call(run, SERVICE_TIMEOUT_S);
    *is_wanted = false;
    return reply.success ? "" : reply.message;
  };
  events.refused = [this](const std::string& why) {
    queue.command([this, why] { log.complain(config.monitor.clock_body, "live", why); });
  };
  reconfigure = std::make_unique<Reconfigure>(service, config, std::move(events));
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
      mesh_subscriptions, map_subscriber, [this] { queue.wake(); }, [this] { map_publisher_seen = true; });
  master->watchParameters(config.robot.parameters, [this](const std::vector<std::string>& changed) {
    queue.command([this, changed] {
      for (const std::string& sentence : pipeline.robotChanged(changed))
        log.complain(config.monitor.clock_body, "robot", sentence);
      if (!changed.empty()) state.takeBack("the robot's description has changed");
    });
  });
  master->start();
  worker = std::thread([this] { work(); });
  input_spinner.start();
  service_spinner.start();
}

void CollisionMonitor::Impl::stop() {
  state.stop();
  stopping = true;
  if (owns_process) endInTime();
  pipeline.monitor().cancel();
  input_spinner.stop();
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

CollisionMonitor::CollisionMonitor(const ros::NodeHandle& node, const ros::NodeHandle& private_node,
                                   const std::function<bool()>& goes_on)
    // The early state lives until the whole is made: its topics stay.
    : impl_(
          std::make_unique<Impl>(node, private_node, configOf(node, private_node, goes_on, EarlyState(private_node)))) {
  impl_->start();
}

CollisionMonitor::~CollisionMonitor() { impl_->stop(); }

void CollisionMonitor::takeProcess() {
  impl_->owns_process = true;
  try {
    impl_->recorder.installCrashHandler();
  } catch (const std::runtime_error& error) {
    ROS_WARN_STREAM("a crash will not be recorded: " << error.what());
  }
}

}  // namespace dccd
