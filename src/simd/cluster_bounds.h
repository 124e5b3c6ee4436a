// Records of vertices and bounds of groups of nodes, over raw arrays (doc/algorithm.md, "Linear filter"). group_pairs.h
// tests pairs of them.
//
// Every vertex has a record of 16 uint16: its projections onto the 8 directions at t0, then at t1. Sixteen nodes
// (features, or groups of the level below) form a group, stored as structure of arrays:
//   soa[soaIndex(k, lane)]        smallest record value k of the node in that lane  (k < 16)
//   soa[256 + soaIndex(k, lane)]  turned() of the largest: the smallest of the turned values
// (two neighbouring directions side by side, so that one broadcast of 32 bits serves both), and as the bounds of the
// group itself: aos[k] and aos[16 + k] alike. Unused lanes are EMPTY and separated from everything.
//
// A smallest value a is strictly above a largest one b where a + turned(b) >= 2^16 - 1, that is where the highest bit
// of (a + turned(b) + 1) / 2 is set. That is one instruction (the rounded average of unsigned numbers), and all that is
// needed of it is that bit.
//
// Why the test on quantised numbers is conservative: a record value is a composition of monotone non-decreasing
// functions of the exact projection n.x of the vertex: one rounded sum, minus a constant, times a positive constant,
// truncated, plus a constant. So q(a) > q(b) implies n.a > n.b exactly, with no margin at all. A node's smallest and
// largest value are attained by its vertices. If all of A's values exceed all of B's strictly, at t0 and at t1,
// then every vertex difference keeps its sign over the step (it is linear in t), and so do convex combinations of
// them: the features never meet (paper, Corollary 2).
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

constexpr std::size_t GROUP = 16;           ///< nodes in a group
constexpr std::size_t DIRECTIONS = 8;       ///< x, y, z, x+y, x+z, y+z, x-y, y-z
constexpr std::size_t RECORD = 16;          ///< values of a vertex
constexpr std::size_t SOA_SIZE = 512;       ///< values of a group
constexpr std::size_t AOS_SIZE = 32;        ///< values of a group's bounds
constexpr std::uint16_t EMPTY = 65534;      ///< larger than any value, turned or not
constexpr std::uint16_t UNBOUNDED = 32767;  ///< as a margin: as far as the records go, on both sides
constexpr std::uint16_t RECORD_LOWEST = 3;  ///< record values lie in [3, 65531],
constexpr double RECORD_RANGE = 65528.0;    ///< which are so many and one, and so do turned ones

constexpr std::size_t SOA_T1 = 128;  ///< where the values at t1 begin in a half of a soa

/// The other way round, within the same range.
constexpr std::uint16_t turned(std::uint16_t value) { return static_cast<std::uint16_t>(EMPTY - value); }

/// Where value k (< RECORD) of a lane stands in its half of a group's soa.
constexpr std::size_t soaIndex(std::size_t k, std::size_t lane) { return (k / 2 * GROUP + lane) * 2 + k % 2; }

/// Smallest and largest projection per direction over both times. vertices: n x 8 doubles (x0 y0 z0 0 x1 y1 z1 0).
/// min8 and max8 are read first, so that calls over pieces can be chained.
void projectionBounds(const double* vertices, std::size_t n, double* min8, double* max8);

/// Records of n vertices: trunc((projection - low[d]) * scale[d]) + RECORD_LOWEST, cut off at both ends of the range.
void quantize(const double* vertices, std::size_t n, const double* low8, const double* scale8, std::uint16_t* records);

/// Groups of features with `arity` vertices each (1 to 3). indices: count x arity, UINT32_MAX in the first place
/// marks an empty lane; count is a multiple of 16. margin16: widens both sides of value k (separation, radii) by 0 to
/// 32766, or by UNBOUNDED for all that is more; or null.
void buildLeaves(const std::uint16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 const std::uint16_t* margin16, std::uint16_t* soa, std::uint16_t* aos);

/// The same aos, without margins, and nothing else.
void boundGroups(const std::uint16_t* records, const std::uint32_t* indices, std::size_t arity, std::size_t count,
                 std::uint16_t* aos);

/// Groups of the level above: child_aos holds child_count bounds; groups are filled up with empty lanes.
void buildUpper(const std::uint16_t* child_aos, std::size_t child_count, std::uint16_t* soa, std::uint16_t* aos);

constexpr std::int32_t WHOLE_STEP = 1 << 15;  ///< the time t1 for shortenBounds()

/// Puts the time `end` (1 to WHOLE_STEP, in 2^-15 of the step) in the place of t1 in the bounds of `groups` groups, so
/// that they tell what is apart from t0 to there; or, swept, what holds a node all the way to it. Not for bounds with a
/// margin: what is cut off at the records' range moves on no line. In proof: a value q at t0 and q' at t1 says that the
/// scaled projection lies in [q, q + 1) and [q', q' + 1), but for its roundings, which the caller knows to be below
/// 2^-10. It moves on a line, so at the time s it lies in (1-s) q + s q' + [0, 1); the smallest of a node's vertices is
/// above the line of the smallest values, the largest below that of the largest. Smallest values are rounded down and
/// largest up (turned, they are smallest ones), and each goes one further: two nodes in strict order are then apart by
/// more than those roundings, whether the bounds of one or of both were moved.
void shortenBounds(std::uint16_t* soa, std::uint16_t* aos, std::size_t groups, std::int32_t end, bool swept);

}  // namespace simd
}  // namespace dccd
