// A box along axes that turn with the step: of things that face each other it is tight where one along x, y and z is
// not.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "step/clearance/step_box.h"

namespace dccd {

/// Three that are across each other, at either end of the step; the first one is n, the others turn little with it. In
/// between they are means, which make no vector longer.
struct TurningAxes {
  std::array<Turning, 3> axis;
  double column[2][3][4];  // at an end, of x, y and z: a part of each axis, and 0

  /// Of such ones the axes can be told. No part of an axis below is shorter than 0.4 before it is made a unit vector.
  static bool areNear(const Turning& n) { return n[0].dot(n[1]) > 0.9; }

  TurningAxes() = default;
  explicit TurningAxes(const Turning& n) {
    Eigen::Index least;
    n[1].cwiseAbs().minCoeff(&least);
    const Vec3 any = Vec3::Unit(least);
    for (std::size_t end = 0; end < 2; ++end) {
      axis[0][end] = n[end];
      axis[1][end] = (any - n[end] * n[end].dot(any)).normalized();
      axis[2][end] = n[end].cross(axis[1][end]).normalized();
      for (int k = 0; k < 3; ++k) {
        for (std::size_t of = 0; of < 3; ++of) column[end][k][of] = axis[of][end][k];
        column[end][k][3] = 0;
      }
    }
  }
};

/// From where to where each coefficient of Reach goes on each of the axes: those of one after those of the other.
struct TurnedBox {
  using Four = Eigen::Array4d;
  double lo[4 * Reach::COUNT], hi[4 * Reach::COUNT];

  static TurnedBox none() {
    constexpr double FAR = std::numeric_limits<double>::infinity();
    TurnedBox box;
    std::fill_n(box.lo, 4 * Reach::COUNT, FAR);
    std::fill_n(box.hi, 4 * Reach::COUNT, -FAR);
    return box;
  }
  static TurnedBox of(const StepBox& straight, const TurningAxes& axes) {
    TurnedBox box = none();
    for (std::size_t k = 0; k < 3; ++k) {
      const Turning &along = axes.axis[k], against{-along[0], -along[1]};
      for (std::size_t which = 0; which < Reach::COUNT; ++which) {
        box.hi[4 * which + k] = straight.reach(along, which);
        box.lo[4 * which + k] = -straight.reach(against, which);
      }
    }
    return box;
  }
  void add(const VertexMotion& vertex, const TurningAxes& axes) {
    const auto at = [&](int end, const double* p) -> Four {
      const auto& column = axes.column[end];
      return Eigen::Map<const Four>(column[0]) * p[0] + Eigen::Map<const Four>(column[1]) * p[1] +
             Eigen::Map<const Four>(column[2]) * p[2];
    };
    const std::array<Four, Reach::COUNT> places{at(0, vertex.t0), (at(0, vertex.t1) + at(1, vertex.t0)) * 0.5,
                                                at(1, vertex.t1)};
    for (std::size_t which = 0; which < Reach::COUNT; ++which) {
      Eigen::Map<Four> least(lo + 4 * which), most(hi + 4 * which);
      least = least.min(places[which]);
      most = most.max(places[which]);
    }
  }
  void add(const TurnedBox& other) {
    using All = Eigen::Array<double, 4 * Reach::COUNT, 1>;
    Eigen::Map<All> least(lo), most(hi);
    least = least.min(Eigen::Map<const All>(other.lo));
    most = most.max(Eigen::Map<const All>(other.hi));
  }
};

/// The square of what two are apart at least, in the step or at its end alone. slack_m: of each coordinate's rounding.
inline double squaredGap(const TurnedBox& a, const TurnedBox& b, double slack_m, bool at_end) {
  using Four = TurnedBox::Four;
  const auto map = [](const double* at, std::size_t which) { return Eigen::Map<const Four>(at + 4 * which); };
  Four above = map(a.lo, Reach::END) - map(b.hi, Reach::END), below = map(b.lo, Reach::END) - map(a.hi, Reach::END);
  for (std::size_t which = 0; which < Reach::END && !at_end; ++which) {
    above = above.min(map(a.lo, which) - map(b.hi, which));
    below = below.min(map(b.lo, which) - map(a.hi, which));
  }
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double gap = std::max(std::max(above[k], below[k]) - slack_m, 0.0);
    sum += gap > tolerance::CLEARANCE_DIRECTION_M ? gap * gap : 0;  // else the square may be rounded up
  }
  return sum * (1 - tolerance::CLEARANCE_BOX);
}

}  // namespace dccd
