#include "node/input_queue.h"

#include <chrono>
#include <future>
#include <memory>
#include <utility>

namespace dccd {

InputQueue::InputQueue(std::size_t bodies, std::size_t capacity, QueuePolicy policy, std::size_t max_bytes)
    : queues_(bodies), dropped_(bodies, 0), policies_(bodies, policy), capacity_(capacity), max_bytes_(max_bytes) {}

void InputQueue::push(std::size_t body, MeshMessage message) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    auto& queue = queues_[body];
    if (max_bytes_ > 0 && message.size() > max_bytes_) {
      MeshMessage emptied;  // its turn comes all the same: that it is refused is to be told
      emptied.too_large = message.size();
      emptied.receipt_ns = message.receipt_ns;
      emptied.arrival_ns = message.arrival_ns;
      emptied.since_ns = message.since_ns;
      message = std::move(emptied);
    }
    const std::size_t size = message.size();
    const auto isFull = [&] { return queue.size() >= capacity_ || (max_bytes_ > 0 && bytes_ + size > max_bytes_); };
    while (isFull()) {
      ++dropped_[body];
      // What lies in other bodies' queues is theirs.
      if (policies_[body] == QueuePolicy::OLDEST || queue.empty()) return;
      if (policies_[body] == QueuePolicy::THIN) {
        (queue.size() > 1 ? queue[1] : message).thinned += queue.front().thinned + 1;
      }
      bytes_ -= queue.front().size();
      queue.pop_front();
    }
    bytes_ += size;
    queue.push_back(std::move(message));
    woken_ = true;
  }
  changed_.notify_one();
}

bool InputQueue::pop(std::size_t body, MeshMessage& message) {
  const std::lock_guard<std::mutex> lock(mutex_);
  auto& queue = queues_[body];
  if (queue.empty()) return false;
  bytes_ -= queue.front().size();
  message = std::move(queue.front());
  queue.pop_front();
  return true;
}

std::vector<std::uint64_t> InputQueue::clear(const std::vector<bool>& spared) {
  const std::lock_guard<std::mutex> lock(mutex_);
  std::vector<std::uint64_t> counts(queues_.size(), 0);
  for (std::size_t b = 0; b < queues_.size(); ++b) {
    if (b < spared.size() && spared[b]) continue;
    counts[b] = queues_[b].size();
    for (const MeshMessage& message : queues_[b]) bytes_ -= message.size();
    queues_[b].clear();
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
    if (closed_) return;
    commands_.push_back(std::move(run));
    woken_ = true;
  }
  changed_.notify_one();
}

Reply InputQueue::call(const std::function<Reply()>& run, double timeout_s) {
  auto promise = std::make_shared<std::promise<Reply>>();
  std::future<Reply> future = promise->get_future();
  // The command alone holds the promise: dropped, it breaks it, and the wait ends.
  command([promise = std::move(promise), run] {
    try {
      promise->set_value(run());
    } catch (const std::exception& error) {
      promise->set_value({false, error.what()});
    }
  });
  if (future.wait_for(std::chrono::duration<double>(timeout_s)) != std::future_status::ready) {
    return {false, "the worker is busy with a step; this will be done after it"};
  }
  try {
    return future.get();
  } catch (const std::future_error&) {  // the promise went with its command
    return {false, "the monitor is being stopped"};
  }
}

void InputQueue::close() {
  std::vector<std::function<void()>> dropped;  // ends outside of the lock
  const std::lock_guard<std::mutex> lock(mutex_);
  closed_ = true;
  dropped.swap(commands_);
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

}  // namespace dccd
