// A box at both ends of a step: what is inside of it moves straight, so that it is inside of the box between in
// between.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "dccd/elementary.h"
#include "dccd/tolerances.h"
#include "dccd/types.h"

namespace dccd {

/// A direction that turns with the step: from the first of two unit vectors to the second, by way of their means.
using Turning = std::array<Vec3, 2>;

/// How far something that moves straight reaches along a turning direction n. Of a vertex p that is n.p, which is
/// quadratic in the time and a mean of its three Bernstein coefficients: these are the most of each.
struct Reach {
  enum : std::size_t { START, MIDDLE, END, COUNT };
  std::array<double, COUNT> most;

  static Reach none() {
    constexpr double NOWHERE = -std::numeric_limits<double>::infinity();
    return {{NOWHERE, NOWHERE, NOWHERE}};
  }
  static double of(const VertexMotion& vertex, const Turning& along, std::size_t which) {
    const auto dot = [](const Vec3& n, const double* p) { return n[0] * p[0] + n[1] * p[1] + n[2] * p[2]; };
    return which == START ? dot(along[0], vertex.t0)
           : which == END ? dot(along[1], vertex.t1)
                          : (dot(along[0], vertex.t1) + dot(along[1], vertex.t0)) / 2;
  }
  void add(const VertexMotion& vertex, const Turning& along) {
    for (std::size_t which = 0; which < COUNT; ++which) most[which] = std::max(most[which], of(vertex, along, which));
  }
  void add(const Reach& other) {
    for (std::size_t which = 0; which < COUNT; ++which) most[which] = std::max(most[which], other.most[which]);
  }
};

/// What two are apart at least, in the step or at its end alone, by their reaches along a turning direction and against
/// it. That is no longer than 1 on its way, so that it shortens no distance.
inline double apartBy(const Reach& a, const Reach& b, bool at_end) {
  double apart = -a.most[Reach::END] - b.most[Reach::END];
  for (std::size_t which = 0; which < Reach::END && !at_end; ++which)
    apart = std::min(apart, -a.most[which] - b.most[which]);
  return apart;
}

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
    for (int end = 0; end < 2; ++end) {
      const Eigen::Map<const Eigen::Array4d> at(end == 0 ? vertex.t0 : vertex.t1);
      Eigen::Map<Eigen::Array4d> least(lo + 4 * end), most(hi + 4 * end);
      least = least.min(at);
      most = most.max(at);
    }
  }
  void add(const StepBox& other) {
    using Eight = Eigen::Array<double, 8, 1>;
    Eigen::Map<Eight> least(lo), most(hi);
    least = least.min(Eigen::Map<const Eight>(other.lo));
    most = most.max(Eigen::Map<const Eight>(other.hi));
  }
  /// The largest coordinate, whatever its sign.
  double largest() const {
    double largest = 0;
    for (int k = 0; k < 8; ++k) largest = std::max({largest, std::abs(lo[k]), std::abs(hi[k])});
    return largest;
  }
  Reach reach(const Turning& along) const {
    return {{reach(along, Reach::START), reach(along, Reach::MIDDLE), reach(along, Reach::END)}};
  }
  double reach(const Turning& along, std::size_t which) const {
    const auto at = [&](int end, const Vec3& n) {
      double sum = 0;
      for (int k = 0; k < 3; ++k) sum += n[k] * (n[k] > 0 ? hi : lo)[4 * end + k];
      return sum;
    };
    return which == Reach::START ? at(0, along[0])
           : which == Reach::END ? at(1, along[1])
                                 : (at(1, along[0]) + at(0, along[1])) / 2;
  }
  Vec3 middle(int end) const {
    const int k = 4 * end;
    return Vec3(lo[k] + hi[k], lo[k + 1] + hi[k + 1], lo[k + 2] + hi[k + 2]) / 2;
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
    sum += gap > tolerance::CLEARANCE_DIRECTION_M ? gap * gap : 0;  // else the square may be rounded up
  }
  return sum * (1 - tolerance::CLEARANCE_BOX);
}

/// What they are apart at least over the whole step [m].
inline double apartByBoxes(const StepBox& a, const StepBox& b) {
  return std::sqrt(squaredGap(a, b, 0)) * (1 - tolerance::CLEARANCE_BOX);
}

}  // namespace dccd
