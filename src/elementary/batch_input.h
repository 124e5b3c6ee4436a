// What all rungs do with a batch of pairs before a kernel gets it, and what that says of a block of them.
#pragma once

#include "dccd/elementary.h"
#include "simd/exact_batch.h"

namespace dccd {

/// The batch as the kernels take it, with none of its pairs. Throws std::invalid_argument where the rung cannot answer
/// for its kind, or for the distance that it asks for.
simd::BatchInput inputOf(const PairBatch& batch, Accuracy rung);

constexpr std::size_t BLOCK = 512;  ///< pairs whose outputs of the batched tier lie on the stack at once

/// The batched tier's outputs for one block.
struct BlockOutput {
  std::uint8_t verdict[BLOCK];
  std::uint64_t cell[BLOCK];
  double lo[BLOCK], hi[BLOCK];
};

/// The pairs from `begin` on, at most BLOCK of them.
void setBlock(const PairBatch& batch, std::size_t begin, simd::BatchInput& input);

}  // namespace dccd
