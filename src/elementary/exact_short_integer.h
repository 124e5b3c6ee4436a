// Integers of a length known when they are compiled, for the static tests at simple times: no loop, no branch and no
// length to look after, which is what most of the time goes into with integers of any length. A product is as long as
// its factors together. Sums stay as long as they are: the caller leaves enough bits free.
#pragma once

#include <cstdint>

namespace dccd {
namespace exact {

/// Two's complement, LIMBS words of 64 bits.
template <int LIMBS>
struct ShortInteger {
  std::uint64_t limb[LIMBS];

  bool isNegative() const { return static_cast<std::int64_t>(limb[LIMBS - 1]) < 0; }
  int sign() const {
    if (isNegative()) return -1;
    std::uint64_t any = 0;
    for (int i = 0; i < LIMBS; ++i) any |= limb[i];
    return any != 0;
  }

  /// About the number, with a relative error below 2^-50.
  double approximate() const {
    const ShortInteger absolute = isNegative() ? ShortInteger{} - *this : *this;
    double value = 0;
    for (int i = LIMBS - 1; i >= 0; --i) value = value * 0x1p64 + static_cast<double>(absolute.limb[i]);
    return isNegative() ? -value : value;
  }

  ShortInteger operator+(const ShortInteger& other) const {
    ShortInteger result;
    unsigned __int128 carry = 0;
    for (int i = 0; i < LIMBS; ++i) {
      carry += static_cast<unsigned __int128>(limb[i]) + other.limb[i];
      result.limb[i] = static_cast<std::uint64_t>(carry);
      carry >>= 64;
    }
    return result;
  }

  ShortInteger operator-(const ShortInteger& other) const {
    ShortInteger result = *this;
    result.subtractAt(0, other);
    return result;
  }

  /// Of a factor that keeps the product as short as this.
  ShortInteger operator*(std::int64_t factor) const {
    ShortInteger result;
    const std::uint64_t by = static_cast<std::uint64_t>(factor < 0 ? -factor : factor);
    std::uint64_t carry = 0;
    for (int i = 0; i < LIMBS; ++i) {
      const unsigned __int128 product = static_cast<unsigned __int128>(limb[i]) * by + carry;
      result.limb[i] = static_cast<std::uint64_t>(product);
      carry = static_cast<std::uint64_t>(product >> 64);
    }
    return factor < 0 ? ShortInteger{} - result : result;
  }

  template <int OTHER>
  ShortInteger<LIMBS + OTHER> operator*(const ShortInteger<OTHER>& other) const {
    ShortInteger<LIMBS + OTHER> result{};
    for (int i = 0; i < LIMBS; ++i) {
      std::uint64_t carry = 0;
      for (int j = 0; j < OTHER; ++j) {
        const unsigned __int128 sum =
            static_cast<unsigned __int128>(limb[i]) * other.limb[j] + result.limb[i + j] + carry;
        result.limb[i + j] = static_cast<std::uint64_t>(sum);
        carry = static_cast<std::uint64_t>(sum >> 64);
      }
      result.limb[i + OTHER] = carry;
    }
    // As unsigned numbers the negative ones were too large by 2^(64 LIMBS), or 2^(64 OTHER).
    if (isNegative()) result.subtractAt(LIMBS, other);
    if (other.isNegative()) result.subtractAt(OTHER, *this);
    return result;
  }

  /// Less `other` times 2^(64 place), of which what does not fit is dropped.
  template <int OTHER>
  void subtractAt(int place, const ShortInteger<OTHER>& other) {
    std::uint64_t borrow = 0;
    for (int i = 0; i + place < LIMBS; ++i) {
      const std::uint64_t by = i < OTHER ? other.limb[i] : 0;
      const unsigned __int128 difference = static_cast<unsigned __int128>(limb[i + place]) - by - borrow;
      limb[i + place] = static_cast<std::uint64_t>(difference);
      borrow = static_cast<std::uint64_t>(difference >> 64) & 1;
    }
  }
};

/// The integer that `value` is; its magnitude must be below 2^(64 LIMBS - 1), with one word or two.
template <int LIMBS>
ShortInteger<LIMBS> shortInteger(double value) {
  static_assert(LIMBS == 1 || LIMBS == 2);
  ShortInteger<LIMBS> result;
  if constexpr (LIMBS == 1) {
    result.limb[0] = static_cast<std::uint64_t>(static_cast<std::int64_t>(value));
  } else {
    const __int128 whole = static_cast<__int128>(value);
    result.limb[0] = static_cast<std::uint64_t>(whole);
    result.limb[1] = static_cast<std::uint64_t>(whole >> 64);
  }
  return result;
}

}  // namespace exact
}  // namespace dccd
