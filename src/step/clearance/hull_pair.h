// How far apart are two features, or a feature and a box, that move straight? Bounds from below and from above that
// hold for every finite input.
//
// Either one is the convex hull of its corners. From below: for a unit vector n the distance is at least
// min n.a - max n.b over the corners a and b. From above: it is at most that of two points, which are means of corners.
// Neither needs the search for n and the points to be right, only the arithmetic of these two lines to be bounded.
//
// Rounding. u = HALF_ULP. All corners are taken relative to one of them (one rounding each) and scaled by a power of
// two, so that the largest coordinate is in [1, 2); 2 stands for it here. A corner at the time t is (1 - t) p + t q,
// where t is a multiple of 2^-52, so that 1 - t is exact: off by at most 3 u 2 + u 2 = 8 u on each axis.
// - n.a of a computed n: 3 u sqrt(3) 2 for its own operations, sqrt(3) 8 u for the corner's error, 25 u in all; the
//   difference of two: 50 u and its own rounding, 7 u, as no distance is above 2 sqrt(3) 2 < 7. n is no longer than
//   1 + 8 u, which is 56 u of a distance. In all 113 u. The mean of two such products is rounded once more: 120 u.
// - A mean of corners: weights add up to 1 within 6 u, 21 u of a length; its operations 3 u sqrt(3) 2, the corners'
//   error sqrt(3) 8 u; 46 u in all. The difference of two 92 u, and its length's own roundings 4 u of it, 28 u. In all
//   120 u.
// CLEARANCE is 256 u, of the power of two that is not above the largest coordinate.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "dccd/types.h"

namespace dccd {

/// A vertex, an edge, a face (1 to 3 corners) or a box (8) at both ends of a step [m].
struct MovingHull {
  std::size_t count = 0;
  std::array<Vec3, 8> t0, t1;

  void addCorner(const Vec3& from, const Vec3& to) {
    t0[count] = from;
    t1[count++] = to;
  }
  /// Corner i is at hi on the axes whose bit is set in i.
  static MovingHull box(const double* lo, const double* hi) {
    MovingHull hull;
    for (int i = 0; i < 8; ++i) {
      const Vec3 corner(i & 1 ? hi[0] : lo[0], i & 2 ? hi[1] : lo[1], i & 4 ? hi[2] : lo[2]);
      hull.addCorner(corner, corner);
    }
    return hull;
  }
};

/// At one time. In HullPair's own unit, which scale_m turns into metres.
struct Nearest {
  double lower = 0, upper = 0;    ///< of the distance
  Vec3 direction = Vec3::Zero();  ///< from the second to the first, that gave `lower`; zero: none
  std::array<Vec3, 2> point;      ///< as far apart as `upper` says
};

class HullPair {
 public:
  /// All coordinates must be below CLEARANCE_LARGEST_M.
  void set(const MovingHull& a, const MovingHull& b);

  /// The bounds at a time, a multiple of 2^-52, no further apart than `wide_m` or 1e-9 of the distance where the search
  /// finds the nearest points, which it does but for rounding.
  Nearest at(double t, double wide_m);
  /// How far apart they are at least in an interval of time, by a unit vector (or zero) at either end. Each bounds all
  /// of it: min n.a - max n.b is concave in t. So do the two together: with n(s) = (1 - s) n0 + s n1, no longer than 1,
  /// the products n.a - n.b are quadratic in s, and not below their Bernstein coefficients: those of n0 at the first
  /// end, of n1 at the last, and the mean of n0 at the last and n1 at the first. Of features that turn, as their normal
  /// does, the single ones err by the interval's length, the two together by its square.
  double lowerOver(const std::array<Vec3, 2>& direction, double from, double to) const;

  double lowerInMetres(double lower) const;
  double upperInMetres(double upper) const;
  Vec3 pointInMetres(const Vec3& point) const { return origin_ + point * scale_m_; }

 private:
  struct Combination;
  struct Simplex;
  void goTo(double t);
  double along(const Vec3& direction, std::size_t& a, std::size_t& b) const;
  void improve(Nearest& nearest) const;
  void takeMeans(const Simplex& simplex, const Combination& of, Nearest& nearest) const;
  void tryDirection(Vec3 direction, Nearest& nearest) const;
  void tryThrough(std::size_t side, const std::array<std::uint8_t, 2>& edge,
                  const std::array<std::uint8_t, 3>& triangle, Nearest& nearest) const;

  std::array<std::size_t, 2> count_{};
  std::array<std::array<Vec3, 8>, 2> t0_, t1_, now_;
  double time_ = -1;
  Vec3 origin_ = Vec3::Zero();
  double scale_m_ = 1;
};

}  // namespace dccd
