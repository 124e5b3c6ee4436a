#include "octomap/octomap_header.h"

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <sstream>

#include "base/decimal.h"
#include "base/octomap_decode.h"

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
  std::istringstream lines(std::string(data, std::min(size, MAX_HEADER)));
  for (std::string line; std::getline(lines, line) && !lines.eof();) {
    if (!line.empty() && line.back() == '\r') line.pop_back();
    if (readLine(line, header, has_resolution)) continue;
    if (header.id.empty()) throw OctomapError("octomap header: the id is missing");
    if (!has_resolution) throw OctomapError("octomap header: the resolution (res) is missing");
    header.length = static_cast<std::size_t>(lines.tellg());
    return header;
  }
  throw OctomapError("octomap header: it ends before its line 'data'");
}

OctomapHeader parseOctomapFileHeader(const char* data, std::size_t size) {
  constexpr std::size_t LENGTH = sizeof(std::int32_t) + sizeof(double) + sizeof(std::uint32_t);
  constexpr std::int32_t OCTREE = 3;
  OctomapHeader header = parseOctomapHeader(data, size);
  std::int32_t type = 0;
  if (header.present || size < LENGTH) return header;
  std::memcpy(&type, data, sizeof type);
  if (type != OCTREE) return header;
  std::uint32_t nodes = 0;
  std::memcpy(&header.resolution, data + sizeof type, sizeof header.resolution);
  std::memcpy(&nodes, data + LENGTH - sizeof nodes, sizeof nodes);
  header.present = header.binary = true;
  header.id = "OcTree";
  header.empty = nodes == 0;
  header.length = LENGTH;
  return header;
}

}  // namespace dccd
