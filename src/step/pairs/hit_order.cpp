#include "step/pairs/hit_order.h"

#include <algorithm>
#include <tuple>

#include "obstacle/burst.h"
#include "obstacle/radix_sort.h"

namespace dccd {
namespace {

// Below this the passes over the buckets take longer than comparing; most steps of a stream find few or none.
constexpr std::size_t FEW = 1024;

int bitsOf(std::uint64_t largest) {
  int bits = 0;
  while (bits < 64 && largest >> bits) ++bits;
  return bits;
}
std::uint64_t lowest(int bits) { return (std::uint64_t{1} << bits) - 1; }

}  // namespace

/// Stable. Key and place fit into one word.
template <class KeyOf>
void HitOrder::sortBy(const KeyOf& keyOf, int key_bits) {
  for (std::uint64_t& word : words_) word = keyOf(hitAt(word)) << place_bits_ | (word & place_);
  for (int shift = place_bits_; shift < place_bits_ + key_bits; shift += RADIX_BITS) {
    radixPass(words_, other_, shift, [](std::uint64_t word) { return word; });
  }
}

void HitOrder::beginStep() {
  for (auto* buffer : {&words_, &other_}) {
    buffer->clear();
    releaseBurst(*buffer, most_);
  }
  most_ = 0;
}

void HitOrder::sort(std::vector<const std::vector<Hit>*> parts) {
  parts_ = std::move(parts);
  std::size_t count = 0, largest = 0;
  for (const auto* part : parts_) {
    count += part->size();
    largest = std::max(largest, part->size());
  }
  offset_bits_ = bitsOf(largest);
  place_bits_ = offset_bits_ + bitsOf(parts_.size());
  offset_ = lowest(offset_bits_);
  place_ = lowest(place_bits_);
  most_ = std::max(most_, count);
  words_.clear();
  words_.reserve(count);
  std::uint64_t ranks = 0, bodies = 0;
  for (std::size_t p = 0; p < parts_.size(); ++p) {
    const std::uint64_t of_part = std::uint64_t{p} << offset_bits_;
    for (std::size_t i = 0; i < parts_[p]->size(); ++i) {
      const Hit& hit = (*parts_[p])[i];
      words_.push_back(of_part | i);
      ranks |= hit.key;
      bodies |= hit.bodies;
    }
  }
  if (count < FEW) {
    std::sort(words_.begin(), words_.end(), [this](std::uint64_t x, std::uint64_t y) {
      const Hit &one = hitAt(x), &other = hitAt(y);
      return std::tie(one.bodies, one.key) < std::tie(other.bodies, other.key);
    });
    return;
  }
  other_.resize(count);
  // Ranks and bodies fill few of their bits; side by side they need fewer digits, and mostly fit into one word.
  const int low = bitsOf(ranks & 0xffffffffu), key_bits = low + bitsOf(ranks >> 32);
  const int low_body = bitsOf(bodies & 0xffffu), all_bits = key_bits + low_body + bitsOf(bodies >> 16);
  const auto packedKey = [low](const Hit& hit) { return hit.key >> 32 << low | (hit.key & 0xffffffffu); };
  const auto packedBodies = [low_body](const Hit& hit) {
    return std::uint64_t{hit.bodies >> 16} << low_body | (hit.bodies & 0xffffu);
  };
  if (all_bits + place_bits_ <= 64) {
    sortBy([&](const Hit& hit) { return packedBodies(hit) << key_bits | packedKey(hit); }, all_bits);
    return;
  }
  sortBy([](const Hit& hit) { return hit.key & 0xffffffffu; }, low);
  sortBy([](const Hit& hit) { return hit.key >> 32; }, key_bits - low);
  sortBy(packedBodies, all_bits - key_bits);
}

}  // namespace dccd
