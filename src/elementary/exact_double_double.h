// Signs of a pair's coplanarity cubic f at single times in double-double arithmetic (about 106 bits), with a proved
// bound: what brackets a root within 2^-52 where plain doubles leave a wide bracket, for the TOC's cell and for a sharp
// inside test. No fused multiply-add is needed, so every machine computes the same bits.
#pragma once

#include <cstdint>

#include "dccd/elementary.h"

namespace dccd {
namespace exact {

/// An unevaluated sum.
struct DoubleDouble {
  double hi, lo;
};

/// fl(a + b) and its error, exactly.
inline DoubleDouble twoSum(double a, double b) {
  const double sum = a + b, part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

/// A double in two halves of at most 26 bits each, so that products of halves are exact.
struct Halves {
  double hi, lo;
  explicit Halves(double x) {
    const double scaled = 134217729.0 * x;  // 2^27 + 1
    hi = scaled - (scaled - x);
    lo = x - hi;
  }
};

/// fl(a b) and its error, exactly (Dekker).
inline DoubleDouble twoProduct(double a, const Halves& ah, double b, const Halves& bh) {
  const double product = a * b;
  return {product, ((ah.hi * bh.hi - product) + ah.hi * bh.lo + ah.lo * bh.hi) + ah.lo * bh.lo};
}

/// f = (u x v).w with VF (p; a b c): u = b-a, v = c-a, w = p-a; EE (a b; c d): u = b-a, v = d-c, w = c-a.
class CoplanarityCubic {
 public:
  CoplanarityCubic(PairKind kind, const PairMotion& pair);

  /// f(t) at a multiple of 2^-52 in [0,1]; exact f differs by at most error(), and by what rounding that to one double
  /// takes, which changes no sign.
  double valueAt(double t) const;
  double error() const { return error_; }

  /// The same in plain double, within roughError().
  double roughValueAt(double t) const;
  double roughError() const { return rough_error_; }

  /// Sign of f at a multiple of 2^-52 in [0,1]; 0 where it is zero, or the arithmetic cannot tell.
  int signAt(double t) const;
  /// The same where value is valueAt(t), or by exactSignAt() if that leaves it open.
  int signOf(double value, double t) const { return value > error_ ? 1 : value < -error_ ? -1 : exactSignAt(t); }
  /// The same by exact sums, for terms of all sizes; 0 also where they would be too long, or leave the range of
  /// doubles.
  int exactSignAt(double t) const;

  /// f'(t) at a multiple of 2^-52 in [0,1] in plain double; exact f' differs by at most slopeError().
  double slopeAt(double t) const;
  double slopeError() const { return slope_error_; }
  /// At least half of max |f''| over [0,1].
  double mostCurvature() const { return most_curvature_; }

  /// Rounded component k of u, v or w (i = 0, 1, 2) at time 0 or 1.
  double difference(int time, int i, int k) const { return difference_[time][i][k].hi; }
  /// Largest absolute value of those of u, v or w.
  double size(int i) const { return size_[i]; }

 private:
  DoubleDouble difference_[2][3][3];  // at t = 0 and 1; u, v, w; axis
  double size_[3];
  double error_;  // infinite where the differences are too large or too small for the bound
  double rough_error_;
  double slope_error_;
  double most_curvature_;
};

/// The cell k of the 2^-toc_bits grid that holds the only root of f in the open interval (lo, hi), at whose
/// ends f has opposite signs; lo < hi, both multiples of 2^-52 in [0,1]. -1 where the arithmetic cannot tell.
std::int64_t cellOfRoot(const CoplanarityCubic& f, double lo, double hi, int toc_bits);

}  // namespace exact
}  // namespace dccd
