// Sorts words: many by digits, few by comparing.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace dccd {

/// other: a buffer.
inline void radixSort(std::vector<std::uint64_t>& words, std::vector<std::uint64_t>& other) {
  constexpr int DIGIT = 12;
  constexpr std::size_t BUCKETS = std::size_t{1} << DIGIT, FEW = 1024;
  if (words.size() < FEW) return std::sort(words.begin(), words.end());
  other.resize(words.size());
  std::uint64_t differ = 0;
  for (const std::uint64_t word : words) differ |= word ^ words[0];
  for (int shift = 0; shift < 64; shift += DIGIT) {
    if ((differ >> shift & (BUCKETS - 1)) == 0) continue;
    std::array<std::uint32_t, BUCKETS> next{};
    for (const std::uint64_t word : words) ++next[word >> shift & (BUCKETS - 1)];
    std::uint32_t sum = 0;
    for (std::uint32_t& n : next) sum += std::exchange(n, sum);
    for (const std::uint64_t word : words) other[next[word >> shift & (BUCKETS - 1)]++] = word;
    std::swap(words, other);
  }
}

}  // namespace dccd
