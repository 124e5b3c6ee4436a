// Transforms: what arrives on /tf goes into one buffer; what is asked for comes out at exactly the stamp asked.
#pragma once

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <map>
#include <mutex>
#include <set>
#include <string>
#include <unordered_map>
#include <unordered_set>
#include <vector>

#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "dccd/mesh_store.h"
#include "dccd/tolerances.h"

namespace dccd {

constexpr StampNs JUMP_BACK_NS = tolerance::TF_JUMP_BACK_NS;

/// Feeds a tf2 buffer and clears it when tf's own stamps jump back, as a looping replay makes them: kept transforms of
/// the end would otherwise be taken for ones of the beginning. Leaves out what tf2 would write a line to the console
/// for, each time: repeated stamps above all. Not thread-safe, but for what it says of unusable transforms;
/// tf2::BufferCore itself is.
class TransformFeed {
 public:
  /// tf2 forgets no name; further frames are left out.
  static constexpr std::size_t MAX_FRAMES = 16384;
  /// In the 10 s that tf2 keeps, of all frames together: 26,000 a second. Where more come all are forgotten.
  static constexpr std::size_t MAX_KEPT = std::size_t{1} << 18;

  /// Child frames with unusable transforms that are told of.
  static constexpr std::size_t MAX_TOLD = 16;

  explicit TransformFeed(tf2::BufferCore& buffer) : buffer_(buffer) {}
  /// Whether add() would clear the buffer.
  bool clears(const tf2_msgs::TFMessage& message, bool is_static) const;
  /// Returns true when the buffer was cleared.
  bool add(const tf2_msgs::TFMessage& message, bool is_static);

  /// How many transforms could not be used; from any thread.
  std::uint64_t unusable() const { return unusable_; }
  /// Which frames have had no others, and why, in words; empty: none. From any thread.
  std::string onlyUnusable() const;
  /// A line for each child frame that has had an unusable one, once.
  std::vector<std::string> takeComplaints();

 private:
  std::atomic<std::uint64_t> unusable_{0};
  mutable std::mutex told_mutex_;                     // of these:
  std::map<std::string, std::string> only_unusable_;  // per child frame that has had no usable one: what was wrong
  std::set<std::string> told_;
  std::vector<std::string> complaints_;

  void leaveOut(const geometry_msgs::TransformStamped& transform, const std::string& problem);
  void forgive(const std::string& child);
  tf2::BufferCore& buffer_;
  std::unordered_map<std::string, std::set<StampNs>> kept_;  // stamps that the buffer holds, per child frame
  std::size_t kept_count_ = 0;
  std::unordered_set<std::string> names_;
  std::unordered_map<std::string, bool> static_;  // per child frame: as tf2 takes it, for good, from what came first

  bool goesBack(const geometry_msgs::TransformStamped& transform) const;
  bool hasRoomFor(const geometry_msgs::TransformStamped& transform);
  bool isRepeated(const geometry_msgs::TransformStamped& transform);
  void clear();
};

/// target_from_source at the stamp. False, with the reason, when it is not known (yet). Equal frames need no transform.
bool lookupTransform(const tf2::BufferCore& buffer, const std::string& target, const std::string& source,
                     StampNs stamp_ns, Eigen::Isometry3d& transform, std::string& reason);

void transform(const Eigen::Isometry3d& target_from_source, Positions& positions);

}  // namespace dccd
