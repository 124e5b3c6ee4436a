// What all rungs do with a batch of pairs before a kernel gets it.
#pragma once

#include "dccd/elementary.h"
#include "simd/exact_batch.h"

namespace dccd {

/// The batch as the kernels take it, with none of its pairs. Throws std::invalid_argument where the rung cannot answer
/// for its kind, or for the distance that it asks for.
simd::BatchInput inputOf(const PairBatch& batch, Accuracy rung);

/// The pairs from `begin` on, at most `most` of them.
void setBlock(const PairBatch& batch, std::size_t begin, std::size_t most, simd::BatchInput& input);

}  // namespace dccd
