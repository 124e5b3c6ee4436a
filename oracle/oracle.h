// The oracle: does a pair meet during the step, and when first, decided exactly, simply and slowly.
//
// It shares no code and no formula with src/elementary. Two convex features meet when the origin lies in the convex
// hull of their Minkowski difference: w_i(t) = corner minus vertex (VF, three points) or the four differences of end
// points (EE), each moving linearly. By Caratheodory's theorem the hull of points in a plane (EE: a parallelogram) is
// the union of the triangles over three of them, so one question is left: does the triangle u v w contain the origin?
//   - u, v, w not coplanar with the origin, u.(v x w) != 0: no.
//   - Else, area not zero: yes when no two of u x v, v x w, w x u point in opposite directions (their dot products are
//     not negative).
//   - Area zero: the triangle is the union of its sides; the origin is on side uv when |u x v|^2 = 0 and u.v <= 0.
// These are signs of polynomials in t of degree at most 4. The answer can change only at their roots, and the set of
// contact times is closed, so that the first contact is at 0 or at a root. Contact needs u.(v x w) = 0: where that
// polynomial is not zero throughout, its roots are the only candidates.
// firstContactThorough() does not use the last two remarks: it tests all roots of all polynomials, 0, 1, and a
// rational time between each two neighbours.
#pragma once

#include <optional>

#include "dccd/elementary.h"
#include "oracle/algebraic.h"

namespace dccd {
namespace test {

/// The exact time of first contact in [0,1], or none. All coordinates must be finite; kind VERTEX_FACE or EDGE_EDGE.
std::optional<Root> firstContact(PairKind kind, const PairMotion& pair);

/// The same without its shortcuts (see above). Throws std::logic_error where they would have given another answer.
std::optional<Root> firstContactThorough(PairKind kind, const PairMotion& pair);

/// True time minus reported time, in steps: exact sign, magnitude right to 2^-70. Negative means reported late.
double tocError(Root& true_toc, double reported);

/// Whether the cell of `bits` bits that exact reports is the one that holds the true time.
bool isCellOf(Root& true_toc, const ElementaryResult& result, int bits);

}  // namespace test
}  // namespace dccd
