// Kernels of the hierarchy of 16-DOPs over the paper's records: refit, merge, overlap. Raw arrays only.
//
// A 16-DOP is 16 floats, 64-byte aligned: 8 smallest values, then 8 largest, in the lanes' order of the record. An
// empty one has smallest > largest in every lane and overlaps nothing. Nodes 0 .. leaf_count-1 are leaves (primitives);
// node leaf_count + i is inner with children[2i] and children[2i+1]. Bounds are minima and maxima of stored values,
// which are monotone in the exact projections: no margin.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

/// Swept bounds of `count` leaves with 3 vertex indices each, widened by widen8[k] on both sides of lane k.
void dopRefitLeaves(const float* records, const std::uint32_t* vertices, std::size_t count, const float* widen8,
                    float* dops);

/// Bounds of the inner nodes begin .. end-1 from their children's; children have smaller numbers than their parents.
void dopMergeNodes(const std::uint32_t* children, std::size_t leaf_count, std::size_t begin, std::size_t end,
                   float* dops);

struct DopTree {
  const float* dops;
  const std::uint32_t* children;
  std::size_t leaf_count;
};

/// Descends from the node pairs on `stack` (2 numbers a pair; a pair (n, n) stands for all pairs within n) and writes
/// leaf pairs with overlapping bounds to `out`, 2 numbers a pair, until the stack is empty or fewer than 4 pairs fit.
/// Pairs on the stack are taken as overlapping. The stack needs room for 3 more pairs per level below its top.
/// Returns the number of pairs written; *stack_size (in pairs) is updated. Resume by calling again.
std::size_t dopDescend(const DopTree& tree, std::uint32_t* stack, std::size_t* stack_size, std::uint32_t* out,
                       std::size_t capacity);

/// Leaves j in [begin, end) whose bounds overlap leaf i's. Writes them to `out` (room for end - begin).
std::size_t dopOverlapRange(const float* dops, std::size_t i, std::size_t begin, std::size_t end, std::uint32_t* out);

/// Whether two 16-DOPs share a point in every direction.
bool dopOverlap(const float* a, const float* b);

}  // namespace simd
}  // namespace dccd
