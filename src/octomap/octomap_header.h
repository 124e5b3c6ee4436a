// The text header of .bt and .ot files.
#pragma once

#include <cstddef>
#include <string>

namespace dccd {

struct OctomapHeader {
  bool present = false;
  bool binary = false;  ///< .bt
  std::string id;
  double resolution = 0;   ///< [m], as printed: about six digits
  bool empty = false;      ///< it says "size 0": no data follow
  std::size_t length = 0;  ///< bytes up to the data
};

/// Not present where the data do not begin like one. Throws OctomapError for a header that is cut off or lacks a field.
OctomapHeader parseOctomapHeader(const char* data, std::size_t size);
/// The same of a file: before OctoMap 1.0 a .bt file began with 16 bytes (the number 3, the resolution, the size).
OctomapHeader parseOctomapFileHeader(const char* data, std::size_t size);

}  // namespace dccd
