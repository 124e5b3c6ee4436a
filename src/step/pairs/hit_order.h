// Hits of all workers into the canonical order.
#pragma once

#include <cstdint>
#include <vector>

#include "step/pairs/pair_worker.h"

namespace dccd {

/// Sorts hits by bodies, then by key: many by a radix sort of words that hold both and the hit's place. No two hits are
/// equal in both. Keeps its buffers.
class HitOrder {
 public:
  /// parts: the workers' hits, which stay where they are as long as the order is asked for.
  void sort(std::vector<const std::vector<Hit>*> parts);
  std::size_t size() const { return words_.size(); }
  /// The hit that comes i-th.
  const Hit& operator[](std::size_t i) const { return hitAt(words_[i]); }
  /// A step begins: gives back what the last one had no use for.
  void beginStep();

 private:
  const Hit& hitAt(std::uint64_t word) const {
    return (*parts_[(word & place_) >> offset_bits_])[word & place_ & offset_];
  }
  template <class KeyOf>
  void sortBy(const KeyOf& keyOf, int key_bits);

  std::vector<const std::vector<Hit>*> parts_;
  int offset_bits_ = 0, place_bits_ = 0;
  std::uint64_t offset_ = 0, place_ = 0;      // masks: of the place in a part, and with the part's number above it
  std::vector<std::uint64_t> words_, other_;  // a key, and below it a place
  std::size_t most_ = 0;                      // the largest number of hits in one call since beginStep()
};

}  // namespace dccd
