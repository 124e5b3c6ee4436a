#include "input/ply_header.h"

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/decimal.h"

namespace dccd {
namespace ply {
namespace {

std::optional<Number> numberNamed(std::string_view name) {
  static constexpr std::string_view NAMES[][2] = {{"char", "int8"},     {"uchar", "uint8"},   {"short", "int16"},
                                                  {"ushort", "uint16"}, {"int", "int32"},     {"uint", "uint32"},
                                                  {"float", "float32"}, {"double", "float64"}};
  for (std::size_t n = 0; n < std::size(NAMES); ++n) {
    if (name == NAMES[n][0] || name == NAMES[n][1]) return static_cast<Number>(n);
  }
  return std::nullopt;
}

}  // namespace

Header::Header(TextLines& lines, std::size_t file_bytes) : lines_(lines), file_bytes_(file_bytes) {
  if (!lines.next() || lines.words().size() != 1 || lines.words()[0].text != "ply") fail("is no PLY file");
  while (lines.next()) {
    if (take()) continue;
    finish();
    return;
  }
  lines.fail("the header has no end");
}

void Header::fail(const std::string& what) const { lines_.fail("header line " + inQuotes(lines_.text()) + " " + what); }
std::string_view Header::word(std::size_t w) const {
  return w < lines_.words().size() ? lines_.words()[w].text : std::string_view();
}

/// False at the end of the header.
bool Header::take() {
  if (word(0) == "comment" || word(0) == "obj_info") return true;
  std::size_t used = 1;
  if (word(0) == "format") {
    used = takeFormat();
  } else if (word(0) == "element") {
    used = takeElement();
  } else if (word(0) == "property") {
    used = takeProperty();
  } else if (word(0) != "end_header") {
    fail("cannot be understood");
  }
  if (lines_.words().size() > used) fail("holds too many words");
  return word(0) != "end_header";
}

std::size_t Header::takeFormat() {
  static constexpr std::string_view NAMES[] = {"ascii", "binary_little_endian", "binary_big_endian"};
  const auto* const name = std::find(std::begin(NAMES), std::end(NAMES), word(1));
  if (name == std::end(NAMES) || word(2) != "1.0") fail("names no format of version 1.0");
  if (encoding) fail("names the format once more");
  encoding = static_cast<Encoding>(name - std::begin(NAMES));
  return 3;
}

std::size_t Header::takeElement() {
  requireProperties();
  const auto count = decimalInteger(word(2));
  if (!count || *count < 0) fail("needs a name and a count");
  Element element;
  element.name = word(1);
  element.count = static_cast<std::uint64_t>(*count);
  if (element.count > file_bytes_) fail("claims more than the file holds");
  for (const Element& other : elements) {
    if (other.name == element.name) fail("names an element once more");
  }
  elements.push_back(std::move(element));
  return 3;
}

std::size_t Header::takeProperty() {
  if (elements.empty()) fail("belongs to no element");
  const bool list = word(1) == "list";
  const std::size_t at = list ? 3 : 1;
  const std::optional<Number> type = numberNamed(word(at)), count = numberNamed(word(2));
  if (!type || (list && !count)) fail("names no type");
  if (list && !isInteger(*count)) fail("counts a list by a type that is no integer");
  if (word(at + 1).empty()) fail("has no name");
  elements.back().properties.push_back({std::string(word(at + 1)), *type, list ? count : std::nullopt});
  return at + 2;
}

void Header::requireProperties() const {
  if (!elements.empty() && elements.back().properties.empty()) fail("ends an element without properties");
}
void Header::finish() const {
  requireProperties();
  if (!encoding) fail("ends a header that names no format");
}

}  // namespace ply
}  // namespace dccd
