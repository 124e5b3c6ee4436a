// A box at both ends of a step: what is inside of it moves straight, so that it is inside of the box between in
// between.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "dccd/types.h"
#include "step/clearance/margins.h"

namespace dccd {

struct StepBox {
  double lo[2][3], hi[2][3];  ///< at t0, at t1

  static StepBox none() {
    StepBox box;
    for (auto& end : box.lo) std::fill(end, end + 3, std::numeric_limits<double>::infinity());
    for (auto& end : box.hi) std::fill(end, end + 3, -std::numeric_limits<double>::infinity());
    return box;
  }
  void add(int end, const Vec3& point) {
    for (int axis = 0; axis < 3; ++axis) {
      lo[end][axis] = std::min(lo[end][axis], point[axis]);
      hi[end][axis] = std::max(hi[end][axis], point[axis]);
    }
  }
  void add(const StepBox& other) {
    for (int end = 0; end < 2; ++end) {
      for (int axis = 0; axis < 3; ++axis) {
        lo[end][axis] = std::min(lo[end][axis], other.lo[end][axis]);
        hi[end][axis] = std::max(hi[end][axis], other.hi[end][axis]);
      }
    }
  }
  double length() const {
    double most = 0;
    for (int axis = 0; axis < 3; ++axis) most = std::max(most, hi[1][axis] - lo[1][axis]);
    return most;
  }
};

/// What two boxes are apart at least from the end `first` (0 or 1) of the step to t1, rounded down. The gap on an axis
/// is linear in t, so that it is least at one of the two times.
inline double apart(const StepBox& a, const StepBox& b, int first) {
  double sum = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double above = a.lo[1][axis] - b.hi[1][axis], below = b.lo[1][axis] - a.hi[1][axis];
    if (first == 0) {
      above = std::min(above, a.lo[0][axis] - b.hi[0][axis]);
      below = std::min(below, b.lo[0][axis] - a.hi[0][axis]);
    }
    const double gap = std::max({above, below, 0.0});
    sum += gap * gap;
  }
  return std::sqrt(sum) * (1 - tolerance::CLEARANCE_BOX);
}

}  // namespace dccd
