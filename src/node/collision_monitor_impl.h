// The node's inside. Callbacks of topics hand over to queues, services wait for the worker's answer, one thread asks
// the master, and the worker alone touches the pipeline and publishes. collision_monitor.cpp holds start, end and the
// input thread, monitor_services.cpp the thread of services, monitor_worker.cpp the worker.
#pragma once

#include "output/outputs.h"

#include <array>
#include <atomic>
#include <chrono>
#include <map>
#include <thread>

#include <ros/callback_queue.h>
#include <ros/ros.h>
#include <ros/spinner.h>
#include <topic_tools/shape_shifter.h>

#include "input/mesh_subscription.h"
#include "input/raw_message.h"
#include "input/steady_clock.h"
#include "input/transforms.h"
#include "input/watched_queue.h"
#include "node/collision_monitor.h"
#include "node/input_queue.h"
#include "node/map_loader.h"
#include "node/master_watch.h"
#include "node/monitor_log.h"
#include "node/monitor_pipeline.h"
#include "node/reconfigure.h"
#include "node/state_reporter.h"
#include "node/step_recorder.h"
#include "output/diagnostics.h"

namespace dccd {

LivenessLimits livenessLimits(const MonitorConfig& config);

struct CollisionMonitor::Impl {
  ros::NodeHandle node, private_node;
  TransformFeed feed;
  MonitorPipeline pipeline;
  // The pipeline's. The worker changes in it what can be changed live, which no other thread is to read.
  const MonitorConfig& config;
  StepRecorder recorder;
  Outputs outputs;
  StateReporter state;
  InputQueue queue;
  Diagnostics diagnostics;
  ros::Publisher diagnostics_publisher;
  MonitorLog log;
  std::unique_ptr<MapLoader> maps;

  static constexpr std::uint32_t MAP_QUEUE = 2;  // they are large

  WatchedQueue input_callbacks, map_callbacks{MAP_QUEUE};
  ros::CallbackQueue service_callbacks;
  ros::AsyncSpinner input_spinner{1, &input_callbacks}, map_spinner{1, &map_callbacks};
  ros::AsyncSpinner service_spinner{1, &service_callbacks};
  std::vector<std::unique_ptr<MeshSubscription>> mesh_subscriptions;  // one a body; none for rigid ones
  std::vector<ros::Subscriber> map_subscribers;                    // of the octomap, or one for each source of clouds
  std::map<std::size_t, ros::Subscriber> camera_info_subscribers;  // of depth pictures, by their source
  ros::Subscriber tf_subscriber, tf_static_subscriber, intended_subscriber;
  std::unique_ptr<MasterWatch> master;
  std::vector<ros::ServiceServer> services;
  std::unique_ptr<Reconfigure> reconfigure;
  bool owns_process = false;
  std::atomic<bool> stopping{false}, enabled{true}, map_publisher_seen{false};
  std::atomic<std::uint64_t> frames_handed_over{0}, requests_refused{0};
  std::thread worker;
  std::vector<std::atomic<std::uint64_t>> disabled_frames;  // that came while disabled, not yet counted
  // Of what roscpp may have dropped; the input thread's.
  std::vector<DropWatch> mesh_drops;
  std::array<DropWatch, 2> tf_drops;      // of /tf, of /tf_static
  DropWatch map_drops;                    // the maps' thread's; of clouds one that is dropped is in no map
  std::vector<std::uint64_t> mesh_lacks;  // by body, messages that are taken for missing
  bool plan_unsaid = false;               // the worker's
  std::vector<std::string> said_effects;  // in the log; the worker's
  StampNs newest_ns = 0;                  // stamp of the last outcome; the worker's
  std::uint64_t steps_unpublished = 0;    // the worker's, too

  /// What came of a body's topic by when; the worker's, as what follows.
  struct Heard {
    std::uint64_t frames = 0;
    std::int64_t at_ns = 0;
  };
  std::vector<Heard> heard;
  WatchClock silence_clock;
  WatchClock waiting_clock{true};  // of frames and maps that wait for others
  std::size_t fallen_silent = 0;   // topics that were heard before

  Impl(const ros::NodeHandle& node_handle, const ros::NodeHandle& private_handle, MonitorConfig given);

  void start();
  void stop();
  void endInTime();

  // Input thread.
  void subscribe();
  void onMeshNumber(std::size_t body, std::uint64_t number);
  void onMesh(std::size_t body, MeshMessage message);
  void onTransforms(const ros::MessageEvent<RawMessage>& event, bool is_static);
  void onIntended(const topic_tools::ShapeShifter::ConstPtr& message);
  void complainOfIntended(const std::string& problem);                         ///< the worker's
  void onMap(std::size_t source, const ros::MessageEvent<RawMessage>& event);  ///< of the maps' thread, as what follows
  void listenToCameraInfo(std::size_t source);

  // Service thread.
  Reply ask(const std::function<Reply()>& run);
  void advertiseServices(ros::NodeHandle& service);
  void advertiseExpectations(ros::NodeHandle& service);
  void advertiseObjects(ros::NodeHandle& service);
  void listenToChanges(const ros::NodeHandle& service);  ///< of live parameters

  // Worker.
  void work();
  bool workOn(const std::vector<std::function<void()>>& commands);
  void carryOut(const std::function<void()>& command);
  void takeMaps();
  bool waitsForMap();
  bool mayTake(std::size_t body);
  void tellStaticFrames();
  void tellProblems();
  void publishOutcome(Outcome& outcome);
  void predict(Outcome& outcome);
  void publishPrediction(const Outcome& prediction);
  void publishVoided();
  void publishNoPromise();
  void publishAhead(const Outcome& outcome);
  void publishEffects(const ros::Time& stamp);
  void logEffects();
  void accountDropped();
  std::vector<AwaitedTopic> silentTopics();
  void lookIntoSilence();
  void resetNow(StepStatus status);
  StatsContext statsContext() const;
};

}  // namespace dccd
