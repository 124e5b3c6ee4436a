// A rival of the paper: the non-penetration filter (Tang et al. 2010). The four points of a pair can only meet when
// they are coplanar: when the cubic (VF: (f1-f0) x (f2-f0) . (v-f0); EE: (ea1-ea0) x (eb1-eb0) . (eb0-ea0)) has a root
// in [0, 1]. If its four Bernstein coefficients have one strict sign there is none. A degenerate pair is coplanar at
// all times, its coefficients are zero, and it is kept.
//
// Rounding. With u the unit roundoff, m the largest |computed difference| of the pair and d a bound of the error of the
// stored coordinates, a computed difference errs by e = 2d + u m. A middle coefficient (times 3) is a sum of 18 triple
// products of differences: 18 (3 m^2 e + 3 m e^2 + e^3); each goes through 7 roundings at most: 126 u m^3, up to a
// factor 1 + 16u. With E = 2d + 2u m the margin 128 E (m + E)^2 = 256 d m^2 + 256 u m^3 + 256 m E^2 + 128 E^3 exceeds
// 108 d m^2 + 180 u m^3 + 54 m e^2 + 18 e^3.
// Float, batched: d = PaperRecords::error() >= 2^-25, so the margin is at least 2^-65 and underflow, at most 2^-149 per
// operation, is far below the slack.
// Double, as published: d = 0; pairs with m outside [2^-300, 2^300] are kept, so that neither margin nor products
// underflow or overflow.
#pragma once

#include "dccd/elementary.h"
#include "paper/paper_record.h"

namespace dccd {

/// As published: scalar, in double, on the positions. True when the pair (VERTEX_FACE or EDGE_EDGE) is never coplanar.
bool nonPenetrationSeparated(PairKind kind, const VertexMotion* vertices, const Quad& pair);

/// Plain reference of the batched form: in float on the records' x, y and z lanes.
bool nonPenetrationSeparated(PairKind kind, const PaperRecord* records, const Quad& pair, float error);

/// The coefficients (the middle ones times 3) and the margin they are compared with, for tests of the margin.
template <class Real>
struct CoplanarityCoefficients {
  Real b[4];
  Real margin;
};
CoplanarityCoefficients<double> coplanarityCoefficients(PairKind kind, const VertexMotion* vertices, const Quad& pair);
CoplanarityCoefficients<float> coplanarityCoefficients(PairKind kind, const PaperRecord* records, const Quad& pair,
                                                       float error);

}  // namespace dccd
