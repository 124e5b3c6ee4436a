#include "detector/hit_order.h"

#include <array>

namespace deformable_ccd {
namespace {
constexpr int BITS = 11;
constexpr std::size_t BUCKETS = std::size_t{1} << BITS;
}  // namespace

const std::vector<const Hit*>& HitOrder::sort(const std::vector<const std::vector<Hit>*>& parts) {
  a_.clear();
  std::uint64_t all_or = 0, all_and = ~std::uint64_t{0};
  for (const auto* part : parts) {
    for (const Hit& h : *part) {
      a_.push_back({h.key, &h});
      all_or |= h.key;
      all_and &= h.key;
    }
  }
  b_.resize(a_.size());
  for (int shift = 0; shift < 64; shift += BITS) {
    const std::uint64_t digit = (BUCKETS - 1) << shift;
    if (((all_or ^ all_and) & digit) == 0) continue;  // the digit is the same in all keys
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
  sorted_.resize(a_.size());
  for (std::size_t i = 0; i < a_.size(); ++i) sorted_[i] = a_[i].hit;
  return sorted_;
}

}  // namespace deformable_ccd
