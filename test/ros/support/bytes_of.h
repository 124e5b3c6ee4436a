// A message as roscpp sends it.
#pragma once

#include <cstdint>
#include <vector>

#include <ros/serialization.h>

namespace dccd {
namespace test {

template <typename Message>
std::vector<std::uint8_t> bytesOf(const Message& message) {
  std::vector<std::uint8_t> bytes(ros::serialization::serializationLength(message));
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::serialize(stream, message);
  return bytes;
}

}  // namespace test
}  // namespace dccd
