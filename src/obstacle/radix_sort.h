// Stable sorts by digits, the least significant one first.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace dccd {

constexpr int RADIX_BITS = 12;  ///< of a digit

/// One pass: by the digit of their keys from bit `shift` on. other: a buffer of the same size.
template <class Item, class KeyOf>
void radixPass(std::vector<Item>& items, std::vector<Item>& other, int shift, const KeyOf& keyOf) {
  constexpr std::size_t BUCKETS = std::size_t{1} << RADIX_BITS;
  std::array<std::uint32_t, BUCKETS> next{};
  for (const Item& item : items) ++next[keyOf(item) >> shift & (BUCKETS - 1)];
  std::uint32_t sum = 0;
  for (std::uint32_t& n : next) sum += std::exchange(n, sum);
  for (const Item& item : items) other[next[keyOf(item) >> shift & (BUCKETS - 1)]++] = item;
  std::swap(items, other);
}

/// Words themselves, few of them by comparing. other: a buffer.
inline void radixSort(std::vector<std::uint64_t>& words, std::vector<std::uint64_t>& other) {
  constexpr std::size_t FEW = 1024;
  if (words.size() < FEW) return std::sort(words.begin(), words.end());
  other.resize(words.size());
  std::uint64_t differ = 0;
  for (const std::uint64_t word : words) differ |= word ^ words[0];
  for (int shift = 0; shift < 64; shift += RADIX_BITS) {
    if ((differ >> shift & ((1u << RADIX_BITS) - 1)) == 0) continue;
    radixPass(words, other, shift, [](std::uint64_t word) { return word; });
  }
}

}  // namespace dccd
