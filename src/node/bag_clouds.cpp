#include "node/bag_clouds.h"

#include <utility>

#include "input/known_types.h"
#include "input/message_bytes.h"
#include "node/bag_reading.h"

namespace dccd {

BagClouds::BagClouds(const MonitorConfig& config, const TransformFeed& feed, const MapMemory& memory)
    : clouds_(config, feed, memory), held_(config.clouds.size()) {
  for (std::size_t source = 0; source < config.clouds.size(); ++source) {
    by_topic_[config.clouds[source].topic] = source;
    by_info_topic_[bagTopic(cameraInfoTopic(config.clouds[source]))].push_back(source);
  }
}

std::vector<std::string> BagClouds::infoTopics() const {
  std::vector<std::string> topics;
  for (const auto& one : by_info_topic_) topics.push_back(one.first);
  return topics;
}

std::optional<LoadedMap> BagClouds::hearCameraInfo(const rosbag::MessageInstance& message) {
  const auto sources = by_info_topic_.find(message.getTopic());
  if (sources == by_info_topic_.end()) return std::nullopt;
  const std::string problem = cameraInfoProblem(message.getDataType(), message.getMD5Sum());
  std::optional<LoadedMap> void_map;
  for (const std::size_t source : sources->second) {
    const std::string why_void = clouds_.setCameraInfo(source, problem, bytesOf(message));
    if (why_void.empty()) continue;
    clouds_.refuse(source, receiptOf(message), why_void);
    void_map.emplace();
    void_map->problem = why_void;
    void_map->stamp_ns = void_map->receipt_ns = receiptOf(message);
  }
  return void_map;
}

std::string BagClouds::hold(const rosbag::MessageInstance& message) {
  const std::size_t source = sourceOf(message);
  if (held_[source] && clouds_.hasFrame()) clouds_.miss(source, "too many came, and it gave way to a newer one");
  held_[source] = CloudMessage{source, message.getDataType(), bytesOf(message), receiptOf(message)};
  return frameIdOf(held_[source]->bytes);
}

void BagClouds::refuse(const rosbag::MessageInstance& message, const std::string& problem) {
  clouds_.refuse(sourceOf(message), receiptOf(message), problem);
}

std::vector<LoadedMap> BagClouds::take(const std::string& fixed_frame) {
  clouds_.setFrame(fixed_frame);
  std::vector<LoadedMap> maps;
  for (std::optional<CloudMessage>& one : held_) {
    if (!one || !clouds_.hasFrame()) continue;
    maps.push_back(clouds_.add(*std::exchange(one, std::nullopt), [] { return false; }));
  }
  return maps;
}

}  // namespace dccd
