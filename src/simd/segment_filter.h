// Segments against triangles at one time, many pairs at a time over raw arrays: in doubles, as far as these can tell.
//
// With p as the origin, let a, b, c, q be differences to it. Their cross products bc = b x c, ca, ab give every sign:
//   the face's plane has p on the side of -a.bc and q on that of q.(bc + ca + ab) - a.bc (up to one common sign);
//   where the line pq meets the face at u a + v b + w c (u + v + w = 1, none negative), with some K
//   (q.bc, q.ca, q.ab) = K (u, v, w), so two of these with opposite strict signs show the line to miss the face,
//   degenerate or not.
// In the projection onto a coordinate plane components of these products are 2D cross products. The triangle may be
// strictly on one side of the line pq there, or the segment strictly beyond the line of one of the triangle's edges.
// Where all five points have the same coordinate, nothing is lost in the projection along it: then the pair meets where
// an end is strictly inside, or an edge of the triangle is crossed, each one's ends strictly on different sides of the
// other.
//
// Rounding, u = 2^-53, M = largest |difference|, differences rounded once: a component of a cross product errs by
// 2 * 3u M^2 + 2u M^2 = 8u M^2 and is at most 2 M^2; a dot product with one by 3 (8 + 2 + 2)u M^3 + (4 + 6)u M^3 =
// 46u M^3 and is at most 6 M^3; the sum of three of these and a fourth by 4 * 46u M^3 + (12 + 18 + 24)u M^3 = 238u M^3.
// The margins 47u M^3 and 240u M^3 cover the terms in u^2 and their own rounding. In a coordinate plane the longest
// sums have three terms, such as (b - q) x (c - q) = bc + (qb - qc), and err by at most (3 * 8 + 4 + 6)u M^2; 35u M^2
// is used. Underflow: fewer than 100 operations lose at most 2^-1075 each, times factors of at most M^2 <= 2^60: below
// 2^-1000. On a coordinate axis a rounded difference keeps the order of what it is taken of, whatever its size.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

enum SegmentVerdict : std::uint8_t { SEGMENT_APART = 0, SEGMENT_MEETS = 1, SEGMENT_UNDECIDED = 2 };

/// Do the closed segment pq and the closed triangle abc meet? Either may be degenerate. positions: 8 doubles a vertex,
/// of which the first three are read, finite, aligned to 32 bytes; pairs: p q a b c of each. The verdicts are the same
/// on every target. Rounding must be to nearest.
void segmentFilter(const double* positions, const std::uint32_t* pairs, std::size_t count, std::uint8_t* verdicts);

}  // namespace simd
}  // namespace dccd
