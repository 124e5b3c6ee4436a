#include "oracle/algebraic.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace dccd {
namespace test {
namespace {

void stripZeros(std::vector<Integer>& coefficients) {
  while (!coefficients.empty() && coefficients.back().is_zero()) coefficients.pop_back();
}

/// Both with one exponent, so that their numerators can be compared and added.
std::pair<Dyadic, Dyadic> aligned(const Dyadic& a, const Dyadic& b) {
  const unsigned exponent = std::max(a.exponent, b.exponent);
  return {a.withExponent(exponent), b.withExponent(exponent)};
}

/// The remainder of a by b, times some nonzero integer.
Polynomial pseudoRemainder(const Polynomial& a, const Polynomial& b) {
  std::vector<Integer> rest = a.coefficients();
  const std::vector<Integer>& divisor = b.coefficients();
  while (rest.size() >= divisor.size()) {
    const Integer leading = rest.back();
    const std::size_t shift = rest.size() - divisor.size();
    for (Integer& c : rest) c *= divisor.back();
    for (std::size_t i = 0; i < divisor.size(); ++i) rest[i + shift] -= leading * divisor[i];
    stripZeros(rest);
  }
  return Polynomial(std::move(rest));
}

}  // namespace

Dyadic Dyadic::fromDouble(double value) {
  if (!(value >= 0) || std::isinf(value)) throw std::invalid_argument("not a finite number >= 0");
  int exponent = 0;
  const double mantissa = std::frexp(value, &exponent);  // value = mantissa * 2^exponent, mantissa in [0.5,1)
  const Integer digits(static_cast<long long>(std::ldexp(mantissa, 53)));
  const int shift = exponent - 53;
  if (shift >= 0) return {digits << shift, 0};
  return {digits, static_cast<unsigned>(-shift)};
}

int compare(const Dyadic& a, const Dyadic& b) {
  const auto both = aligned(a, b);
  return both.first.numerator.compare(both.second.numerator);
}

Polynomial::Polynomial(std::vector<Integer> coefficients) : coefficients_(std::move(coefficients)) {
  stripZeros(coefficients_);
}

Polynomial Polynomial::derivative() const {
  std::vector<Integer> result;
  for (std::size_t i = 1; i < coefficients_.size(); ++i) result.push_back(coefficients_[i] * static_cast<long>(i));
  return Polynomial(std::move(result));
}

Polynomial Polynomial::primitive() const {
  Integer content = 0;
  for (const Integer& c : coefficients_) content = boost::multiprecision::gcd(content, c);
  if (content.is_zero() || content == 1) return *this;
  std::vector<Integer> result = coefficients_;
  for (Integer& c : result) c /= content;
  return Polynomial(std::move(result));
}

Integer Polynomial::scaledValueAt(const Dyadic& t) const {
  Integer value = 0;
  unsigned shift = 0;
  for (auto c = coefficients_.rbegin(); c != coefficients_.rend(); ++c, shift += t.exponent) {
    value = value * t.numerator + (*c << shift);
  }
  return value;
}

int Polynomial::signAt(const Dyadic& t) const { return scaledValueAt(t).sign(); }

int Polynomial::certainSign(const Dyadic& lo, const Dyadic& hi) const {
  const auto both = aligned(lo, hi);
  const Integer value = scaledValueAt(both.first);
  if (degree() < 1) return value.sign();
  // |p(t) - p(lo)| <= (hi - lo) * sum of i |c_i| for lo, hi and t in [0,1]; all times 2^(exponent * degree).
  Integer slope = 0;
  for (std::size_t i = 1; i < coefficients_.size(); ++i) slope += abs(coefficients_[i]) * static_cast<long>(i);
  const Integer width = both.second.numerator - both.first.numerator;
  const Integer change = (width * slope) << (both.first.exponent * static_cast<unsigned>(degree() - 1));
  return abs(value) > change ? value.sign() : 0;
}

Polynomial operator+(const Polynomial& a, const Polynomial& b) {
  std::vector<Integer> sum = a.coefficients_;
  if (sum.size() < b.coefficients_.size()) sum.resize(b.coefficients_.size());
  for (std::size_t i = 0; i < b.coefficients_.size(); ++i) sum[i] += b.coefficients_[i];
  return Polynomial(std::move(sum));
}

Polynomial operator-(const Polynomial& a, const Polynomial& b) {
  std::vector<Integer> difference = a.coefficients_;
  if (difference.size() < b.coefficients_.size()) difference.resize(b.coefficients_.size());
  for (std::size_t i = 0; i < b.coefficients_.size(); ++i) difference[i] -= b.coefficients_[i];
  return Polynomial(std::move(difference));
}

Polynomial operator*(const Polynomial& a, const Polynomial& b) {
  if (a.isZero() || b.isZero()) return {};
  std::vector<Integer> product(a.coefficients_.size() + b.coefficients_.size() - 1);
  for (std::size_t i = 0; i < a.coefficients_.size(); ++i) {
    for (std::size_t j = 0; j < b.coefficients_.size(); ++j) {
      product[i + j] += a.coefficients_[i] * b.coefficients_[j];
    }
  }
  return Polynomial(std::move(product));
}

Polynomial gcd(Polynomial a, Polynomial b) {
  a = a.primitive();
  b = b.primitive();
  while (!b.isZero()) {
    Polynomial rest = pseudoRemainder(a, b).primitive();
    a = std::move(b);
    b = std::move(rest);
  }
  return a;
}

Root::Root(Polynomial polynomial, const Dyadic& lo, const Dyadic& hi)
    : polynomial_(std::move(polynomial)), lo_(lo), hi_(hi), sign_at_lo_(polynomial_.signAt(lo)) {
  if (sign_at_lo_ * polynomial_.signAt(hi) >= 0) throw std::logic_error("the interval does not isolate a root");
}

void Root::refine(int halvings) {
  for (int i = 0; i < halvings && !isExact(); ++i) {
    const auto ends = aligned(lo_, hi_);
    const Dyadic middle{ends.first.numerator + ends.second.numerator, ends.first.exponent + 1};
    const int sign = polynomial_.signAt(middle);
    if (sign == 0 || sign == sign_at_lo_) lo_ = middle;
    if (sign != sign_at_lo_) hi_ = middle;
  }
}

void Root::refineTo(unsigned bits) {
  for (;;) {
    const auto ends = aligned(lo_, hi_);
    const Integer width = ends.second.numerator - ends.first.numerator;
    if ((width << bits) <= (Integer(1) << ends.first.exponent)) return;
    refine();
  }
}

bool Root::isRootOf(const Polynomial& q) const {
  // The divisor has no root in the interval but this number, which is a simple one: a change of sign tells.
  const Polynomial divisor = gcd(polynomial_, q);
  return divisor.signAt(lo_) * divisor.signAt(hi_) < 0;
}

int Root::signOf(const Polynomial& q) {
  if (q.isZero()) return 0;
  constexpr int CHEAP_TRIES = 4, HALVINGS = 12;
  for (int i = 0;; ++i) {
    if (isExact()) return q.signAt(lo_);
    const int sign = q.certainSign(lo_, hi_);
    if (sign != 0) return sign;
    // Only a number that is known not to be 0 may be refined without end.
    if (i == CHEAP_TRIES && isRootOf(q)) return 0;
    refine(HALVINGS);
  }
}

int Root::compareWith(const Dyadic& other) const {
  if (compare(other, lo_) < 0 || (compare(other, lo_) == 0 && !isExact())) return 1;
  if (compare(other, hi_) > 0 || (compare(other, hi_) == 0 && !isExact())) return -1;
  if (isExact()) return 0;
  const int sign = polynomial_.signAt(other);
  return sign == 0 ? 0 : (sign == sign_at_lo_ ? 1 : -1);
}

int Root::compareWith(Root& other) {
  if (other.isExact()) return compareWith(other.lo_);
  if (isExact()) return -other.compareWith(lo_);
  // A common root is equal to this one only if it is the other's, too: it must not leave the other's interval.
  const bool common = isRootOf(other.polynomial_);
  for (;;) {
    if (compare(hi_, other.lo_) <= 0) return -1;
    if (compare(lo_, other.hi_) >= 0) return 1;
    if (common && compare(lo_, other.lo_) >= 0 && compare(hi_, other.hi_) <= 0) return 0;
    refine();
    if (!common) other.refine();
    if (isExact()) return -other.compareWith(lo_);
    if (other.isExact()) return compareWith(other.lo_);
  }
}

Integer Root::cell(int bits) {
  refineTo(static_cast<unsigned>(bits) + 1);
  const Integer guess = (lo_.numerator << bits) >> lo_.exponent;  // the interval meets at most one grid point above it
  const bool next = compareWith(Dyadic{guess + 1, static_cast<unsigned>(bits)}) >= 0;
  return next ? Integer(guess + 1) : guess;
}

std::vector<Root> rootsInUnitInterval(const Polynomial& input) {
  std::vector<Root> roots;
  const Polynomial polynomial = input.primitive();
  if (polynomial.degree() < 1) return roots;
  // Between neighbouring stops the polynomial is strictly monotone.
  std::vector<Root> stops = rootsInUnitInterval(polynomial.derivative());
  const Dyadic zero{0, 0}, one{1, 0};
  if (stops.empty() || stops.front().compareWith(zero) != 0) stops.insert(stops.begin(), Root(zero));
  if (stops.back().compareWith(one) != 0) stops.emplace_back(one);
  int previous_sign = 0;
  for (std::size_t i = 0; i < stops.size(); ++i) {
    const int sign = stops[i].signOf(polynomial);  // narrows the stop until the sign holds on its whole interval
    if (previous_sign * sign < 0) roots.emplace_back(polynomial, stops[i - 1].hi(), stops[i].lo());
    if (sign == 0) roots.push_back(stops[i]);
    previous_sign = sign;
  }
  return roots;
}

Dyadic strictlyBetween(Root& a, Root& b) {
  while (compare(a.hi(), b.lo()) >= 0) {
    a.refine();
    b.refine();
  }
  const auto ends = aligned(a.hi(), b.lo());
  return {ends.first.numerator + ends.second.numerator, ends.first.exponent + 1};
}

}  // namespace test
}  // namespace dccd
