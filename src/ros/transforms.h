// Transforms: what arrives on /tf goes into one buffer; what is asked for comes out at exactly the stamp asked.
#pragma once

#include <string>
#include <unordered_map>

#include <tf2/buffer_core.h>
#include <tf2_msgs/TFMessage.h>

#include "dccd/mesh_store.h"
#include "dccd/tolerances.h"

namespace dccd {

constexpr StampNs JUMP_BACK_NS = tolerance::TF_JUMP_BACK_NS;

/// Feeds a tf2 buffer and clears it when tf's own stamps jump back, as a looping replay makes them: kept transforms of
/// the end would otherwise be taken for ones of the beginning. Not thread-safe; tf2::BufferCore itself is.
class TransformFeed {
 public:
  explicit TransformFeed(tf2::BufferCore& buffer) : buffer_(buffer) {}
  /// Whether add() would clear the buffer.
  bool clears(const tf2_msgs::TFMessage& message, bool is_static) const;
  /// Returns true when the buffer was cleared.
  bool add(const tf2_msgs::TFMessage& message, bool is_static);

 private:
  tf2::BufferCore& buffer_;
  std::unordered_map<std::string, StampNs> newest_;  // per child frame

  bool goesBack(const geometry_msgs::TransformStamped& transform) const;
};

/// Empty when tf2 takes the name; else what is wrong with it, in a few words. tf2 itself writes a line to the console
/// for each name that it does not take.
std::string frameNameProblem(const std::string& name);

/// target_from_source at the stamp. False, with the reason, when it is not known (yet). Equal frames need no transform.
bool lookupTransform(const tf2::BufferCore& buffer, const std::string& target, const std::string& source,
                     StampNs stamp_ns, Eigen::Isometry3d& transform, std::string& reason);

void transform(const Eigen::Isometry3d& target_from_source, Positions& positions);

}  // namespace dccd
