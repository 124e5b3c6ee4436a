// Integers of any length of which only what is asked for is computed. Coordinates of wide ranges make numbers of
// thousands of digits, but most signs are those of their largest terms. So each number is kept as a pair of doubles
// with an exponent of its own and a bound on its error, and as what it was made of; GMP computes it where the bound
// cannot tell its sign. What is made the same way of the same numbers is one number. They live until the next decision
// of the thread begins.
//
// Bounds. A number is (high + low) 2^exponent, |high| in [1/2, 1), |low| <= 2^-54 |2 high|, off by at most error
// 2^exponent. Every operation is correctly rounded.
//   Product: of the leading parts exactly, p + q; the two cross terms, each at most 2^-54, err by 2^-108 each and their
//     sum by 2^-107, q plus that by 2^-106; the product of the trailing parts, 2^-108, is dropped: below 2^-104.
//   Sum: of the leading parts exactly, s + t, |s| < 2; the trailing parts' sum, at most 2^-53, errs by 2^-107, t plus
//     that, at most 2^-52, by 2^-106: below 2^-104. An addend 2^LAZY_FAR_BITS times smaller goes into the error.
// LAZY_ROUNDING is used, before the result is brought to [1/2, 1). Where no trailing part is there nothing is
// rounded: differences of coordinates and their products are exact, and so are their zeros.
#pragma once

#include <cmath>
#include <cstdint>
#include <cstring>
#include <deque>
#include <vector>

#include "dccd/tolerances.h"
#include "elementary/exact_double_double.h"
#include "elementary/exact_integer.h"

namespace dccd {

class LazyInteger {
 public:
  LazyInteger() = default;  // zero
  LazyInteger(std::int64_t value) : index_(value == 0 ? 0 : arena().constant(value, 0)) {}

  /// value * 2^shift, shift >= 0.
  static LazyInteger shifted(std::int64_t value, int shift) {
    return LazyInteger(Index{value == 0 ? 0 : arena().constant(value, shift)});
  }
  /// The number, computed if it is not known to some twenty digits, so that what is made of it is.
  const LazyInteger& sharpened() const {
    arena().sharpen(index_);
    return *this;
  }

  /// Forgets all numbers of this thread.
  static void beginDecision() { arena().clear(); }

  int sign() const { return arena().sign(index_); }
  ScaledDouble approximate() const { return arena().approximate(index_); }

  LazyInteger operator-() const { return LazyInteger(Index{arena().negated(index_)}); }
  LazyInteger operator+(const LazyInteger& other) const {
    return LazyInteger(Index{arena().sum(index_, other.index_, 1)});
  }
  LazyInteger operator-(const LazyInteger& other) const {
    return LazyInteger(Index{arena().sum(index_, other.index_, -1)});
  }
  LazyInteger operator*(const LazyInteger& other) const {
    return LazyInteger(Index{arena().product(index_, other.index_)});
  }
  LazyInteger operator*(std::int64_t factor) const { return *this * LazyInteger(factor); }
  LazyInteger operator<<(int bits) const { return LazyInteger(Index{arena().shifted(index_, bits)}); }

 private:
  struct Index {
    std::int32_t value;
  };
  explicit LazyInteger(Index index) : index_(index.value) {}

  static constexpr double BOUND_OF_BOUNDS = tolerance::LAZY_BOUND_OF_BOUNDS;

  struct Approximation {
    double high = 0, low = 0, error = 0;
    long exponent = 0;
    bool isZero() const { return high == 0 && error == 0; }
  };

  enum class Made : std::uint8_t { CONSTANT, NEGATED, SUM, DIFFERENCE, PRODUCT, SHIFTED };
  struct Number {
    Approximation about;
    std::int64_t constant = 0;
    std::int32_t first = 0, second = 0;  ///< numbers, or bits to shift by
    std::int32_t exact = -1;
    Made made = Made::CONSTANT;
  };

  class Arena {
   public:
    Arena() { clear(); }

    void clear() {
      numbers_.resize(1);  // zero
      exact_count_ = 0;
      ++decision_;
    }

    std::int32_t constant(std::int64_t value, int shift) {
      Number number;
      number.constant = value;
      number.second = shift;
      const std::int32_t known = find(number);
      if (known >= 0) return known;
      const double high = static_cast<double>(value);
      const double low = static_cast<double>(static_cast<__int128>(value) - static_cast<__int128>(high));  // exact
      number.about = normalized(high, low, 0, shift);
      return add(number);
    }

    std::int32_t negated(std::int32_t a) {
      Number number = made(Made::NEGATED, a, 0);
      const std::int32_t known = find(number);
      if (a == 0 || known >= 0) return a == 0 ? 0 : known;
      number.about = numbers_[a].about;
      number.about.high = -number.about.high;
      number.about.low = -number.about.low;
      return add(number);
    }

    std::int32_t shifted(std::int32_t a, int bits) {
      if (a == 0 || bits == 0) return a;
      Number number = made(Made::SHIFTED, a, bits);
      const std::int32_t known = find(number);
      if (known >= 0) return known;
      number.about = numbers_[a].about;
      number.about.exponent += bits;
      return add(number);
    }

    std::int32_t product(std::int32_t a, std::int32_t b) {
      const Approximation &x = numbers_[a].about, &y = numbers_[b].about;
      if (x.isZero() || y.isZero()) return 0;
      Number number = made(Made::PRODUCT, a, b);
      const std::int32_t known = find(number);
      if (known >= 0) return known;
      const exact::DoubleDouble p = exact::twoProduct(x.high, exact::Halves(x.high), y.high, exact::Halves(y.high));
      const bool is_exact = x.low == 0 && y.low == 0;
      const double rest = p.lo + (x.high * y.low + x.low * y.high);
      const double high = p.hi + rest, low = rest - (high - p.hi);  // |rest| is far below |p.hi|
      // |x|, |y| <= 1.
      const double error =
          BOUND_OF_BOUNDS * (x.error + y.error + x.error * y.error) + (is_exact ? 0 : tolerance::LAZY_ROUNDING);
      number.about = normalized(high, low, error, x.exponent + y.exponent);
      return add(number);
    }

    std::int32_t sum(std::int32_t a, std::int32_t b, int sign_of_b) {
      if (numbers_[b].about.isZero()) return a;
      if (numbers_[a].about.isZero()) return sign_of_b > 0 ? b : negated(b);
      Number number = made(sign_of_b > 0 ? Made::SUM : Made::DIFFERENCE, a, b);
      const std::int32_t known = find(number);
      if (known >= 0) return known;
      Approximation x = numbers_[a].about, y = numbers_[b].about;
      y.high *= sign_of_b;
      y.low *= sign_of_b;
      if (x.exponent < y.exponent) std::swap(x, y);
      const long apart = x.exponent - y.exponent;
      if (apart > tolerance::LAZY_FAR_BITS) {
        x.error = BOUND_OF_BOUNDS * (x.error + (BOUND_OF_BOUNDS + y.error) * powerOfTwo(-tolerance::LAZY_FAR_BITS));
        number.about = x;
        return add(number);
      }
      const double scale = powerOfTwo(static_cast<int>(-apart));
      const double yh = y.high * scale, yl = y.low * scale;  // exact: far from underflow
      const exact::DoubleDouble leading = exact::twoSum(x.high, yh);
      const bool is_exact = x.low == 0 && yl == 0;
      const exact::DoubleDouble all = exact::twoSum(leading.hi, leading.lo + (x.low + yl));
      const double error = BOUND_OF_BOUNDS * (x.error + y.error * scale) + (is_exact ? 0 : tolerance::LAZY_ROUNDING);
      number.about = normalized(all.hi, all.lo, error, x.exponent);
      return add(number);
    }

    int sign(std::int32_t a) {
      const Approximation& x = numbers_[a].about;
      if (std::fabs(x.high) * tolerance::LAZY_SIGN > x.error) return x.high > 0 ? 1 : -1;
      return x.isZero() ? 0 : sgn(exact(a));
    }

    void sharpen(std::int32_t a) {
      const Approximation& x = numbers_[a].about;
      if (x.error > tolerance::LAZY_SHARP || (x.high == 0 && !x.isZero())) exact(a);
    }

    ScaledDouble approximate(std::int32_t a) {
      const Approximation& x = numbers_[a].about;
      ScaledDouble result;
      if (x.isZero()) return result;
      if (std::fabs(x.high) > 0 && x.error <= tolerance::LAZY_DOUBLE) {
        result.mantissa = x.high;
        result.exponent = x.exponent;
      } else {
        result.mantissa = mpz_get_d_2exp(&result.exponent, exact(a).get_mpz_t());
      }
      return result;
    }

   private:
    static Number made(Made how, std::int32_t first, std::int32_t second) {
      Number number;
      number.made = how;
      number.first = first;
      number.second = second;
      return number;
    }

    /// The number of this thread's decision that is made alike, or -1, and then add() has its place in the table.
    std::int32_t find(const Number& number) {
      std::uint64_t key = static_cast<std::uint64_t>(number.constant) * 0x9e3779b97f4a7c15u;
      key ^= (static_cast<std::uint64_t>(static_cast<std::uint32_t>(number.first)) << 32) |
             static_cast<std::uint32_t>(number.second);
      key = (key + static_cast<std::uint64_t>(number.made)) * 0xd1342543de82ef95u;
      place_ = static_cast<std::size_t>(key >> (64 - TABLE_BITS));
      const Place& place = table_[place_];
      if (place.decision != decision_) return -1;
      const Number& other = numbers_[place.number];
      const bool is_same = other.made == number.made && other.first == number.first && other.second == number.second &&
                           other.constant == number.constant;
      return is_same ? place.number : -1;
    }

    std::int32_t add(const Number& number) {
      numbers_.push_back(number);
      const auto index = static_cast<std::int32_t>(numbers_.size()) - 1;
      table_[place_] = {decision_, index};
      return index;
    }

    static double powerOfTwo(int exponent) {  // normal ones
      const std::uint64_t word = static_cast<std::uint64_t>(1023 + exponent) << 52;
      double value;
      std::memcpy(&value, &word, sizeof value);
      return value;
    }

    static Approximation normalized(double high, double low, double error, long exponent) {
      if (high == 0) return {0, 0, error, exponent};
      std::uint64_t word;
      std::memcpy(&word, &high, sizeof word);
      const int shift = (static_cast<int>(word >> 52) & 0x7ff) - 1022;  // high is normal: no sum is below 2^-400
      const double scale = powerOfTwo(-shift);
      return {high * scale, low * scale, error * scale, exponent + shift};
    }

    const mpz_class& exact(std::int32_t a) {
      if (numbers_[a].exact >= 0) return exacts_[static_cast<std::size_t>(numbers_[a].exact)];
      const Number number = numbers_[a];
      const bool is_leaf = number.made == Made::CONSTANT;
      const mpz_class* first = is_leaf ? nullptr : &exact(number.first);
      const bool has_two = number.made == Made::SUM || number.made == Made::DIFFERENCE || number.made == Made::PRODUCT;
      const mpz_class* second = has_two ? &exact(number.second) : nullptr;
      if (exact_count_ == exacts_.size()) exacts_.emplace_back();
      numbers_[a].exact = static_cast<std::int32_t>(exact_count_);
      mpz_class& result = exacts_[exact_count_++];
      switch (number.made) {
        case Made::CONSTANT:
          result = number.constant;
          result <<= static_cast<mp_bitcnt_t>(number.second);
          break;
        case Made::NEGATED:
          result = -*first;
          break;
        case Made::SUM:
          result = *first + *second;
          break;
        case Made::DIFFERENCE:
          result = *first - *second;
          break;
        case Made::PRODUCT:
          result = *first * *second;
          break;
        case Made::SHIFTED:
          result = *first << static_cast<mp_bitcnt_t>(number.second);
          break;
      }
      numbers_[a].about = approximationOf(result);
      return result;
    }

    /// The leading 106 bits.
    Approximation approximationOf(const mpz_class& value) {
      if (sgn(value) == 0) return {};
      const long rest = static_cast<long>(mpz_sizeinbase(value.get_mpz_t(), 2)) - 106;
      mpz_tdiv_q_2exp(leading_.get_mpz_t(), value.get_mpz_t(), static_cast<mp_bitcnt_t>(rest > 0 ? rest : 0));
      const double first = leading_.get_d();  // 53 bits, the others cut off
      part_ = first;
      leading_ -= part_;
      const double second = leading_.get_d(), high = first + second;
      const bool is_cut = rest > 0 && mpz_scan1(value.get_mpz_t(), 0) < static_cast<mp_bitcnt_t>(rest);
      return normalized(high, second - (high - first), is_cut ? 1 : 0, rest > 0 ? rest : 0);
    }

    static constexpr int TABLE_BITS = 13;
    struct Place {
      std::uint64_t decision = 0;
      std::int32_t number = 0;
    };

    std::vector<Number> numbers_;
    std::vector<Place> table_ = std::vector<Place>(std::size_t{1} << TABLE_BITS);  ///< the newest number of each key
    std::uint64_t decision_ = 0;
    std::size_t place_ = 0;
    mpz_class leading_, part_;
    /// What GMP computes lives on from decision to decision, so that nothing is allocated in the long run. A deque: it
    /// stays where it is.
    std::deque<mpz_class> exacts_;
    std::size_t exact_count_ = 0;
  };

  static Arena& arena() {
    thread_local Arena arena;
    return arena;
  }

  std::int32_t index_ = 0;
};

}  // namespace dccd
