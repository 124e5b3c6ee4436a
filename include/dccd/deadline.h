// When a step has to be done: the one form of it.
#pragma once

#include <chrono>

namespace dccd {

/// When a step has to be done.
class Deadline {
 public:
  using Clock = std::chrono::steady_clock;
  Deadline() = default;  ///< never
  explicit Deadline(Clock::time_point at) : at_(at) {}
  /// From now on; 0: never.
  static Deadline after(double ms) {
    if (!(ms > 0)) return {};
    return Deadline(Clock::now() +
                    std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double, std::milli>(ms)));
  }
  bool isNever() const { return at_ == Clock::time_point::max(); }
  bool isOver() const { return !isNever() && Clock::now() >= at_; }
  Clock::time_point at() const { return at_; }

 private:
  Clock::time_point at_ = Clock::time_point::max();
};

}  // namespace dccd
