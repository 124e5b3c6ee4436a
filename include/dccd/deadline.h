// When a step has to be done: the one form of it.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>

namespace dccd {

/// When a step has to be done.
class Deadline {
 public:
  using Clock = std::chrono::steady_clock;
  Deadline() = default;  ///< never
  explicit Deadline(Clock::time_point at) : at_(at) {}
  /// From now on; 0, and more than the clock can count (30 years): never.
  static Deadline after(double ms) {
    if (!(ms > 0) || ms > 1e12) return {};
    return Deadline(Clock::now() +
                    std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double, std::milli>(ms)));
  }
  /// The same, and over as soon as the flag is set, by any thread: what is computed is not wanted any more. The flag
  /// must outlive it.
  Deadline orWhen(const std::atomic<bool>& cancelled) const {
    Deadline both = *this;
    both.cancelled_ = &cancelled;
    return both;
  }
  /// Over at the look that finds none left, which it counts down: with it a test counts the work between two looks at
  /// the clock. The number must outlive it.
  static Deadline afterLooks(std::atomic<std::int64_t>& left) {
    Deadline counted(Clock::now() + std::chrono::hours(24));
    counted.looks_left_ = &left;
    return counted;
  }
  /// At another time; the flag stays.
  Deadline movedTo(Clock::time_point at) const {
    Deadline moved = *this;
    moved.at_ = at;
    return moved;
  }
  /// Later by this much, or earlier; a time that is not set stays so.
  Deadline movedBy(Clock::duration by) const { return isNever() ? *this : movedTo(at_ + by); }
  /// False: there is neither a time nor a flag, and it will never be over.
  bool canEnd() const { return !isNever() || cancelled_ != nullptr; }
  /// No time is set.
  bool isNever() const { return at_ == Clock::time_point::max(); }
  bool isOver() const {
    if (looks_left_ && looks_left_->fetch_sub(1, std::memory_order_relaxed) <= 0) return true;
    return (cancelled_ && cancelled_->load(std::memory_order_relaxed)) || (!isNever() && Clock::now() >= at_);
  }
  Clock::time_point at() const { return at_; }

 private:
  Clock::time_point at_ = Clock::time_point::max();
  const std::atomic<bool>* cancelled_ = nullptr;
  std::atomic<std::int64_t>* looks_left_ = nullptr;
};

}  // namespace dccd
