// What a monitor publishes, collected; and publishers that wait until the monitor listens.
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include <ros/ros.h>

namespace dccd {
namespace test {

inline bool waitUntil(const std::function<bool()>& done, double seconds = 5) {
  const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
  while (!done()) {
    if (std::chrono::steady_clock::now() > end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(2));
  }
  return true;
}

/// Messages of one topic, in order.
template <typename Message>
class Probe {
 public:
  Probe(ros::NodeHandle& node, const std::string& topic)
      : subscriber_(node.subscribe<Message>(topic, 1000, [this](const boost::shared_ptr<const Message>& m) {
          const std::lock_guard<std::mutex> lock(mutex_);
          messages_.push_back(*m);
        })) {
    waitUntil([this] { return subscriber_.getNumPublishers() > 0; });
  }
  std::size_t count() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.size();
  }
  /// Waits for the message after the `seen` first ones; a default one when it does not come.
  Message after(std::size_t seen, double seconds = 5) const {
    waitUntil([&] { return count() > seen; }, seconds);
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.size() > seen ? messages_[seen] : Message();
  }
  std::vector<Message> all() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }
  Message last() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.empty() ? Message() : messages_.back();
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Message> messages_;
  ros::Subscriber subscriber_;
};

template <typename Message>
ros::Publisher advertiseAndWait(ros::NodeHandle& node, const std::string& topic, bool latch = false,
                                std::size_t subscribers = 1) {
  ros::Publisher publisher = node.advertise<Message>(topic, 1000, latch);
  waitUntil([&] { return publisher.getNumSubscribers() >= subscribers; });
  return publisher;
}

}  // namespace test
}  // namespace dccd
