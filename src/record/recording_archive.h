// The two directions of a recording's bytes: fields into bytes, and bytes into fields. Which fields, and in what
// order, is said once for both in step_recording.cpp.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <memory>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "record/step_recording.h"

#if __BYTE_ORDER__ != __ORDER_LITTLE_ENDIAN__
#error "recordings are written as they lie in memory, which must be little-endian"
#endif

namespace dccd {

inline constexpr std::size_t MAX_RECORDED_TEXT = 1 << 16;
static_assert(sizeof(Vec3) == 24 && sizeof(Face) == 12 && sizeof(Index) == 4, "arrays are written as they are");
static_assert(sizeof(Box) == 48, "arrays are written as they are");

/// A leaf without the gap that its structure has in memory.
struct PackedLeaf {
  std::uint16_t x, y, z, zero;
  std::uint32_t size;
};

/// Hands over fields as bytes.
class RecordingWriter {
 public:
  static constexpr bool READS = false;
  explicit RecordingWriter(const TakeBytes& take) : take_(take) {}

  template <typename T>
  void number(const T& value) {
    static_assert(std::is_arithmetic_v<T>);
    take_(&value, sizeof value);
  }
  void size(std::size_t value) { number(static_cast<std::uint64_t>(value)); }
  void flag(bool value) { number(static_cast<std::uint8_t>(value)); }
  template <typename Enum>
  void choice(Enum value, Enum) {
    number(static_cast<std::uint8_t>(value));
  }
  void text(const std::string& value) {
    const std::uint32_t size = static_cast<std::uint32_t>(std::min(value.size(), MAX_RECORDED_TEXT));
    number(size);
    take_(value.data(), size);
  }
  template <typename T>
  void array(const std::vector<T>& values) {
    number(static_cast<std::uint64_t>(values.size()));
    take_(values.data(), values.size() * sizeof(T));
  }
  template <typename T>
  void shared(const std::shared_ptr<const std::vector<T>>& values) {
    static const std::vector<T> NONE;
    array(values ? *values : NONE);
  }
  /// The count of a list whose items are visited one by one.
  template <typename T>
  void count(const std::vector<T>& values, std::size_t, std::size_t = 0) {
    number(static_cast<std::uint64_t>(values.size()));
  }

  void map(const std::shared_ptr<const VoxelSurface>& surface) {
    flag(surface != nullptr);
    if (!surface) return;
    number(surface->resolution());
    std::vector<PackedLeaf> packed;
    for (const OccupiedLeaf& leaf : surface->leaves()) {
      packed.push_back({leaf.min.x, leaf.min.y, leaf.min.z, 0, leaf.size});
    }
    array(packed);
  }

 private:
  const TakeBytes& take_;
};

/// Takes fields from bytes that anybody may have written.
class RecordingReader {
 public:
  static constexpr bool READS = true;
  RecordingReader(const void* data, std::size_t size, const std::string& name)
      : begin_(static_cast<const std::uint8_t*>(data)), at_(begin_), end_(begin_ + size), name_(name) {}

  [[noreturn]] void fail(const std::string& what) const {
    throw RecordingError(name_ + ": byte " + std::to_string(at_ - begin_) + ": " + what);
  }
  std::size_t left() const { return static_cast<std::size_t>(end_ - at_); }

  void bytes(void* out, std::size_t size) {
    if (size > left()) fail("the file ends here; " + std::to_string(size) + " more bytes were expected");
    if (size > 0) std::memcpy(out, at_, size);
    at_ += size;
  }
  template <typename T>
  void number(T& value) {
    static_assert(std::is_arithmetic_v<T> && !std::is_same_v<T, bool>);
    bytes(&value, sizeof value);
  }
  void size(std::size_t& value) {
    std::uint64_t wide = 0;
    number(wide);
    value = static_cast<std::size_t>(std::min<std::uint64_t>(wide, std::numeric_limits<std::size_t>::max()));
  }
  void flag(bool& value) {
    std::uint8_t byte = 0;
    number(byte);
    if (byte > 1) fail("a flag is " + std::to_string(byte));
    value = byte != 0;
  }
  template <typename Enum>
  void choice(Enum& value, Enum last) {
    std::uint8_t byte = 0;
    number(byte);
    if (byte > static_cast<std::uint8_t>(last)) {
      fail("a choice is " + std::to_string(byte) + ", which this version of the program does not know");
    }
    value = static_cast<Enum>(byte);
  }
  void text(std::string& value) {
    std::uint32_t size = 0;
    number(size);
    if (size > MAX_RECORDED_TEXT) fail("a text has " + std::to_string(size) + " bytes");
    if (size > left()) fail("a text of " + std::to_string(size) + " bytes is longer than the file");
    value.resize(size);
    bytes(value.data(), size);
  }
  template <typename T>
  void array(std::vector<T>& values) {
    count(values, sizeof(T));
    bytes(static_cast<void*>(values.data()), values.size() * sizeof(T));
  }
  template <typename T>
  void shared(std::shared_ptr<const std::vector<T>>& values) {
    std::vector<T> read;
    array(read);
    values = share(std::move(read));
  }
  void map(std::shared_ptr<const VoxelSurface>& surface) {
    bool present = false;
    flag(present);
    if (!present) return;
    double resolution_m = 0;
    std::vector<PackedLeaf> packed;
    number(resolution_m);
    array(packed);
    std::vector<OccupiedLeaf> leaves;
    for (const auto& leaf : packed) {
      if (leaf.zero != 0) fail("a voxel's reserved field is " + std::to_string(leaf.zero));
      leaves.push_back({{leaf.x, leaf.y, leaf.z}, leaf.size});
    }
    try {
      surface = VoxelSurface::build(resolution_m, std::move(leaves));
    } catch (const std::invalid_argument& error) {
      fail(std::string("map: ") + error.what());
    }
  }
  template <typename T>
  void count(std::vector<T>& values, std::size_t item_bytes,
             std::size_t most = std::numeric_limits<std::size_t>::max()) {
    std::uint64_t n = 0;
    number(n);
    if (n > left() / item_bytes) fail("a list of " + std::to_string(n) + " items is longer than the file");
    if (n > most) fail("a list has " + std::to_string(n) + " items; " + std::to_string(most) + " are possible");
    values.clear();
    values.resize(static_cast<std::size_t>(n));
  }

 private:
  const std::uint8_t *begin_, *at_, *end_;
  const std::string& name_;
};

}  // namespace dccd
