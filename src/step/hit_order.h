// Hits of all workers into the canonical order.
#pragma once

#include <cstdint>
#include <vector>

#include "step/pair_worker.h"

namespace dccd {

/// Sorts hits by bodies, then by key (many by a radix sort on the digits in use; no two are equal in both). Keeps its
/// buffers.
class HitOrder {
 public:
  struct Entry {
    std::uint64_t key;  // changed by the sort, and without a meaning in its result
    const Hit* hit;     // in a worker's vector
  };
  /// The result is valid until the next call.
  const std::vector<Entry>& sort(const std::vector<const std::vector<Hit>*>& parts);
  /// A step begins: gives back what the last one had no use for.
  void beginStep();

 private:
  void sortByKey(std::uint64_t differing_bits);
  std::vector<Entry> a_, b_;
  std::size_t most_ = 0;  // the largest number of hits in one call since beginStep()
};

}  // namespace dccd
