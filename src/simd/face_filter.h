// Faces at one time, many at once over raw arrays: which of their edges may pass through another, and how they are seen
// along the axes.
//
// Two faces. With b0 as the origin, a corner a of A is on a side of B's plane by the sign of a.(b1 x b2), and an edge
// a a' of A has the moment m = a x a'. Its line passes each edge of B, taken around B, on the side of m.b1, of
// (a' - a).(b1 x b2) + m.(b2 - b1) and of -m.b2. The same nine numbers, of the edges of A taken around A, say how the
// line of each edge of B passes A, and with a0.(a1 x a2) the sum over A's edges of m.b says on which side of A's plane
// b is. An edge of one face does not meet the other where its ends are strictly on one side of the other's plane, or
// where its line passes two edges of the other on strictly different sides (segment_filter.h has why, for degenerate
// faces, too). Where it is kept and all these signs are strict, its ends are on different sides of the other's plane
// and its line passes all edges on one side: it meets the inside of the other. These are the sums of segment_filter.h,
// of up to four dot products with a cross product, here in float, u = 2^-24, of vertices that are rounded to float
// once. Their differences err by the same multiples of u M as there. By rounding, a vertex moved by at most u R along
// each axis, R = the largest |coordinate|, and a difference by e = 2u R. If e <= M, a dot product with a cross product
// (six products of three) changed by at most 18 M^2 e + 18 M e^2 + 6 e^3 <= 42 M^2 e, and else it is below 6 M^3. So
// margins of the same multiples of u M^2 (M + 2R) cover all. Underflow adds at most 2^-100 as in fused_filter.h; pairs
// with an M above 2^30 are kept.
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
/// other face; and the same again of those that certainly do.
constexpr unsigned SECOND_EDGES_SHIFT = 3, MEETS_SHIFT = 8;

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

/// Faces in groups, by their slots, and which of their edges are asked about: bit k of the k-th.
struct FacesView {
  const std::uint32_t* vertices;  ///< as in GroupsView::vertices (simd/group_pairs.h)
  const std::uint8_t* edges;
};

struct FacesLeft {
  std::size_t asked;  ///< edges of the pairs
  std::size_t left;   ///< pairs with any such bit
};

/// slots: of A in a and of B in b for each pair, count <= MOST_FACE_PAIRS. asked: of each pair, the bits of the edges
/// that are asked about; null: those of the views. Faces that share a corner may be asked about the edges that do not
/// end there: nothing of them is called certain. left: of those pairs with any such bit of an edge that is asked about,
/// in order, the place << PLACE_SHIFT and these bits; has room for PAIRS_BEHIND more than count.
constexpr unsigned PLACE_SHIFT = 16;
constexpr std::size_t MOST_FACE_PAIRS = 1 << 16, PAIRS_BEHIND = 16;
FacesLeft facePairFilter(const NearVertices& vertices, const FacesView& a, const FacesView& b,
                         const std::uint32_t* slots, const std::uint8_t* asked, std::size_t count, std::uint32_t* left);

/// Bits of how a face is seen: TURNS_LEFT << k and TURNS_RIGHT << k along axis k; RISES << (8 k + c): from the corner
/// after corner c to the one after that it goes from low to not low.
constexpr unsigned TURNS_LEFT = 1, TURNS_RIGHT = 1 << 3, TURNS = 0x3f, RISES = 1 << 8;

/// groups: of 16 faces as in FacesView::vertices, UINT32_MAX in empty lanes, whose bits mean nothing. views: such bits
/// of each face.
void faceViews(const NearVertices& vertices, const std::uint32_t* groups, std::size_t count, std::uint32_t* views);

/// The faces at each vertex, of 16 vertices side by side: lane j of rows begin[g] to begin[g + 1] holds those at vertex
/// 16 g + j, a face's slot times 4 and which of its corners the vertex is. A lane with fewer of them is filled up with
/// those of a slot whose view is TURNS. At most 255 rows.
struct FansView {
  const std::uint32_t* begin;
  const std::uint32_t* corners;  ///< GROUP a row
};

/// one_turn: for groups of vertices from `first` on, bit j where the faces at vertex j turn the same way along some
/// axis and make one turn.
void fansOfOneTurn(const std::uint32_t* views, const FansView& fans, std::size_t first, std::size_t count,
                   std::uint16_t* one_turn);

}  // namespace simd
}  // namespace dccd
