// Callbacks of topics that wait, counted: roscpp drops the oldest message of a topic of which too many wait, and tells
// nobody.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>

#include <ros/callback_queue.h>

namespace dccd {

/// Messages of a topic that may wait in roscpp's own queue.
constexpr std::uint32_t SUBSCRIBER_QUEUE = 256;

/// For subscriptions, each an owner, whose own queues hold `most` messages or more. Callbacks are called by one thread.
class WatchedQueue : public ros::CallbackQueue {
 public:
  explicit WatchedQueue(std::size_t most = SUBSCRIBER_QUEUE) : waiting_(new Waiting{most}) {}
  void addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t owner = 0) override;

  /// How often so many of one waited that a message that came then may have taken the place of another one.
  std::uint64_t timesFull() const { return times_full_; }
  bool isFull() const { return waiting_->full > 0; }

  struct Waiting {
    const std::size_t most;
    std::atomic<std::size_t> full{0};  // owners of which `most` or more wait
    std::mutex mutex;
    std::map<std::uint64_t, std::size_t> of;  // by owner, above 0
  };

 private:
  std::shared_ptr<Waiting> waiting_;
  std::atomic<std::uint64_t> times_full_{0};
};

/// Of one subscription, asked by each of its callbacks.
class DropWatch {
 public:
  /// Whether roscpp may have dropped a message between the last callback's and this one.
  bool mayLack(const WatchedQueue& queue);

 private:
  std::uint64_t times_full_ = 0;
  bool was_full_ = false;
};

}  // namespace dccd
