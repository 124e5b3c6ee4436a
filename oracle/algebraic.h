// Polynomials with integer coefficients and their real roots in [0,1], exact: the arithmetic of the oracle.
// Made to be read and believed, not to be fast; shares nothing with src/elementary. Roots are isolated between the
// roots of the derivative (no Sturm sequences, no Bernstein coefficients, no floating point).
#pragma once

#include <boost/multiprecision/gmp.hpp>
#include <utility>
#include <vector>

namespace dccd {
namespace test {

using Integer = boost::multiprecision::number<boost::multiprecision::gmp_int, boost::multiprecision::et_off>;
using Rational = boost::multiprecision::number<boost::multiprecision::gmp_rational, boost::multiprecision::et_off>;

/// numerator / 2^exponent.
struct Dyadic {
  Integer numerator = 0;
  unsigned exponent = 0;
  /// The same number with a larger exponent.
  Dyadic withExponent(unsigned larger) const { return {numerator << (larger - exponent), larger}; }
  Rational rational() const { return Rational(numerator, Integer(1) << exponent); }
  /// Any finite double that is not negative.
  static Dyadic fromDouble(double value);
};
int compare(const Dyadic& a, const Dyadic& b);

/// Coefficients in ascending order of degree, without leading zeros; none for the zero polynomial.
class Polynomial {
 public:
  Polynomial() = default;
  explicit Polynomial(std::vector<Integer> coefficients);
  bool isZero() const { return coefficients_.empty(); }
  int degree() const { return static_cast<int>(coefficients_.size()) - 1; }
  const std::vector<Integer>& coefficients() const { return coefficients_; }

  Polynomial derivative() const;
  /// Divided by the greatest common divisor of the coefficients: the same roots and signs from smaller numbers.
  Polynomial primitive() const;
  int signAt(const Dyadic& t) const;
  /// The sign on the whole of [lo,hi] within [0,1] where a bound on the slope proves it; else 0.
  int certainSign(const Dyadic& lo, const Dyadic& hi) const;

  friend Polynomial operator+(const Polynomial& a, const Polynomial& b);
  friend Polynomial operator-(const Polynomial& a, const Polynomial& b);
  friend Polynomial operator*(const Polynomial& a, const Polynomial& b);

 private:
  Integer scaledValueAt(const Dyadic& t) const;  // times 2^(exponent * degree)
  std::vector<Integer> coefficients_;
};

/// A greatest common divisor over the rationals, primitive.
Polynomial gcd(Polynomial a, Polynomial b);

/// A real algebraic number in [0,1]: a dyadic number, or the only root of a polynomial in an open interval at whose
/// ends the polynomial has opposite signs; it is a simple root.
class Root {
 public:
  explicit Root(const Dyadic& exact) : lo_(exact), hi_(exact) {}
  Root(Polynomial polynomial, const Dyadic& lo, const Dyadic& hi);

  bool isExact() const { return compare(lo_, hi_) == 0; }
  const Dyadic& lo() const { return lo_; }
  const Dyadic& hi() const { return hi_; }
  /// Halves the interval so many times, or fewer where the root turns out to be dyadic.
  void refine(int halvings = 1);
  /// Refines until the interval is at most 2^-bits wide.
  void refineTo(unsigned bits);
  /// The exact sign of q at this number. Where it is not 0, q keeps it on the whole of [lo,hi] afterwards.
  int signOf(const Polynomial& q);
  /// Sign of this number minus the other.
  int compareWith(const Dyadic& other) const;
  int compareWith(Root& other);
  /// floor(this * 2^bits), exact also where this is a point of that grid.
  Integer cell(int bits);

 private:
  bool isRootOf(const Polynomial& q) const;  // not for exact numbers
  Polynomial polynomial_;                    // zero where the number is exact
  Dyadic lo_, hi_;
  int sign_at_lo_ = 0;
};

/// All distinct roots in [0,1] in ascending order. The polynomial must not be zero.
std::vector<Root> rootsInUnitInterval(const Polynomial& polynomial);

/// A dyadic number strictly between; a must be less than b.
Dyadic strictlyBetween(Root& a, Root& b);

}  // namespace test
}  // namespace dccd
