// The exact rung: the tiers of doc/algorithm.md, cheapest first, until one decides. Complete: never undecided.
#pragma once

#include "dccd/elementary.h"

namespace dccd {

/// Allocates only for coordinates that span more than
/// exact::FIXED_INTEGER_MAX_BITS bits. run() throws std::invalid_argument for a kind other than VERTEX_FACE or
/// EDGE_EDGE and where a minimum separation is asked for (the rung `conservative` has that).
class ExactRung : public Rung {
 public:
  /// toc_bits: 10 to 52; a TOC is reported as its cell of the 2^-toc_bits grid.
  explicit ExactRung(int toc_bits) : toc_bits_(toc_bits) {}
  void run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const override;

 private:
  int toc_bits_;
};

}  // namespace dccd
