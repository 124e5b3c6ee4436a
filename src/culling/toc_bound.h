// Lower bound of a pair's TOC from the linear filter: the latest over the 8 directions of the first time at which
// the moving projections meet (doc/algorithm.md, "The elementary test").
#pragma once

#include "dccd/elementary.h"

namespace dccd {

/// In [0, 1], rounded down: no contact can be before it; 0 only where all 8 projections overlap at t=0 (or where a
/// time cannot be told from 0 after rounding). 2 when the projections never meet during the step.
/// minimum_separation_m: contact already at this distance.
double linearTocBound(PairKind kind, const VertexMotion* vertices, const Quad& pair, double minimum_separation_m);

}  // namespace dccd
