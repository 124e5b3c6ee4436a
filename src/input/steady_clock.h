// The clock that drives the node: it only goes forward, whatever /clock does.
#pragma once

#include <chrono>
#include <cstdint>

namespace dccd {

inline std::int64_t steadyNs() {
  return std::chrono::duration_cast<std::chrono::nanoseconds>(std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

}  // namespace dccd
