#include "ros/input_queue.h"

#include <chrono>
#include <utility>

namespace deformable_ccd {

InputQueue::InputQueue(std::size_t bodies, std::size_t capacity, QueuePolicy policy)
    : queues_(bodies), dropped_(bodies, 0), capacity_(capacity), policy_(policy) {}

void InputQueue::push(std::size_t body, QueuedMessage message) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    auto& queue = queues_[body];
    if (queue.size() >= capacity_) {
      ++dropped_[body];
      if (policy_ == QueuePolicy::OLDEST) return;
      queue.pop_front();
    }
    queue.push_back(std::move(message));
    woken_ = true;
  }
  changed_.notify_one();
}

bool InputQueue::pop(std::size_t body, QueuedMessage& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  auto& queue = queues_[body];
  if (queue.empty()) return false;
  message = std::move(queue.front());
  queue.pop_front();
  return true;
}

std::vector<std::uint64_t> InputQueue::clear() {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::uint64_t> counts;
  for (auto& queue : queues_) {
    counts.push_back(queue.size());
    queue.clear();
  }
  return counts;
}

std::vector<std::uint64_t> InputQueue::takeDropped() {
  const std::lock_guard<std::mutex> lock(mutex_);
  return std::exchange(dropped_, std::vector<std::uint64_t>(dropped_.size(), 0));
}

std::size_t InputQueue::size(std::size_t body) const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return queues_[body].size();
}

void InputQueue::command(std::function<void()> run) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    commands_.push_back(std::move(run));
    woken_ = true;
  }
  changed_.notify_one();
}

std::vector<std::function<void()>> InputQueue::wait(std::chrono::microseconds timeout) {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait_for(lock, timeout, [this] { return woken_; });
  woken_ = false;
  return std::exchange(commands_, {});
}

void InputQueue::wake() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    woken_ = true;
  }
  changed_.notify_one();
}

}  // namespace deformable_ccd
