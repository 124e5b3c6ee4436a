// Checked reading of serialised ROS messages in place: nothing is copied and nothing is allocated before every length
// has been held against the bytes that are really there. A generated deserialiser resizes first and looks later.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <stdexcept>
#include <string>
#include <string_view>
#include <type_traits>

namespace dccd {

/// A message that cannot be used; the text names the field and the value.
struct WireError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Elements of fixed size, back to back in the message's bytes, not necessarily aligned.
template <typename T>
struct WireSpan {
  const std::uint8_t* data = nullptr;
  std::size_t size = 0;
  T operator[](std::size_t i) const {
    T value;
    std::memcpy(&value, data + i * sizeof(T), sizeof(T));
    return value;
  }
};

/// Reads little-endian fields in the order of the message definition.
class WireReader {
 public:
  WireReader(const std::uint8_t* data, std::size_t size) : at_(data), left_(size) {}

  std::size_t left() const { return left_; }
  /// What is not read yet.
  std::string_view rest() const { return {reinterpret_cast<const char*>(at_), left_}; }

  template <typename T>
  T read(const char* field) {
    static_assert(std::is_trivially_copyable_v<T>);
    need(sizeof(T), field);
    T value;
    std::memcpy(&value, at_, sizeof(T));
    advance(sizeof(T));
    return value;
  }

  std::string_view readString(const char* field) {
    const std::size_t length = read<std::uint32_t>(field);
    need(length, field);
    const std::string_view text(reinterpret_cast<const char*>(at_), length);
    advance(length);
    return text;
  }

  /// Length of an array whose elements take at least `min_element_bytes` each.
  std::size_t readCount(const char* field, std::size_t min_element_bytes) {
    const std::size_t count = read<std::uint32_t>(field);
    if (count > left_ / min_element_bytes) {
      throw WireError(std::string(field) + " claims " + std::to_string(count) + " elements, the message has " +
                      std::to_string(left_) + " bytes left");
    }
    return count;
  }

  /// For lists of which every entry takes memory of its own, however little of the message it is. Throws WireError.
  void limitEntries(std::size_t count) { max_entries_ = count; }
  std::size_t readEntries(const char* field, std::size_t min_element_bytes) {
    const std::size_t count = readCount(field, min_element_bytes);
    if (count <= max_entries_) return count;
    throw WireError(std::string(field) + " has " + std::to_string(count) + " entries, more than the " +
                    std::to_string(max_entries_) + " for which there is room; raise max_memory_mb");
  }

  template <typename T>
  WireSpan<T> readArray(const char* field) {
    const std::size_t count = readCount(field, sizeof(T));
    WireSpan<T> span{at_, count};
    advance(count * sizeof(T));
    return span;
  }

  void skip(std::size_t bytes, const char* field) {
    need(bytes, field);
    advance(bytes);
  }

 private:
  const std::uint8_t* at_;
  std::size_t left_;
  std::size_t max_entries_ = std::numeric_limits<std::size_t>::max();
  void need(std::size_t bytes, const char* field) const {
    if (bytes <= left_) return;
    throw WireError(std::string(field) + " needs " + std::to_string(bytes) + " bytes, the message has " +
                    std::to_string(left_) + " left");
  }
  void advance(std::size_t bytes) {
    at_ += bytes;
    left_ -= bytes;
  }
};

}  // namespace dccd
