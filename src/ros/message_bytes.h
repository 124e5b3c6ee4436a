// A message of any type as its bytes.
#pragma once

#include <cstdint>
#include <vector>

#include <ros/serialization.h>

namespace dccd {

/// `Message` is a topic_tools::ShapeShifter or a rosbag::MessageInstance: both know their size and write themselves.
template <typename Message>
std::vector<std::uint8_t> bytesOf(const Message& message) {
  std::vector<std::uint8_t> bytes(message.size());
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  message.write(stream);
  return bytes;
}

}  // namespace dccd
