#include "step/hit_order.h"

#include <algorithm>
#include <array>

#include "obstacle/burst.h"

namespace dccd {
namespace {
constexpr int BITS = 12;
constexpr std::size_t BUCKETS = std::size_t{1} << BITS;
// Below this the passes over the buckets take longer than comparing; most steps of a stream find few or none.
constexpr std::size_t FEW = 1024;
}  // namespace

// Stable: sorting by key first and by bodies afterwards orders by bodies, then by key.
void HitOrder::sortByKey(std::uint64_t differing_bits) {
  for (int shift = 0; shift < 64; shift += BITS) {
    const std::uint64_t digit = (BUCKETS - 1) << shift;
    if ((differing_bits & digit) == 0) continue;
    std::array<std::size_t, BUCKETS> next{};
    for (const Entry& e : a_) ++next[(e.key >> shift) & (BUCKETS - 1)];
    std::size_t sum = 0;
    for (std::size_t& n : next) {
      const std::size_t count = n;
      n = sum;
      sum += count;
    }
    for (const Entry& e : a_) b_[next[(e.key >> shift) & (BUCKETS - 1)]++] = e;
    std::swap(a_, b_);
  }
}

void HitOrder::beginStep() {
  for (auto* buffer : {&a_, &b_}) {
    buffer->clear();
    releaseBurst(*buffer, most_);
  }
  most_ = 0;
}

const std::vector<HitOrder::Entry>& HitOrder::sort(const std::vector<const std::vector<Hit>*>& parts) {
  std::size_t count = 0;
  for (const auto* part : parts) count += part->size();
  a_.clear();
  a_.reserve(count);
  std::uint64_t key_or = 0, key_and = ~std::uint64_t{0}, bodies_or = 0, bodies_and = ~std::uint64_t{0};
  for (const auto* part : parts) {
    for (const Hit& h : *part) {
      a_.push_back({h.key, &h});
      key_or |= h.key;
      key_and &= h.key;
      bodies_or |= h.bodies;
      bodies_and &= h.bodies;
    }
  }
  most_ = std::max(most_, count);
  if (count < FEW) {
    std::sort(a_.begin(), a_.end(), [](const Entry& x, const Entry& y) {
      return x.hit->bodies != y.hit->bodies ? x.hit->bodies < y.hit->bodies : x.key < y.key;
    });
    return a_;
  }
  b_.resize(count);
  // The ranks fill few of their 32 bits; side by side they need fewer digits.
  int low_bits = 0;
  while (low_bits < 32 && (key_or & 0xffffffffu) >> low_bits) ++low_bits;
  const auto packed = [low_bits](std::uint64_t key) { return key >> 32 << low_bits | (key & 0xffffffffu); };
  for (Entry& e : a_) e.key = packed(e.key);
  sortByKey(packed(key_or) ^ packed(key_and));
  // With several pairs of bodies the key is not enough: the second feature's body comes before the first one's rank.
  if (bodies_or != bodies_and) {
    for (Entry& e : a_) e.key = e.hit->bodies;
    sortByKey(bodies_or ^ bodies_and);
  }
  return a_;
}

}  // namespace dccd
