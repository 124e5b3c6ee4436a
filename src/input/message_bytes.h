// A message of any type as its bytes.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <new>
#include <vector>

#include <ros/serialization.h>

namespace dccd {

/// Whether a large message may be copied. roscpp's thread ends the process where it cannot read a message into memory,
/// so there must be room for one more like it, as it is read and as it is handed over. What is asked for is given back
/// untouched.
inline bool hasMemoryFor(std::size_t bytes) {
  return bytes < (std::size_t{1} << 20) || std::unique_ptr<char[]>(new (std::nothrow) char[3 * bytes]) != nullptr;
}

/// `Message` is a topic_tools::ShapeShifter or a rosbag::MessageInstance: both know their size and write themselves.
template <typename Message>
std::vector<std::uint8_t> bytesOf(const Message& message) {
  std::vector<std::uint8_t> bytes(message.size());
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  message.write(stream);
  return bytes;
}

}  // namespace dccd
