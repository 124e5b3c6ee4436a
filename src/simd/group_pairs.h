// Kernels of the clustered broad phase that test pairs of groups of nodes (cluster_bounds.h).
#pragma once

#include "simd/cluster_bounds.h"

namespace dccd {
namespace simd {

/// One level of a tree for testGroupPairs.
struct GroupsView {
  const std::uint16_t* soa;
  const std::uint16_t* aos;
  const std::uint32_t* vertices = nullptr;  ///< of leaves: lane j's k-th at [(group * arity + k) * GROUP + j], aligned
  std::size_t arity = 0;
};

/// Which (lane i, lane j) to report for a pair of a group with itself.
enum class Diagonal : std::uint8_t { ALL = 0, UPPER_WITH_DIAGONAL = 1, STRICT_UPPER = 2 };

/// Linear filter between the nodes of each group pair (a[2p], b[2p+1]). Writes the surviving node pairs as
/// (a * 16 + i, b * 16 + j) to out (room for `capacity` pairs, 256 or more), stops before it could overflow.
/// diagonal applies to pairs with equal indices when self is true. t0_only: nothing is read of t1, so that arrays that
/// begin with the values at t1 test t1 alone.
/// Returns the number of pairs written; *consumed is the number of group pairs done.
std::size_t testGroupPairs(const GroupsView& a, const GroupsView& b, const std::uint32_t* group_pairs,
                           std::size_t count, bool self, Diagonal diagonal, bool t0_only, std::uint32_t* out,
                           std::size_t capacity, std::size_t* consumed);

/// testGroupPairs() for leaves with vertices, STRICT_UPPER, without the pairs that share one; both trees are of the
/// same body, and their features have 1 and 3, 2 and 2, or 2 and 3 vertices.
std::size_t testUnsharedPairs(const GroupsView& a, const GroupsView& b, const std::uint32_t* group_pairs,
                              std::size_t count, bool self, bool t0_only, std::uint32_t* out, std::size_t capacity,
                              std::size_t* consumed);

/// Pairs of lanes of two groups: bit j of rows[i], and bit i of columns[j], for lane i of the first one and lane j of
/// the other.
struct alignas(64) LanePairs {
  std::uint16_t rows[GROUP], columns[GROUP];
};

/// Pairs of features of one tree, by their groups: those of group g and group others[k], which is not smaller, are
/// pairs[k], k from begin[g] to begin[g + 1]. Of a group with itself rows alone are looked at, and a pair stands there
/// in both orders. Behind the last one 8 more of others can be read.
struct KnownPairs {
  const std::uint32_t *begin, *others;
  const LanePairs* pairs;
};

/// testGroupPairs() of a tree with itself, ALL, at t0 alone, without those pairs. A row, or column, of which nothing is
/// left is no work.
std::size_t testOtherPairs(const GroupsView& tree, const std::uint32_t* group_pairs, std::size_t count,
                           const KnownPairs& left_out, std::uint32_t* out, std::size_t capacity, std::size_t* consumed);

}  // namespace simd
}  // namespace dccd
