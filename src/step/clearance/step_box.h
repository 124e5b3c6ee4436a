// A box at both ends of a step: what is inside of it moves straight, so that it is inside of the box between in
// between.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "dccd/elementary.h"
#include "dccd/tolerances.h"
#include "dccd/types.h"

namespace dccd {

/// In the layout of VertexMotion: x, y, z and 0 at t0, then at t1.
struct StepBox {
  double lo[8], hi[8];

  static StepBox none() {
    StepBox box;
    for (int k = 0; k < 8; ++k) {
      box.lo[k] = k % 4 == 3 ? 0 : std::numeric_limits<double>::infinity();
      box.hi[k] = -box.lo[k];
    }
    return box;
  }
  /// The same at both ends.
  static StepBox still(const double* lo, const double* hi) {
    StepBox box;
    for (int k = 0; k < 8; ++k) {
      box.lo[k] = k % 4 == 3 ? 0 : lo[k % 4];
      box.hi[k] = k % 4 == 3 ? 0 : hi[k % 4];
    }
    return box;
  }
  void add(const VertexMotion& vertex) {
    for (int k = 0; k < 4; ++k) {
      lo[k] = std::min(lo[k], vertex.t0[k]);
      hi[k] = std::max(hi[k], vertex.t0[k]);
      lo[4 + k] = std::min(lo[4 + k], vertex.t1[k]);
      hi[4 + k] = std::max(hi[4 + k], vertex.t1[k]);
    }
  }
  void add(const StepBox& other) {
    for (int k = 0; k < 8; ++k) {
      lo[k] = std::min(lo[k], other.lo[k]);
      hi[k] = std::max(hi[k], other.hi[k]);
    }
  }
  /// The largest coordinate, whatever its sign.
  double largest() const {
    double largest = 0;
    for (int k = 0; k < 8; ++k) largest = std::max({largest, std::abs(lo[k]), std::abs(hi[k])});
    return largest;
  }
  /// How far its corners reach along a direction in the step, or at its end alone.
  double reach(const Vec3& direction, bool at_end) const {
    double reach[2] = {0, 0};
    for (int k = 0; k < 8; ++k) {
      if (k % 4 < 3) reach[k / 4] += direction[k % 4] * (direction[k % 4] > 0 ? hi[k] : lo[k]);
    }
    return at_end ? reach[1] : std::max(reach[0], reach[1]);
  }
  /// Of its way through the step, or at its end alone.
  Vec3 middle(bool at_end) const {
    const Vec3 end(lo[4] + hi[4], lo[5] + hi[5], lo[6] + hi[6]);
    return at_end ? Vec3(end / 2) : Vec3((end + Vec3(lo[0] + hi[0], lo[1] + hi[1], lo[2] + hi[2])) / 4);
  }
  double length() const { return std::max({hi[4] - lo[4], hi[5] - lo[5], hi[6] - lo[6]}); }
};

/// The square of what two boxes are apart at least from the end `first` (0 or 1) of the step to t1, rounded down. The
/// gap on an axis is linear in t, so that it is least at one of the two times.
inline double squaredGap(const StepBox& a, const StepBox& b, int first) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double above = a.lo[4 + axis] - b.hi[4 + axis], below = b.lo[4 + axis] - a.hi[4 + axis];
    if (first == 0) {
      above = std::min(above, a.lo[axis] - b.hi[axis]);
      below = std::min(below, b.lo[axis] - a.hi[axis]);
    }
    const double gap = std::max(std::max(above, below), 0.0);
    sum += gap * gap;
  }
  return sum * (1 - tolerance::CLEARANCE_BOX);
}

/// What they are apart at least over the whole step [m].
inline double apartByBoxes(const StepBox& a, const StepBox& b) {
  return std::sqrt(squaredGap(a, b, 0)) * (1 - tolerance::CLEARANCE_BOX);
}

}  // namespace dccd
