// Polynomials of degree up to three with integer coefficients, and their real roots, without isolating them: a root is
// named by the monotone piece of the polynomial that it lies in, so every question about it ends in the signs of a few
// determinants. No loop depends on how close two numbers are, and equal numbers are found equal.
//
// Two kinds of roots are enough. A root of a quadratic g with leading coefficient g2 > 0 is (-g1 -+ sqrt(D)) / 2 g2;
// a polynomial reduced modulo g to a line b + a t has the sign of (2 g2 b - a g1) -+ a sqrt(D) there, decided by
// squaring. A simple root r of a cubic f is told from a point x by the signs of f, f' and f'' at x; the sign of a
// quadratic q at r follows from where r lies among the roots of q, at which f, f' and f'' have signs as above.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "dccd/tolerances.h"
#include "elementary/exact_integer.h"

namespace dccd {
namespace exact {

/// c[0] + c[1] t + ... + c[D] t^D.
template <class Z, int D>
struct Polynomial {
  Z c[D + 1];

  /// -1 for the zero polynomial.
  int degree() const {
    int d = D;
    while (d >= 0 && c[d].sign() == 0) --d;
    return d;
  }
  Polynomial negated() const {
    Polynomial result;
    for (int i = 0; i <= D; ++i) result.c[i] = -c[i];
    return result;
  }
  Polynomial<Z, D - 1> derivative() const {
    Polynomial<Z, D - 1> result;
    for (int i = 1; i <= D; ++i) result.c[i - 1] = i == 1 ? c[1] : c[i] * i;
    return result;
  }
};

template <class Z>
using Quadratic = Polynomial<Z, 2>;
template <class Z>
using Cubic = Polynomial<Z, 3>;

/// Sign at numerator / 2^bits.
template <class Z, int D>
int signAtDyadic(const Polynomial<Z, D>& p, std::int64_t numerator, int bits) {
  if (numerator == 0) return p.c[0].sign();
  Z value = p.c[D];
  for (int i = D - 1; i >= 0; --i) value = value * numerator + (p.c[i] << (bits * (D - i)));
  return value.sign();
}

/// A polynomial's coefficients divided by one common power of two, each with relative error below 2^-52 (or an absolute
/// one below 2^-1000, the largest being about 1).
template <int D>
struct DoublePolynomial {
  double c[D + 1];

  template <class Z>
  explicit DoublePolynomial(const Polynomial<Z, D>& p) {
    ScaledDouble scaled[D + 1];
    long largest = 0;
    bool any = false;
    for (int i = 0; i <= D; ++i) {
      scaled[i] = p.c[i].approximate();
      if (scaled[i].mantissa == 0) continue;
      largest = any ? std::max(largest, scaled[i].exponent) : scaled[i].exponent;
      any = true;
    }
    for (int i = 0; i <= D; ++i) {
      const long exponent = std::max(scaled[i].exponent - largest, -1100L);
      c[i] = std::ldexp(scaled[i].mantissa, static_cast<int>(exponent));
    }
  }

  double at(double t) const {
    double value = c[D];
    for (int i = D - 1; i >= 0; --i) value = value * t + c[i];
    return value;
  }
};

inline int signOf(double value) { return (value > 0) - (value < 0); }

/// A subinterval of [0,1] in doubles: [middle - radius, middle + radius], both exact.
struct Enclosure {
  double middle = 0;
  double radius = 0;
};

/// Sign of q on all of the enclosure, or 0 when doubles cannot tell. With S = sum |c_i|: moving by the radius changes q
/// by at most 2 S radius, coefficients and Horner's scheme err by less than (2^-52 + 4 * 2^-53) S: as much as another
/// 3 * 2^-53 of radius. QUADRATIC_TIME is used, and 2.5 for 2, which covers the rounding of the bound itself, too.
template <class Z>
int filteredSign(const Quadratic<Z>& q, const Enclosure& enclosure) {
  const DoublePolynomial<2> p(q);
  const double sum = std::fabs(p.c[0]) + std::fabs(p.c[1]) + std::fabs(p.c[2]);
  const double bound =
      tolerance::QUADRATIC_SIGN * sum * (enclosure.radius + tolerance::QUADRATIC_TIME) + tolerance::QUADRATIC_UNDERFLOW;
  const double value = p.at(enclosure.middle);
  return value > bound ? 1 : value < -bound ? -1 : 0;
}

/// The real roots of a polynomial of degree 1 or 2, made to have a positive leading coefficient.
template <class Z>
class QuadraticRoots {
 public:
  enum Which { SMALLER = -1, LARGER = 1 };  ///< of the two; the same number when the discriminant is 0, or of degree 1

  /// g must not be constant.
  explicit QuadraticRoots(const Quadratic<Z>& g) : g_(g), degree_(g.degree()) {
    if (g_.c[degree_].sign() < 0) g_ = g_.negated();
    if (degree_ == 2) discriminant_ = g_.c[1] * g_.c[1] - ((g_.c[0] * g_.c[2]) << 2);
  }

  /// Distinct real roots.
  int count() const { return degree_ == 1 ? 1 : discriminant_.sign() + 1; }

  int signAt(const Cubic<Z>& p, Which which) const {
    if (p.c[3].sign() == 0) return signAt(Quadratic<Z>{{p.c[0], p.c[1], p.c[2]}}, which);
    if (degree_ == 1) return signAtRational(p);
    const Z& g2 = g_.c[2];  // g2 p - p3 t g: of degree 2, with the sign of p at the roots of g because g2 > 0
    return signAt(Quadratic<Z>{{g2 * p.c[0], g2 * p.c[1] - p.c[3] * g_.c[0], g2 * p.c[2] - p.c[3] * g_.c[1]}}, which);
  }

  int signAt(const Quadratic<Z>& p, Which which) const {
    if (degree_ == 1) return signAtRational(p);
    if (p.c[2].sign() == 0) return signAt(Polynomial<Z, 1>{{p.c[0], p.c[1]}}, which);
    const Z& g2 = g_.c[2];
    return signAt(Polynomial<Z, 1>{{g2 * p.c[0] - p.c[2] * g_.c[0], g2 * p.c[1] - p.c[2] * g_.c[1]}}, which);
  }

  int signAt(const Polynomial<Z, 1>& line, Which which) const {
    if (degree_ == 1) return signAtRational(line);
    const Z rational = ((g_.c[2] * line.c[0]) << 1) - line.c[1] * g_.c[1];
    const int rational_sign = rational.sign();
    const int surd_sign = which * line.c[1].sign() * discriminant_.sign();
    if (rational_sign == surd_sign || surd_sign == 0) return rational_sign;
    if (rational_sign == 0) return surd_sign;
    const int larger = (rational * rational - line.c[1] * line.c[1] * discriminant_).sign();
    return larger == 0 ? 0 : larger > 0 ? rational_sign : surd_sign;
  }

 private:
  template <int D>
  int signAtRational(const Polynomial<Z, D>& p) const {  // at -g0 / g1, g1 > 0
    const Z numerator = -g_.c[0];
    Z value = p.c[D];
    Z power(1);
    for (int i = D - 1; i >= 0; --i) {
      power = power * g_.c[1];
      value = value * numerator + p.c[i] * power;
    }
    return value.sign();
  }

  Quadratic<Z> g_;
  int degree_;
  Z discriminant_;
};

/// The names of roots: of a quadratic (SMALLER also names the root of a line), of a cubic by its monotone pieces.
enum class RootLabel { SMALLER, LARGER, ONLY, RISING_FIRST, FALLING, RISING_LAST };

/// Sign of x - r from the signs of the polynomial (leading coefficient > 0), its first and its second derivative at x.
/// The derivatives are functions, since not every label needs them.
template <class First, class Second>
int compareBySigns(RootLabel label, int value, First first, Second second) {
  switch (label) {
    case RootLabel::SMALLER:
      return first() <= 0 ? -value : 1;
    case RootLabel::LARGER:
      return first() >= 0 ? value : -1;
    case RootLabel::ONLY:
      return value;
    case RootLabel::RISING_FIRST:  // left of the maximum
      return first() >= 0 && second() < 0 ? value : 1;
    case RootLabel::FALLING:  // between the maximum and the minimum
      return first() <= 0 ? -value : second();
    case RootLabel::RISING_LAST:  // right of the minimum
      return first() >= 0 && second() > 0 ? value : -1;
  }
  return 0;
}

}  // namespace exact
}  // namespace dccd
