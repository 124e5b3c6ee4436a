// The voxel keys that each vertex may touch during the step, and unions of them for edges and faces.
#pragma once

#include <cstdint>
#include <cstring>

#include "dccd/types.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {

/// A key box in eight 16-bit lanes, keys less 32768, upper ends complemented: the union of boxes is the minimum of the
/// lanes, one instruction on any SIMD target. Lanes 3 and 7 are unused.
struct alignas(16) KeyLanes {
  std::int16_t lane[8];

  void include(const KeyLanes& other) {
    for (int i = 0; i < 8; ++i) lane[i] = other.lane[i] < lane[i] ? other.lane[i] : lane[i];
  }
  bool operator==(const KeyLanes& other) const {
    // Two words each: a call of memcmp() costs more than the comparison.
    std::uint64_t mine[2], theirs[2];
    std::memcpy(mine, lane, sizeof mine);
    std::memcpy(theirs, other.lane, sizeof theirs);
    return ((mine[0] ^ theirs[0]) | (mine[1] ^ theirs[1])) == 0;
  }
  KeyBox box() const {
    KeyBox box;
    for (int axis = 0; axis < 3; ++axis) {
      box.lo[axis] = lane[axis] + 32768;
      box.hi[axis] = ~lane[4 + axis] + 32768;
    }
    return box;
  }
};

/// Keys within `reach_m` of a point, rounded outward. The point must be finite.
inline KeyLanes pointKeys(const Vec3& p, double inverse_resolution, double reach_m) {
  KeyLanes keys{};
  for (int axis = 0; axis < 3; ++axis) {
    keys.lane[axis] = static_cast<std::int16_t>(outwardKey(p[axis] - reach_m, inverse_resolution, -1) - 32768);
    keys.lane[4 + axis] = static_cast<std::int16_t>(~(outwardKey(p[axis] + reach_m, inverse_resolution, +1) - 32768));
  }
  return keys;
}

}  // namespace dccd
