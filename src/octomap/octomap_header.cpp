#include "octomap/octomap_header.h"

#include <cstring>

#include "dccd/decimal.h"
#include "dccd/octomap_decode.h"

namespace dccd {
namespace {

const char BINARY_MARK[] = "# Octomap OcTree binary file";
const char FULL_MARK[] = "# Octomap OcTree file";
/// Longer headers are taken for garbage: real ones have six short lines and perhaps a comment.
constexpr std::size_t MAX_HEADER = 4096;

bool beginsWith(const char* data, std::size_t size, const char* text) {
  const std::size_t length = std::strlen(text);
  return size >= length && std::memcmp(data, text, length) == 0;
}

double parseNumber(const std::string& text, const std::string& field) {
  const auto value = decimalNumber(text);
  if (!value) throw OctomapError("octomap header: " + field + " is '" + text + "', not a number");
  return *value;
}

/// One line "key value"; false at the line "data".
bool readLine(const std::string& line, OctomapHeader& header, bool& has_resolution) {
  if (line.empty() || line[0] == '#') return true;
  const std::size_t space = line.find(' ');
  const std::string key = line.substr(0, space);
  if (key == "data") return false;
  const std::string value = space == std::string::npos ? "" : line.substr(space + 1);
  if (key == "id") {
    header.id = value;
  } else if (key == "res") {
    header.resolution = parseNumber(value, "res");
    has_resolution = true;
  } else if (key == "size") {
    header.empty = parseNumber(value, "size") == 0;
  } else {
    throw OctomapError("octomap header: the keyword '" + key.substr(0, 40) + "' is not known");
  }
  return true;
}

}  // namespace

OctomapHeader parseOctomapHeader(const char* data, std::size_t size) {
  OctomapHeader header;
  header.binary = beginsWith(data, size, BINARY_MARK);
  header.present = header.binary || beginsWith(data, size, FULL_MARK);
  if (!header.present) return header;
  bool has_resolution = false;
  const std::size_t limit = size < MAX_HEADER ? size : MAX_HEADER;
  for (std::size_t at = 0; at < limit;) {
    const void* newline = std::memchr(data + at, '\n', limit - at);
    if (newline == nullptr) break;
    std::size_t end = static_cast<std::size_t>(static_cast<const char*>(newline) - data);
    const std::size_t next = end + 1;
    if (end > at && data[end - 1] == '\r') --end;
    if (!readLine(std::string(data + at, end - at), header, has_resolution)) {
      if (header.id.empty()) throw OctomapError("octomap header: the id is missing");
      if (!has_resolution) throw OctomapError("octomap header: the resolution (res) is missing");
      header.length = next;
      return header;
    }
    at = next;
  }
  throw OctomapError("octomap header: it ends before its line 'data'");
}

}  // namespace dccd
