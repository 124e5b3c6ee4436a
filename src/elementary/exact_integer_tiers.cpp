#include <cstring>

#include "elementary/exact_decide.h"
#include "elementary/exact_integer.h"
#include "elementary/exact_tiers.h"

namespace dccd {
namespace exact {

static_assert(workingBits(FIXED_INTEGER_MAX_BITS) <= StackInteger<FIXED_INTEGER_LIMBS>::CAPACITY_BITS,
              "the fixed-width integers hold every intermediate number");

IntegerMotion::IntegerMotion(const PairMotion& pair) {
  constexpr std::uint64_t FRACTION = (std::uint64_t{1} << 52) - 1;
  int lowest[3] = {1 << 14, 1 << 14, 1 << 14}, highest[3] = {-(1 << 14), -(1 << 14), -(1 << 14)};
  for (int time = 0; time < 2; ++time) {
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 3; ++k) {
        std::uint64_t word;
        std::memcpy(&word, &pair.x[time][i][k], sizeof word);
        const int biased = static_cast<int>(word >> 52) & 0x7ff;
        std::uint64_t magnitude = (word & FRACTION) | (biased != 0 ? FRACTION + 1 : 0);
        int exponent = biased != 0 ? biased - 1 : 0;  // of the lowest bit, counted from the smallest subnormal's
        if (magnitude != 0) {
          const int zeros = __builtin_ctzll(magnitude);
          magnitude >>= zeros;
          exponent += zeros;
          lowest[k] = std::min(lowest[k], exponent);
          highest[k] = std::max(highest[k], exponent + 64 - __builtin_clzll(magnitude));
        }
        const auto value = static_cast<std::int64_t>(magnitude);
        mantissa[time][i][k] = (word >> 63) != 0 ? -value : value;
        shift[time][i][k] = exponent;
      }
    }
  }
  for (int k = 0; k < 3; ++k) bits = std::max(bits, highest[k] - lowest[k]);
  for (int time = 0; time < 2; ++time) {
    for (int i = 0; i < 4; ++i) {
      for (int k = 0; k < 3; ++k) shift[time][i][k] = mantissa[time][i][k] == 0 ? 0 : shift[time][i][k] - lowest[k];
    }
  }
}

namespace {

template <class Z>
ElementaryResult decideByIntegers(PairKind kind, const IntegerMotion& motion, int toc_bits, Tier tier) {
  const Answer answer = Decision<Z>(kind, motion, toc_bits).decide();
  return answer.contact ? contactInCell(answer.cell, toc_bits, tier) : noContact(tier);
}

}  // namespace

ElementaryResult decideByFixedIntegers(PairKind kind, const PairMotion& pair, int toc_bits) {
  const IntegerMotion motion(pair);
  if (motion.bits > FIXED_INTEGER_MAX_BITS) return undecided(Tier::FIXED_INTEGER);
  return decideByIntegers<StackInteger<FIXED_INTEGER_LIMBS>>(kind, motion, toc_bits, Tier::FIXED_INTEGER);
}

ElementaryResult decideByBigIntegers(PairKind kind, const PairMotion& pair, int toc_bits) {
  return decideByIntegers<BigInteger>(kind, IntegerMotion(pair), toc_bits, Tier::BIG_INTEGER);
}

}  // namespace exact
}  // namespace dccd
