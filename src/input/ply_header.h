// The head of a PLY file: which elements it has, and what their rows consist of.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "input/text_lines.h"

namespace dccd {
namespace ply {

enum class Number : std::uint8_t { INT8, UINT8, INT16, UINT16, INT32, UINT32, FLOAT, DOUBLE };
inline bool isInteger(Number type) { return type < Number::FLOAT; }

struct Property {
  std::string name;
  Number type;                       // of the value, or of a list's items
  std::optional<Number> count_type;  // of a list
};

struct Element {
  std::string name;
  std::uint64_t count = 0;
  std::vector<Property> properties;
};

enum class Encoding : std::uint8_t { ASCII, LITTLE_ENDIAN_BYTES, BIG_ENDIAN_BYTES };

/// Known words and types only, no element without properties or given twice, and no more elements than the file has
/// bytes: what a header claims is not believed.
class Header {
 public:
  /// Reads up to the end of the head. Throws MeshFileError naming the file and the line.
  Header(TextLines& lines, std::size_t file_bytes);

  std::optional<Encoding> encoding;
  std::vector<Element> elements;

 private:
  [[noreturn]] void fail(const std::string& what) const;
  std::string_view word(std::size_t w) const;
  bool take();
  std::size_t takeFormat();
  std::size_t takeElement();
  std::size_t takeProperty();
  void requireProperties() const;
  void finish() const;

  TextLines& lines_;
  std::size_t file_bytes_;
};

}  // namespace ply
}  // namespace dccd
