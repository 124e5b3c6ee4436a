// Records of vertices and bounds of groups of nodes, over raw arrays (doc/algorithm.md, "Linear filter"). group_pairs.h
// tests pairs of them.
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

constexpr std::size_t SOA_T1 = 128;  ///< where the values at t1 begin in a half of a soa

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

/// The same aos, without margins, and nothing else.
void boundGroups(const std::int16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 std::int16_t* aos);

/// Groups of the level above: child_aos holds child_count bounds; groups are filled up with empty lanes.
void buildUpper(const std::int16_t* child_aos, std::size_t child_count, std::int16_t* soa, std::int16_t* aos);

constexpr std::int32_t WHOLE_STEP = 1 << 15;  ///< the time t1 for shortenBounds()

/// Puts the time `end` (1 to WHOLE_STEP, in 2^-15 of the step) in the place of t1 in the bounds of `groups` groups, so
/// that they tell what is apart from t0 to there; or, swept, what holds a node all the way to it. Not for bounds with a
/// margin: what is cut off at the records' range moves on no line. In proof: a value q at t0 and q' at t1 says that the
/// scaled projection lies in [q, q + 1) and [q', q' + 1), but for its roundings, which the caller knows to be below
/// 2^-10. It moves on a line, so at the time s it lies in (1-s) q + s q' + [0, 1); the smallest of a node's vertices is
/// above the line of the smallest values, the largest below that of the largest. Smallest values are rounded down and
/// largest up, and each goes one further: two nodes in strict order are then apart by more than those roundings,
/// whether the bounds of one or of both were moved.
void shortenBounds(std::int16_t* soa, std::int16_t* aos, std::size_t groups, std::int32_t end, bool swept);

}  // namespace simd
}  // namespace dccd
