// Signed integers for the exact rung, with one interface: StackInteger keeps its limbs on the stack (no allocation),
// BigInteger lets GMP allocate. Both cost what the number's actual length costs, not what it might grow to.
#pragma once

#include <gmpxx.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <utility>

namespace dccd {

static_assert(GMP_NUMB_BITS == 64, "limbs of 64 bits without nails");

/// value = mantissa * 2^exponent; mantissa is 0 or in [1/2, 1) in magnitude, relative error below 2^-52.
struct ScaledDouble {
  double mantissa = 0;
  long exponent = 0;
};

/// Sign and magnitude, at most LIMBS limbs. The caller bounds the lengths beforehand (exact_decide.h does it once for
/// all of a query); nothing is checked here.
template <int LIMBS>
class StackInteger {
 public:
  static constexpr int CAPACITY_BITS = 64 * LIMBS;

  StackInteger() = default;
  StackInteger(std::int64_t value) { setMagnitude(magnitude(value), value < 0); }
  StackInteger(const StackInteger& other) { assign(other); }
  StackInteger& operator=(const StackInteger& other) {
    assign(other);
    return *this;
  }

  /// value * 2^shift, shift >= 0.
  static StackInteger shifted(std::int64_t value, int shift) { return StackInteger(value) << shift; }

  int sign() const { return (size_ > 0) - (size_ < 0); }

  StackInteger operator-() const {
    StackInteger result(*this);
    result.size_ = -size_;
    return result;
  }
  StackInteger operator+(const StackInteger& other) const { return sum(other, other.size_); }
  StackInteger operator-(const StackInteger& other) const { return sum(other, -other.size_); }

  StackInteger operator*(const StackInteger& other) const {
    StackInteger result;
    const int n = std::abs(size_), m = std::abs(other.size_);
    if (n == 0 || m == 0) return result;
    mp_limb_t high;
    if (n == 1 && m == 1) {
      const unsigned __int128 product = static_cast<unsigned __int128>(limbs_[0]) * other.limbs_[0];
      result.limbs_[0] = static_cast<mp_limb_t>(product);
      result.limbs_[1] = high = static_cast<mp_limb_t>(product >> 64);
    } else if (m == 1) {
      result.limbs_[n] = high = mpn_mul_1(result.limbs_, limbs_, n, other.limbs_[0]);
    } else if (n >= m) {
      high = mpn_mul(result.limbs_, limbs_, n, other.limbs_, m);
    } else {
      high = mpn_mul(result.limbs_, other.limbs_, m, limbs_, n);
    }
    const int length = n + m - (high == 0);
    result.size_ = (size_ < 0) == (other.size_ < 0) ? length : -length;
    return result;
  }

  StackInteger operator*(std::int64_t factor) const {
    StackInteger result;
    if (factor == 0 || size_ == 0) return result;
    int n = std::abs(size_);
    const mp_limb_t carry = mpn_mul_1(result.limbs_, limbs_, n, magnitude(factor));
    if (carry != 0) result.limbs_[n++] = carry;
    result.size_ = (size_ < 0) == (factor < 0) ? n : -n;
    return result;
  }

  StackInteger operator<<(int bits) const {
    StackInteger result;
    if (size_ == 0) return result;
    const int n = std::abs(size_), words = bits / 64, rest = bits % 64;
    for (int i = 0; i < words; ++i) result.limbs_[i] = 0;
    mp_limb_t carry = 0;
    if (rest == 0) {
      for (int i = 0; i < n; ++i) result.limbs_[words + i] = limbs_[i];
    } else {
      carry = mpn_lshift(result.limbs_ + words, limbs_, n, rest);
    }
    int length = n + words;
    if (carry != 0) result.limbs_[length++] = carry;
    result.size_ = size_ < 0 ? -length : length;
    return result;
  }

  ScaledDouble approximate() const {
    const int n = std::abs(size_);
    if (n == 0) return {};
    double value = static_cast<double>(limbs_[n - 1]);
    if (n > 1) value += static_cast<double>(limbs_[n - 2]) * 0x1p-64;
    int exponent;
    const double mantissa = std::frexp(size_ < 0 ? -value : value, &exponent);
    return {mantissa, 64L * (n - 1) + exponent};
  }

 private:
  static mp_limb_t magnitude(std::int64_t value) {
    return value < 0 ? mp_limb_t{0} - static_cast<mp_limb_t>(value) : static_cast<mp_limb_t>(value);
  }

  void setMagnitude(mp_limb_t magnitude, bool negative) {
    limbs_[0] = magnitude;
    size_ = magnitude == 0 ? 0 : (negative ? -1 : 1);
  }

  void assign(const StackInteger& other) {
    size_ = other.size_;
    for (int i = 0; i < std::abs(size_); ++i) limbs_[i] = other.limbs_[i];
  }

  /// This plus a number with the other's limbs and the size (hence the sign) given.
  StackInteger sum(const StackInteger& other, int other_size) const {
    const bool swapped = std::abs(size_) < std::abs(other_size);
    const StackInteger& large = swapped ? other : *this;
    const StackInteger& small = swapped ? *this : other;
    const int large_size = swapped ? other_size : size_;
    const int small_size = swapped ? size_ : other_size;
    if (small_size == 0) {
      StackInteger result(large);
      result.size_ = large_size;
      return result;
    }
    if ((large_size < 0) == (small_size < 0)) return sumOfSizes(large, large_size, small, small_size);
    return differenceOfSizes(large, large_size, small, small_size);
  }

  static StackInteger sumOfSizes(const StackInteger& large, int large_size, const StackInteger& small, int small_size) {
    StackInteger result;
    int n = std::abs(large_size);
    const mp_limb_t carry = mpn_add(result.limbs_, large.limbs_, n, small.limbs_, std::abs(small_size));
    if (carry != 0) result.limbs_[n++] = carry;
    result.size_ = large_size < 0 ? -n : n;
    return result;
  }

  static StackInteger differenceOfSizes(const StackInteger& large, int large_size, const StackInteger& small,
                                        int small_size) {
    StackInteger result;
    int n = std::abs(large_size);
    const int m = std::abs(small_size);
    bool negative = large_size < 0;
    if (n == m && mpn_cmp(large.limbs_, small.limbs_, n) < 0) {
      mpn_sub_n(result.limbs_, small.limbs_, large.limbs_, n);
      negative = !negative;
    } else {
      mpn_sub(result.limbs_, large.limbs_, n, small.limbs_, m);
    }
    while (n > 0 && result.limbs_[n - 1] == 0) --n;
    result.size_ = negative ? -n : n;
    return result;
  }

  int size_ = 0;                ///< limbs in use, negative for a negative number
  mp_limb_t limbs_[LIMBS + 1];  ///< a product's limbs as multiplied: the highest may be zero
};

/// The same interface over GMP's allocating integers, for lengths that the stack should not carry.
class BigInteger {
 public:
  BigInteger() = default;
  BigInteger(std::int64_t value) : value_(value) {}

  static BigInteger shifted(std::int64_t value, int shift) { return BigInteger(value) << shift; }

  int sign() const { return sgn(value_); }

  BigInteger operator-() const { return BigInteger(mpz_class(-value_)); }
  BigInteger operator+(const BigInteger& other) const { return BigInteger(mpz_class(value_ + other.value_)); }
  BigInteger operator-(const BigInteger& other) const { return BigInteger(mpz_class(value_ - other.value_)); }
  BigInteger operator*(const BigInteger& other) const { return BigInteger(mpz_class(value_ * other.value_)); }
  BigInteger operator*(std::int64_t factor) const { return BigInteger(mpz_class(value_ * factor)); }
  BigInteger operator<<(int bits) const { return BigInteger(mpz_class(value_ << static_cast<mp_bitcnt_t>(bits))); }

  ScaledDouble approximate() const {
    ScaledDouble result;
    result.mantissa = mpz_get_d_2exp(&result.exponent, value_.get_mpz_t());
    return result;
  }

 private:
  explicit BigInteger(mpz_class&& value) : value_(std::move(value)) {}

  mpz_class value_;
};

}  // namespace dccd
