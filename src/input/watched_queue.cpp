#include "input/watched_queue.h"

#include <utility>

#include <boost/make_shared.hpp>

namespace dccd {
namespace {

/// Counts from its making to its end, by a call or without one.
class Counted : public ros::CallbackInterface {
 public:
  Counted(ros::CallbackInterfacePtr callback, std::uint64_t owner, std::shared_ptr<WatchedQueue::Waiting> waiting)
      : callback_(std::move(callback)), owner_(owner), waiting_(std::move(waiting)) {
    const std::lock_guard<std::mutex> lock(waiting_->mutex);
    waiting_->full += ++waiting_->of[owner_] == waiting_->most;
  }
  ~Counted() override {
    const std::lock_guard<std::mutex> lock(waiting_->mutex);
    const auto own = waiting_->of.find(owner_);
    waiting_->full -= own->second == waiting_->most;
    if (--own->second == 0) waiting_->of.erase(own);
  }
  Counted(const Counted&) = delete;
  Counted& operator=(const Counted&) = delete;
  CallResult call() override { return callback_->call(); }
  bool ready() override { return callback_->ready(); }

 private:
  ros::CallbackInterfacePtr callback_;
  std::uint64_t owner_;
  std::shared_ptr<WatchedQueue::Waiting> waiting_;
};

}  // namespace

/// A subscription calls this of a message that took nobody's place, so that the one that fills its queue is counted.
void WatchedQueue::addCallback(const ros::CallbackInterfacePtr& callback, std::uint64_t owner) {
  const auto counted = boost::make_shared<Counted>(callback, owner, waiting_);
  if (isFull()) ++times_full_;
  ros::CallbackQueue::addCallback(counted, owner);
}

/// The count first: where the queue becomes full after it, the next callback finds another one. Where it is full now,
/// messages may be dropped up to then, and none of them is counted.
bool DropWatch::mayLack(const WatchedQueue& queue) {
  const std::uint64_t times_full = queue.timesFull();
  const bool was_full = std::exchange(was_full_, queue.isFull());
  return std::exchange(times_full_, times_full) != times_full || was_full;
}

}  // namespace dccd
