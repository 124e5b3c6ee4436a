// Conservative advancement with certified rounding: the work of the rung `conservative`.
#pragma once

#include "dccd/elementary.h"
#include "dccd/tolerances.h"

namespace dccd {
namespace conservative {

/// The four points of a pair over the step, in the order of Quad.
using Corners = std::array<const VertexMotion*, 4>;

struct Limits {
  double tolerance_m = tolerance::CONTACT_M;  ///< > 0
  double minimum_separation_m = 0;            ///< >= 0: contact means that the distance is at most this
  int max_steps = 4096;                       ///< then UNDECIDED
  const Deadline* deadline = nullptr;         ///< then, too
};

/// Advances from t = 0 as long as the features are certainly more than the minimum separation d apart.
/// NO_CONTACT: certain, toc_lower is 1. CONTACT: more than d apart before toc_lower, at most d plus tolerance at it.
/// With d = 0 toc_upper is 1. Else they are at most d apart at toc_upper, as far as doubles can tell, and within the
/// tolerance of d all the while, unless the interval is shorter than that can be said of. UNDECIDED: more than d apart
/// before toc_lower; toc_upper is 1. Kind VERTEX_FACE or EDGE_EDGE; coordinates finite.
ElementaryResult advance(PairKind kind, const Corners& corners, const Limits& limits);

/// Upper bound on how fast the distance of the two features changes, in metres per step: the largest relative speed
/// of a point of the one and a point of the other.
double closingSpeed(PairKind kind, const Corners& corners);

}  // namespace conservative
}  // namespace dccd
