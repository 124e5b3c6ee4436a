// The distinct real roots in [0,1] of a polynomial of degree up to three, in increasing order, each with its cell of
// the dyadic grid and the exact sign of any quadratic at it. See exact_algebra.h for the method.
#pragma once

#include <cstdint>

#include "elementary/exact_algebra.h"

namespace dccd {
namespace exact {

template <class Z>
class PolynomialRoots {
 public:
  /// f must not be the zero polynomial. The grid has 2^grid_bits cells over [0,1].
  PolynomialRoots(const Cubic<Z>& f, int grid_bits) : f_(f), grid_bits_(grid_bits), degree_(f.degree()) {
    if (degree_ < 1) return;
    if (f_.c[degree_].sign() < 0) f_ = f_.negated();
    if (degree_ == 3) {
      nameCubicRoots();
    } else {
      setQuadratic({{f_.c[0], f_.c[1], f_.c[2]}});
      QuadraticRoots<Z> roots(quadratic_);
      if (roots.count() == 2) keepInUnitInterval(RootLabel::SMALLER);
      if (roots.count() >= 1) keepInUnitInterval(RootLabel::LARGER);
    }
  }

  int count() const { return count_; }

  /// floor(r 2^grid_bits) for root i; 2^grid_bits for a root at 1.
  std::int64_t cell(int i) {
    if (cells_[i] < 0) cells_[i] = locate(labels_[i]);
    return cells_[i];
  }

  /// Sign of q at root i.
  int signAt(int i, const Quadratic<Z>& q) {
    const int degree = q.degree();
    if (degree <= 0) return degree < 0 ? 0 : q.c[0].sign();
    const double width = std::ldexp(1.0, -grid_bits_);
    const Enclosure enclosure = {(static_cast<double>(cell(i)) + 0.5) * width, 0.5 * width};
    const int filtered = filteredSign(q, enclosure);
    if (filtered != 0) return filtered;
    const int on_cell = signOnCell(q, cell(i));
    if (on_cell != 0) return on_cell;
    const RootLabel label = labels_[i];
    if (label == RootLabel::SMALLER || label == RootLabel::LARGER) {
      using Which = typename QuadraticRoots<Z>::Which;
      return QuadraticRoots<Z>(quadratic_).signAt(q, label == RootLabel::SMALLER ? Which::SMALLER : Which::LARGER);
    }
    return signAtCubicRoot(label, q);
  }

 private:
  /// The sign of q on the whole of a grid cell: that of its Bernstein coefficients there, or 0 where they differ. These
  /// are taken times 4^grid_bits and, the middle one, 2.
  int signOnCell(const Quadratic<Z>& q, std::int64_t k) const {
    const Z along = q.c[1] << grid_bits_, square = q.c[2] * k;
    const Z first = (q.c[0] << (2 * grid_bits_)) + (along + square) * k, slope = along + square * 2;
    const int sign = first.sign();
    if (sign == 0 || (first * 2 + slope).sign() != sign || (first + slope + q.c[2]).sign() != sign) return 0;
    return sign;
  }

  /// f of degree 3. Its extrema exist when e = c2^2 - 3 c3 c1 > 0; f there is positive at the first and negative at the
  /// second exactly when the discriminant is positive; otherwise both have the sign of f at the inflection, which is
  /// their mean (one of them may be zero: a double root, then a root of f').
  void nameCubicRoots() {
    first_ = f_.derivative();
    second_ = first_.derivative();
    const Z &c0 = f_.c[0], &c1 = f_.c[1], &c2 = f_.c[2], &c3 = f_.c[3];
    const Z c31 = c3 * c1, c22 = c2 * c2;
    const Z e = c22 - c31 * 3;
    const Z inflection = (c22 * c2) * 2 - (c31 * c2) * 9 + (c3 * c3 * c0) * 27;  // 27 c3^2 times f there
    if (e.sign() <= 0) {
      const bool triple = e.sign() == 0 && inflection.sign() == 0;
      if (triple) setQuadratic(first_);
      keepInUnitInterval(triple ? RootLabel::LARGER : RootLabel::ONLY);
      return;
    }
    // discriminant = c2^2 c1^2 - 4 c3 c1^3 - 27 c3^2 c0^2 + 18 c3 c2 c1 c0 - 4 c2^3 c0; the last three are grouped
    const Z discriminant =
        (c22 - (c31 << 2)) * (c1 * c1) - c0 * (c3 * c3 * c0 * 27 - c31 * c2 * 18 + ((c22 * c2) << 2));
    if (discriminant.sign() > 0) {
      keepInUnitInterval(RootLabel::RISING_FIRST);
      keepInUnitInterval(RootLabel::FALLING);
      keepInUnitInterval(RootLabel::RISING_LAST);
    } else if (discriminant.sign() < 0) {
      keepInUnitInterval(inflection.sign() > 0 ? RootLabel::RISING_FIRST : RootLabel::RISING_LAST);
    } else {
      setQuadratic(first_);
      if (inflection.sign() > 0) keepInUnitInterval(RootLabel::RISING_FIRST);
      keepInUnitInterval(inflection.sign() > 0 ? RootLabel::LARGER : RootLabel::SMALLER);
      if (inflection.sign() < 0) keepInUnitInterval(RootLabel::RISING_LAST);
    }
  }

  void setQuadratic(const Quadratic<Z>& g) {
    quadratic_ = g;
    quadratic_first_ = g.derivative();
  }

  void keepInUnitInterval(RootLabel label) {
    if (compare(label, 0, 0) > 0 || compare(label, 1, 0) < 0) return;
    cells_[count_] = -1;
    labels_[count_++] = label;
  }

  /// Sign of numerator / 2^bits - r.
  int compare(RootLabel label, std::int64_t numerator, int bits) const {
    if (label == RootLabel::SMALLER || label == RootLabel::LARGER) {
      return compareBySigns(
          label, signAtDyadic(quadratic_, numerator, bits),
          [&] { return signAtDyadic(quadratic_first_, numerator, bits); }, [] { return 0; });
    }
    return compareBySigns(
        label, signAtDyadic(f_, numerator, bits), [&] { return signAtDyadic(first_, numerator, bits); },
        [&] { return signAtDyadic(second_, numerator, bits); });
  }

  /// The root's cell: guessed in double, then certified by exact comparisons with the grid points around the guess,
  /// galloping away from it when it was wrong.
  std::int64_t locate(RootLabel label) const {
    const std::int64_t end = std::int64_t{1} << grid_bits_;
    const auto notAfterRoot = [&](std::int64_t k) { return k <= end && compare(label, k, grid_bits_) <= 0; };
    std::int64_t low = guess(label), high = low + 1;
    for (std::int64_t step = 1; !notAfterRoot(low); step *= 2) {  // ends at 0, which is not after the root
      high = low;
      low = std::max<std::int64_t>(0, low - step);
    }
    for (std::int64_t step = 1; notAfterRoot(high); step *= 2) {
      low = high;
      high = std::min(high + step, end + 1);
    }
    while (high - low > 1) {
      const std::int64_t middle = low + (high - low) / 2;
      (notAfterRoot(middle) ? low : high) = middle;
    }
    return low;
  }

  /// About floor(r 2^grid_bits), by bisection in double.
  std::int64_t guess(RootLabel label) const {
    const bool quadratic = label == RootLabel::SMALLER || label == RootLabel::LARGER;
    const DoublePolynomial<3> p(quadratic ? Cubic<Z>{{quadratic_.c[0], quadratic_.c[1], quadratic_.c[2], Z()}} : f_);
    double low = 0, high = 1;
    for (int i = 0; i < grid_bits_; ++i) {
      const double x = 0.5 * (low + high);
      const int after = compareBySigns(
          label, signOf(p.at(x)), [&] { return signOf(p.c[1] + x * (2 * p.c[2] + 3 * x * p.c[3])); },
          [&] { return signOf(2 * p.c[2] + 6 * x * p.c[3]); });
      (after <= 0 ? low : high) = x;
    }
    return static_cast<std::int64_t>(std::ldexp(low, grid_bits_));
  }

  /// From the position of the cubic's simple root r among the roots of q, which is not constant.
  int signAtCubicRoot(RootLabel label, const Quadratic<Z>& q) const {
    const QuadraticRoots<Z> roots(q);
    const int leading = q.c[q.degree()].sign();
    if (roots.count() == 0) return leading;
    using Which = typename QuadraticRoots<Z>::Which;
    const auto fromRoot = [&](Which which) {  // sign of (root of q) - r
      return compareBySigns(
          label, roots.signAt(f_, which), [&] { return roots.signAt(first_, which); },
          [&] { return roots.signAt(second_, which); });
    };
    const int larger = fromRoot(Which::LARGER);
    if (larger <= 0) return larger == 0 ? 0 : leading;
    if (roots.count() == 1) return q.degree() == 1 ? -leading : leading;
    const int smaller = fromRoot(Which::SMALLER);
    return smaller == 0 ? 0 : smaller > 0 ? leading : -leading;
  }

  Cubic<Z> f_;          ///< leading coefficient > 0
  Quadratic<Z> first_;  ///< derivatives of f, where its degree is 3
  Polynomial<Z, 1> second_;
  Quadratic<Z> quadratic_;  ///< what SMALLER and LARGER are roots of: f, or f' for a repeated root
  Polynomial<Z, 1> quadratic_first_;
  int grid_bits_;
  int degree_;
  int count_ = 0;
  RootLabel labels_[3] = {};
  std::int64_t cells_[3] = {};
};

}  // namespace exact
}  // namespace dccd
