// All that asks the master while the node runs, on a thread of its own: it may hang, and nothing is to wait for it.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include <ros/subscriber.h>

#include "input/mesh_subscription.h"
#include "input/silence.h"

namespace dccd {

/// What is to be found out: why nothing comes from these topics, and where there is no map, whether others are
/// published than on the topic that is listened to (empty: not asked).
struct SilenceQuestion {
  std::vector<AwaitedTopic> silent;
  std::string map_topic;
};

class MasterWatch {
 public:
  /// Renews the subscriptions, null ones left out, from now on. `answered` is called on the watch's thread when
  /// takeHint() has something new, `map_published` when a map's topic has a publisher. All must outlive the watch.
  MasterWatch(const std::vector<std::unique_ptr<MeshSubscription>>& meshes, const std::vector<ros::Subscriber>& maps,
              std::function<void()> answered, std::function<void()> map_published);
  /// Looks once a second whether these parameters, by resolved names, hold what they did. `changed` is called on the
  /// watch's thread with the names of those that do not, whenever these are others. Before start().
  void watchParameters(std::map<std::string, std::string> held, std::function<void(std::vector<std::string>)> changed);
  void start();
  /// Waits for a question that is under way, as long as the master does not hang for no more than half a second.
  ~MasterWatch();
  MasterWatch(const MasterWatch&) = delete;
  MasterWatch& operator=(const MasterWatch&) = delete;

  /// From any thread, at once.
  void lookInto(SilenceQuestion question);
  /// What was found out, once; empty: nothing is wrong.
  std::optional<std::string> takeHint();

 private:
  void loop();
  void look();
  void lookAtParameters();

  const std::vector<std::unique_ptr<MeshSubscription>>& meshes_;
  const std::vector<ros::Subscriber>& maps_;
  std::function<void()> answered_, map_published_;
  std::mutex mutex_;
  std::condition_variable ended_;
  bool stopping_ = false;
  std::optional<SilenceQuestion> question_;
  std::optional<std::string> hint_;
  std::map<std::string, std::string> held_;
  std::function<void(std::vector<std::string>)> changed_;
  std::vector<std::string> told_changed_;
  std::chrono::steady_clock::time_point looked_;
  std::thread thread_;
};

}  // namespace dccd
