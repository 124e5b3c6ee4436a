// The parallel planar filter (paper, Section 5), one pair at a time in plain C++: in the paper's form (Algorithms 1 and
// 2) and in a branch-free form that covers every certificate of both and more.
//
// In a plane, take one point of the pair as origin and let a, b, c be the others (VF: origin v; EE: a, b = ea, c = eb0,
// origin eb1), all linear in t. Consider the quadratics bc = b x c, ca = c x a, ab = a x b and T = bc + ca + ab, the
// doubled area of abc. With weights in a contact:
//   VF: wa a + wb b + wc c = 0, w >= 0, wa + wb + wc = 1. Cross products with a, b, c give wb bc = wa ca, wc ca = wb
//   ab,
//       wa ab = wc bc, hence bc = wa T, ca = wb T, ab = wc T.
//   EE: wa a + wb b = m c, wa + wb = 1, 0 <= m <= 1. With s = bc + ca: bc = wa s, ca = wb s, -ab = m s, T = (1-m) s.
// So at a contact the four numbers bc, ca, ab (EE: -ab), T are all >= 0 or all <= 0, degenerate triangles and edges
// included. If one of them is strictly positive during the whole step and another strictly negative, there is none.
// A quadratic with three Bernstein coefficients of one strict sign keeps it on [0, 1] (paper, Equations 8 to 12).
// Algorithm 1 is "T of one sign, an edge's quadratic of the other", Algorithm 2 "ab and T of one sign" (both ends of eb
// on one side of ea) or "bc and ca of opposite signs"; each looks at one edge only, the first that fits at t=0.
//
// Rounding. u = 2^-24; d bounds |stored - exact| (PaperRecords::error); m is the largest |computed difference| of the
// pair in the plane. A computed difference errs by at most e = 2d + u m (two stored values, one subtraction). A product
// of two differences errs by at most 2 m e + e^2 and its rounding by u m^2. The middle coefficient of one quadratic has
// 4 products and 3 additions of at most 4 m^2: 8 m e + 4 e^2 + 4 u m^2 + 12 u m^2. T adds three of them, with two more
// additions of at most 12 m^2: 24 m e + 12 e^2 + 72 u m^2 in all, up to factors 1 + 16u; the other coefficients have
// half as many. With E = 2d + 4u m the margin 32 E (m + E) = 64 d m + 128 u m^2 + 32 E^2 exceeds that sum, 48 d m + 96
// u m^2 + 12 e^2, by a third, which covers its own three roundings. Stored values lie in [-1, 1], so nothing overflows;
// d >= 2^-25, so the margin is at least 2^-43 and the underflow of products, at most 2^-150 each, is far below the
// slack. The operations and their order are those of simd/paper_filters.cpp; nothing may be fused.
#pragma once

#include "dccd/elementary.h"
#include "paper/paper_record.h"

namespace dccd {

enum class PlanarForm : std::uint8_t { PAPER = 0, BRANCH_FREE = 1 };

/// True when the planar filter proves in one of the 8 planes that the pair (VERTEX_FACE or EDGE_EDGE) does not meet.
/// `error` is PaperRecords::error().
bool planarSeparated(PlanarForm form, PairKind kind, const PaperRecord* records, const Quad& pair, float error);

/// What is compared with the margin in plane `plane`, for tests of the margin: the computed coefficients of bc, ca,
/// ab and T (4 times 3, the middle ones doubled), the same values in exact arithmetic being the caller's.
struct PlanarCoefficients {
  float bc[3], ca[3], ab[3], total[3];
  float margin;
};
PlanarCoefficients planarCoefficients(PairKind kind, const PaperRecord* records, const Quad& pair, std::size_t plane,
                                      float error);

}  // namespace dccd
