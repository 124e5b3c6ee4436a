// Where the list of what a step finds is cut, so that it is the same for any number of threads: after the first so many
// in the order of the tasks.
#pragma once

#include <atomic>
#include <cstddef>
#include <limits>
#include <memory>

namespace dccd {

/// Counts what the tasks of a step find. They are begun in their order, and each has one thread.
class FoundLimit {
 public:
  static constexpr std::size_t NONE = std::numeric_limits<std::size_t>::max();

  void begin(std::size_t limit, std::size_t tasks) {
    limit_ = limit;
    total_ = 0;
    tasks_ = tasks;
    if (limit == NONE) return;
    if (tasks > capacity_) {
      counts_.reset(new std::atomic<std::size_t>[tasks]);
      capacity_ = tasks;
    }
    for (std::size_t t = 0; t < tasks; ++t) counts_[t].store(0, std::memory_order_relaxed);
  }
  bool isSet() const { return limit_ != NONE; }

  /// The task has found `count` more. False: it and those before it already have more than the limit, so that nothing
  /// that it, or one after it, finds from here on would be listed.
  bool add(std::size_t task, std::size_t count) {
    if (!isSet()) return true;
    counts_[task].fetch_add(count, std::memory_order_relaxed);
    if (total_.fetch_add(count, std::memory_order_relaxed) + count <= limit_) return true;
    std::size_t sum = 0;
    for (std::size_t t = 0; t <= task && sum <= limit_; ++t) sum += counts_[t].load(std::memory_order_relaxed);
    return sum <= limit_;
  }

  /// When all tasks have ended: the first one that is listed in part, and how much of it is; `tasks` where all are.
  std::size_t cutTask(std::size_t& listed) const {
    std::size_t left = limit_;
    for (std::size_t t = 0; isSet() && t < tasks_; ++t) {
      listed = left;
      if (counts_[t] > left) return t;
      left -= counts_[t];
    }
    return tasks_;
  }

 private:
  std::size_t limit_ = NONE, tasks_ = 0, capacity_ = 0;
  std::atomic<std::size_t> total_{0};
  std::unique_ptr<std::atomic<std::size_t>[]> counts_;
};

}  // namespace dccd
