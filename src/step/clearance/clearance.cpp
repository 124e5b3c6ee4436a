#include "dccd/clearance.h"

namespace dccd {

const char* toString(ClearanceStatus status) {
  static constexpr const char* NAMES[] = {"MEASURED", "FARTHER", "TOUCHING", "LOWER", "UNKNOWN"};
  return NAMES[static_cast<std::size_t>(status)];
}

}  // namespace dccd
