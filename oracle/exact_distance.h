// Squared distance of two features at a given time, exact in rational arithmetic: what judges tolerances and minimum
// separations. No square root is taken: compare with the square of the bound.
#pragma once

#include "dccd/elementary.h"
#include "oracle/algebraic.h"

namespace dccd {
namespace test {

/// The features at the time t (any finite double, taken exactly). Kind VERTEX_FACE or EDGE_EDGE.
Rational squaredDistanceAt(PairKind kind, const PairMotion& pair, double t);

/// The distance in doubles, for searching: wrong by rounding, unlike the others.
double approximateDistanceAt(PairKind kind, const PairMotion& pair, double t);

/// Whether the features are at most `bound` (a double >= 0, taken exactly) apart at the time t.
bool isWithin(PairKind kind, const PairMotion& pair, double t, double bound);

}  // namespace test
}  // namespace dccd
