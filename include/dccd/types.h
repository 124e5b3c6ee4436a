// Basic types shared by every part of the package. Free of ROS, PCL and OctoMap.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <limits>
#include <vector>

#include <Eigen/Core>
#include <Eigen/Geometry>

#include "dccd/tolerances.h"

namespace dccd {

using Vec3 = Eigen::Vector3d;  ///< metres, in the fixed frame unless a name says otherwise
using Index = std::uint32_t;   ///< vertex, edge or face index
constexpr Index NO_INDEX = std::numeric_limits<Index>::max();

using Edge = std::array<Index, 2>;  ///< vertex indices, the smaller one first
using Face = std::array<Index, 3>;  ///< vertex indices in the order of the input
using Positions = std::vector<Vec3>;
using StampNs = std::int64_t;  ///< nanoseconds; the stamp of a mesh, never the wall clock
inline double secondsBetween(StampNs from_ns, StampNs to_ns) {
  // Unsigned, for two stamps can be further apart than the largest of them.
  const auto from = static_cast<std::uint64_t>(from_ns), to = static_cast<std::uint64_t>(to_ns);
  return (to_ns < from_ns ? -static_cast<double>(from - to) : static_cast<double>(to - from)) * 1e-9;
}
/// What is stamped before the latest that came. Where stamps go back further, time begins anew.
inline bool isLate(StampNs stamp_ns, StampNs latest_ns) {
  const double late_s = secondsBetween(stamp_ns, latest_ns);
  return late_s > 0 && late_s <= tolerance::LATE_FRAME_S;
}

/// A closed axis-aligned box.
struct Box {
  Vec3 min = Vec3::Constant(std::numeric_limits<double>::infinity());
  Vec3 max = Vec3::Constant(-std::numeric_limits<double>::infinity());
  bool empty() const { return !(min.array() <= max.array()).all(); }
  friend bool operator==(const Box& a, const Box& b) { return a.min == b.min && a.max == b.max; }
};

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
