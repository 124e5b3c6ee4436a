// The edge lengths of voxels that a map may have, and what is said of another one: for surfaces, known space and what
// is read of a message or file.
#pragma once

#include <algorithm>
#include <sstream>
#include <string>

#include "dccd/tolerances.h"

namespace dccd {

/// The planes up to +-32768 resolutions and the reciprocal must be finite and normal.
inline bool isResolution(double resolution_m) {
  return resolution_m >= tolerance::SMALLEST_RESOLUTION_M && resolution_m <= tolerance::LARGEST_RESOLUTION_M;
}

/// "NAME is VALUE, which is not a length from ... to ... m".
inline std::string noResolution(const std::string& name, double resolution_m) {
  std::ostringstream value, limits;
  value << resolution_m;
  limits << tolerance::SMALLEST_RESOLUTION_M << " to " << tolerance::LARGEST_RESOLUTION_M;
  std::string range = limits.str();
  range.erase(std::remove(range.begin(), range.end(), '+'), range.end());  // of an exponent
  return name + " is " + value.str() + ", which is not a length from " + range + " m";
}

}  // namespace dccd
