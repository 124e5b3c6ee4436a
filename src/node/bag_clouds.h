// The clouds, depth pictures and CameraInfo of a bag, on their way into the map.
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include <rosbag/message_instance.h>

#include "node/cloud_mapping.h"

namespace dccd {

/// One cloud of each source waits while the fixed frame is not known: the newest.
class BagClouds {
 public:
  /// The topics of `config` are as bags name them.
  BagClouds(const MonitorConfig& config, const TransformFeed& feed, const MapMemory& memory);

  std::vector<std::string> infoTopics() const;
  /// A message of any topic: what is of none of infoTopics() is left alone. Returns what it makes of the map: nothing,
  /// or that this is void, for the message says where a picture really was.
  std::optional<LoadedMap> hearCameraInfo(const rosbag::MessageInstance& message);
  /// Returns its frame_id.
  std::string hold(const rosbag::MessageInstance& message);
  void refuse(const rosbag::MessageInstance& message, const std::string& problem);
  /// What the map is with each cloud that is held, once.
  std::vector<LoadedMap> take(const std::string& fixed_frame);
  CloudCounters counters() const { return clouds_.counters(); }

 private:
  std::size_t sourceOf(const rosbag::MessageInstance& message) const { return by_topic_.at(message.getTopic()); }

  CloudMapping clouds_;
  std::map<std::string, std::size_t> by_topic_;
  std::map<std::string, std::vector<std::size_t>> by_info_topic_;
  std::vector<std::optional<CloudMessage>> held_;
};

}  // namespace dccd
