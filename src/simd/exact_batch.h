// Batched elementary tests: pairs as lanes, double precision, 1/2/4/8 wide by SIMD target, chosen at run time.
// exactBatch() is tier T1 of the exact test: every verdict but UNDECIDED is proved, rounding included (the bounds are
// derived in exact_batch_bounds.h). It uses only correctly rounded operations in one fixed order, so that each lane's
// result is the same bit for bit on every target. The rival `fast` (paper/) is the same kernel without the bounds.
// Raw arrays only: this folder includes nothing of the package.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

enum class BatchKind : std::uint8_t { VERTEX_FACE = 0, EDGE_EDGE = 1 };

/// What a batch says of one pair.
enum BatchVerdict : std::uint8_t {
  BATCH_NO = 0,          ///< certainly no contact in [0,1]
  BATCH_YES = 1,         ///< certainly a contact; the TOC certainly lies in cell `cell`
  BATCH_UNDECIDED = 2,   ///< not certain either way; the other outputs mean nothing
  BATCH_YES_BRACKET = 3  ///< certainly a contact whose TOC is the only root of f in (lo, hi); the cell is not certain
};

/// Pairs of one kind. No pointer is written through.
struct BatchInput {
  const double* vertices = nullptr;           ///< 8 per vertex: x0 y0 z0 0 x1 y1 z1 0; finite; 64-byte aligned
  const std::uint32_t (*quads)[4] = nullptr;  ///< vertex indices; VF v f0 f1 f2, EE ea0 ea1 eb0 eb1
  std::size_t count = 0;
  BatchKind kind = BatchKind::VERTEX_FACE;
  int toc_bits = 32;  ///< 10 to 52: cell k is [k 2^-toc_bits, (k+1) 2^-toc_bits)
};

/// One entry per pair in each array; all arrays are required.
/// lo and hi (YES and YES_BRACKET): multiples of 2^-52, 0 <= lo < hi <= 1; f, the pair's coplanarity cubic
/// (VF ((b-a)x(c-a)).(p-a), EE ((b-a)x(d-c)).(c-a)) has certified opposite signs at lo and hi and exactly one root
/// in between, which is the TOC.
struct BatchOutput {
  std::uint8_t* verdict = nullptr;  ///< BatchVerdict
  std::uint64_t* cell = nullptr;    ///< BATCH_YES: the TOC's cell, 0 to 2^toc_bits - 1
  double* lo = nullptr;
  double* hi = nullptr;
};

/// The certified double tier. Allocates nothing; safe from several threads. Rounding must be to nearest.
void exactBatch(const BatchInput& input, const BatchOutput& output);

}  // namespace simd
}  // namespace dccd
