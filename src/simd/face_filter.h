// Faces at one time, many at once over raw arrays: which of their edges may pass through another, and how they are seen
// along the axes.
//
// Two faces. With b0 as the origin, a corner a of A is on a side of B's plane by the sign of a.(b1 x b2), and an edge
// a a' of A has the moment m = a x a'. Its line passes each edge of B, taken around B, on the side of m.b1, of
// (a' - a).(b1 x b2) + m.(b2 - b1) and of -m.b2. The same nine numbers, of the edges of A taken around A, say how the
// line of each edge of B passes A, and with a0.(a1 x a2) the sum over A's edges of m.b says on which side of A's plane
// b is. An edge of one face does not meet the other where its ends are strictly on one side of the other's plane, or
// where its line passes two edges of the other on strictly different sides (segment_filter.h has why, for degenerate
// faces, too). These are the sums of segment_filter.h, of up to four dot products with a cross product, here in float,
// u = 2^-24, of vertices that are rounded to float once. Their differences err by the same multiples of u M as there.
// By rounding, a vertex moved by at most u R along each axis, R = the largest |coordinate|, and a difference by
// e = 2u R. If e <= M, a dot product with a cross product (six products of three) changed by at most
// 18 M^2 e + 18 M e^2 + 6 e^3 <= 42 M^2 e, and else it is below 6 M^3. So margins of the same multiples of u M^2 (M +
// 2R) cover all. Underflow adds at most 2^-100 as in fused_filter.h; pairs with an M above 2^30 are kept.
//
// Along an axis a face turns one way or the other by the sign of its normal's component, certain beyond such a margin:
// e changes the component by at most 4 M e + 2 e^2. It is certain of the face as it was, as it is rounded, and of all
// between, so that the turns that are counted here do not change from one to the other. Let all faces at a vertex u
// turn the same way, and each edge at u be on two faces, which pass along it in opposite directions. Seen along the
// axis, the faces are wedges at u, one beside the other, each below half a turn. Say that a point is low where another
// coordinate of it is smaller than u's. The half-lines from u to the low points and those to the others are two halves
// of a turn, and a wedge is too narrow to pass over one of them. So for each full turn that the wedges make there is
// one which goes from a low corner to one that is not. If there is one such wedge alone, they make one turn, cover
// nothing twice, and the faces at u meet in u and in their common edges only. These comparisons are exact: a rounded
// difference has the sign of what it is taken of.
#pragma once

#include <cstddef>
#include <cstdint>

namespace dccd {
namespace simd {

/// Bits of a pair of faces: an edge of the first (k: from corner k to the next), and of the second, that may meet the
/// other face.
constexpr unsigned FIRST_EDGES = 0x07, SECOND_EDGES_SHIFT = 3;

/// Vertices as the filters take them: x, y, z from some origin in float, and a fourth number that means nothing.
struct NearVertices {
  const float* positions;
  float largest;  ///< no less than any |x|, |y| and |z| before rounding
};

/// NearVertices::largest of a largest |coordinate|: rounded up, and infinite where it is so large that nothing is to be
/// certain.
float largestNear(double largest);

/// positions: as for segmentFilter(), count of them. origin: x, y, z and 0. Writes NearVertices::positions.
void moveNear(const double* positions, std::size_t count, const double* origin, float* near);

/// Faces in groups, by their slots, and which of their edges are asked about (FIRST_EDGES).
struct FacesView {
  const std::uint32_t* vertices;  ///< as in GroupsView::vertices (simd/group_pairs.h)
  const std::uint8_t* edges;
};

/// slots: of A in a and of B in b for each pair, whose corners are all different. edges: such bits for each pair, of
/// the edges that are asked about. Returns how many these are.
std::size_t facePairFilter(const NearVertices& vertices, const FacesView& a, const FacesView& b,
                           const std::uint32_t* slots, std::size_t count, std::uint8_t* edges);

/// Bits of how a face is seen: TURNS_LEFT << k and TURNS_RIGHT << k along axis k; RISES << (3 c + k): from the corner
/// after corner c to the one after that it goes from low to not low.
constexpr unsigned TURNS_LEFT = 1, TURNS_RIGHT = 1 << 3, RISES = 1 << 6;

/// groups: of 16 faces as in FacesView::vertices, UINT32_MAX in empty lanes, whose bits mean nothing. views: such bits
/// of each face.
void faceViews(const NearVertices& vertices, const std::uint32_t* groups, std::size_t count, std::uint16_t* views);

}  // namespace simd
}  // namespace dccd
