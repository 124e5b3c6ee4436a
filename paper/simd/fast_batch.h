// The kernel of the exact test's double tier (simd/exact_batch.h) without its bounds.
#pragma once

#include "simd/exact_batch.h"

namespace dccd {
namespace simd {

/// BATCH_NO or BATCH_YES for every pair, either of which may be wrong near a tie; lo = hi = the approximate TOC, cell
/// its cell.
void fastBatch(const BatchInput& input, const BatchOutput& output);

}  // namespace simd
}  // namespace dccd
