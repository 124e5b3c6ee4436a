// Exact sums of doubles (Shewchuk 1997): for signs of terms of all sizes, which pairs of doubles cannot tell and
// integers take long for. An expansion is a sum of doubles in ascending order of size that do not overlap, without
// zeros: its sign is that of the last one. Exact as long as nothing over- or underflows, which the caller sees to.
#pragma once

#include <algorithm>
#include <cmath>

#include "elementary/exact_double_double.h"

namespace dccd {
namespace exact {

/// At most MOST terms; one that would have more is lost, and so is all that is made of it.
class Expansion {
 public:
  Expansion() = default;
  explicit Expansion(const DoubleDouble& x) { append(x.lo), append(x.hi); }
  Expansion(const Expansion& other) { *this = other; }
  Expansion& operator=(const Expansion& other) {
    count_ = other.count_;
    lost_ = other.lost_;
    std::copy_n(other.term_, count_, term_);
    return *this;
  }

  bool isLost() const { return lost_; }
  int sign() const { return count_ == 0 ? 0 : term_[count_ - 1] > 0 ? 1 : -1; }

  Expansion operator+(const Expansion& other) const {
    Expansion sum;
    sum.lost_ = lost_ || other.lost_ || count_ + other.count_ > MOST;
    if (sum.lost_) return sum;
    int i = 0, j = 0;
    const auto next = [&] {
      const bool own = j == other.count_ || (i < count_ && std::fabs(term_[i]) < std::fabs(other.term_[j]));
      return own ? term_[i++] : other.term_[j++];
    };
    double rest = 0;
    while (i + j < count_ + other.count_) {
      const DoubleDouble both = twoSum(rest, next());
      sum.append(both.lo);
      rest = both.hi;
    }
    sum.append(rest);
    return sum;
  }
  Expansion operator-(const Expansion& other) const {
    Expansion negative(other);
    for (int i = 0; i < negative.count_; ++i) negative.term_[i] = -negative.term_[i];
    return *this + negative;
  }
  Expansion operator*(double factor) const {
    Expansion product;
    product.lost_ = lost_ || 2 * count_ > MOST;
    if (product.lost_) return product;
    const Halves halves(factor);
    double rest = 0;
    for (int i = 0; i < count_; ++i) {
      const DoubleDouble term = twoProduct(term_[i], Halves(term_[i]), factor, halves);
      const DoubleDouble low = twoSum(rest, term.lo);
      const DoubleDouble high = twoSum(term.hi, low.hi);
      product.append(low.lo);
      product.append(high.lo);
      rest = high.hi;
    }
    product.append(rest);
    return product;
  }
  Expansion operator*(const Expansion& other) const {
    Expansion product;
    product.lost_ = lost_ || other.lost_;
    for (int i = 0; i < other.count_ && !product.lost_; ++i) product = product + *this * other.term_[i];
    return product;
  }

 private:
  static constexpr int MOST = 256;

  void append(double term) {
    if (term != 0) term_[count_++] = term;
  }

  int count_ = 0;
  bool lost_ = false;
  double term_[MOST];
};

}  // namespace exact
}  // namespace dccd
