// Kernels of the clustered broad phase over raw arrays (doc/algorithm.md, "Linear filter").
//
// Every vertex has a record of 16 int16: its projections onto the 8 directions at t0, then at t1. Sixteen nodes
// (features, or groups of the level below) form a group, stored as structure of arrays:
//   soa[soaIndex(k, lane)]        smallest record value k of the node in that lane  (k < 16)
//   soa[256 + soaIndex(k, lane)]  largest
// (two neighbouring directions side by side, so that one broadcast of 32 bits serves both), and as the bounds of the
// group itself: aos[k] smallest, aos[16 + k] largest. Unused lanes are empty (smallest EMPTY_LO, largest EMPTY_HI) and
// separated from everything.
//
// Why the test on quantised numbers is conservative: a record value is a composition of monotone non-decreasing
// functions of the exact projection n.x of the vertex: one rounded sum, minus a constant, times a positive constant,
// plus a constant, truncated. So q(a) > q(b) implies n.a > n.b exactly, with no margin at all. A node's smallest and
// largest value are attained by its vertices. If all of A's values exceed all of B's strictly, at t0 and at t1,
// then every vertex difference keeps its sign over the step (it is linear in t), and so do convex combinations of
// them: the features never meet (paper, Corollary 2).
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

constexpr std::size_t GROUP = 16;          ///< nodes in a group
constexpr std::size_t DIRECTIONS = 8;      ///< x, y, z, x+y, x+z, y+z, x-y, y-z
constexpr std::size_t RECORD = 16;         ///< int16 of a vertex
constexpr std::size_t SOA_SIZE = 512;      ///< int16 of a group
constexpr std::size_t AOS_SIZE = 32;       ///< int16 of a group's bounds
constexpr std::int16_t EMPTY_LO = 32767;   ///< larger than any record value
constexpr std::int16_t EMPTY_HI = -32767;  ///< smaller than any record value
constexpr std::int16_t UNBOUNDED = 32767;  ///< as a margin: as far as the records go, on both sides
constexpr double RECORD_RANGE = 65528.0;   ///< record values lie in [-32764, 32764]

/// Where value k (< RECORD) of a lane stands in its half of a group's soa.
constexpr std::size_t soaIndex(std::size_t k, std::size_t lane) { return (k / 2 * GROUP + lane) * 2 + k % 2; }

/// Smallest and largest projection per direction over both times. vertices: n x 8 doubles (x0 y0 z0 0 x1 y1 z1 0).
/// min8 and max8 are read first, so that calls over pieces can be chained.
void projectionBounds(const double* vertices, std::size_t n, double* min8, double* max8);

/// Records of n vertices: trunc((projection - low[d]) * scale[d]) - 32764, cut off at both ends of the range.
void quantize(const double* vertices, std::size_t n, const double* low8, const double* scale8, std::int16_t* records);

/// Groups of features with `arity` vertices each (1 to 3). indices: count x arity, UINT32_MAX in the first place
/// marks an empty lane; count is a multiple of 16. margin16: widens both sides of value k (separation, radii) by 0 to
/// 32766, or by UNBOUNDED for all that is more; or null.
void buildLeaves(const std::int16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 const std::int16_t* margin16, std::int16_t* soa, std::int16_t* aos);

/// The bounds of the groups alone, as buildLeaves() has them: for what is seen to be apart without a look at its
/// members.
void boundLeaves(const std::int16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 const std::int16_t* margin16, std::int16_t* aos);

/// Groups of the level above: child_aos holds child_count bounds; groups are filled up with empty lanes.
void buildUpper(const std::int16_t* child_aos, std::size_t child_count, std::int16_t* soa, std::int16_t* aos);

/// One level of a tree for testGroupPairs.
struct GroupsView {
  const std::int16_t* soa;
  const std::int16_t* aos;
};

/// Which (lane i, lane j) to report for a pair of a group with itself.
enum class Diagonal : std::uint8_t { ALL = 0, UPPER_WITH_DIAGONAL = 1, STRICT_UPPER = 2 };

/// Linear filter between the nodes of each group pair (a[2p], b[2p+1]). Writes the surviving node pairs as
/// (a * 16 + i, b * 16 + j) to out (room for `capacity` pairs), stops before it could overflow.
/// diagonal applies to pairs with equal indices when self is true. times: 2 tests t0 and t1, 1 tests t0 alone.
/// Returns the number of pairs written; *consumed is the number of group pairs done.
std::size_t testGroupPairs(const GroupsView& a, const GroupsView& b, const std::uint32_t* group_pairs,
                           std::size_t count, bool self, Diagonal diagonal, bool t0_only, std::uint32_t* out,
                           std::size_t capacity, std::size_t* consumed);

/// Which lanes of two groups share a vertex: bit j of shared[i] says that feature i of a and feature j of b do. Empty
/// lanes share none. indices_a, indices_b: 16 features of a_arity and b_arity vertices each, UINT32_MAX in empty ones.
/// Returns whether any do.
bool sharedVertices(const std::uint32_t* indices_a, std::size_t a_arity, const std::uint32_t* indices_b,
                    std::size_t b_arity, std::uint16_t* shared);

/// testGroupPairs() for one pair of leaf groups (g, h), STRICT_UPPER, both times, without the lanes in `shared`, which
/// may be null: what it writes is what that would write, in that order, less those. out has room for 256 pairs.
std::size_t testLeafPair(const GroupsView& a, const GroupsView& b, std::uint32_t g, std::uint32_t h, bool self,
                         const std::uint16_t* shared, std::uint32_t* out);

/// How far the features of two leaf groups are apart at t1, in any of the directions, of which `weights` says how much
/// a record unit counts, in 2^-16 of a common unit. Rounded down; EMPTY_LO where there is no pair. Pairs in `shared`
/// (may be null) do not count, nor do those (i, j) that are listed in `near`: those less than `target` apart, as i * 16
/// + j, up to `room`; *found says how many there are. self: each pair once, and none with itself. In proof: a gap of n
/// record units between two numbers truncated to a unit is one of more than n - 1 of the projections, and the
/// directions' lengths and the rounding are the weights' affair.
std::int16_t gapAtEnd(const GroupsView& a, const GroupsView& b, std::uint32_t g, std::uint32_t h, bool self,
                      const std::uint16_t* shared, const std::uint16_t* weights, std::int16_t target,
                      std::uint8_t* near, std::size_t room, std::size_t* found);

}  // namespace simd
}  // namespace dccd
