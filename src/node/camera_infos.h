// Which CameraInfo a depth picture is of: they come on a topic of their own, before or after it.
#pragma once

#include <cstdint>
#include <deque>
#include <mutex>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "input/depth_picture.h"

namespace dccd {

/// Of one topic. Safe to call from any thread.
class CameraInfos {
 public:
  explicit CameraInfos(std::string topic) : topic_(std::move(topic)) {}

  /// A serialised CameraInfo, or why it is none. Returns why a picture of its stamp that was used before it came is not
  /// where it was taken to be; empty: it is.
  std::string add(const std::string& problem, const std::vector<std::uint8_t>& bytes);
  /// Of a picture of this stamp that is used now: its own; where that is not there, any, if all say the same. None:
  /// why_not says why.
  std::optional<PinholeView> find(StampNs stamp_ns, std::string& why_not);

 private:
  const std::string topic_;
  std::mutex mutex_;
  std::deque<PinholeView> came_;                      // the last ones
  std::deque<std::pair<StampNs, std::string>> used_;  // the last pictures' stamps, and what their CameraInfo said
};

}  // namespace dccd
