// Proofs that a moving mesh feature never meets a static feature of a box: planar filters (paper, Section 5) in the
// three axis planes, where a static feature is a fixed point.
#pragma once

#include "dccd/elementary.h"

namespace dccd {

/// True only if the moving segment p q certainly never meets the static line along `axis` through `point` (its
/// coordinate on `axis` is not used).
bool edgeMissesLine(const VertexMotion& p, const VertexMotion& q, const double* point, int axis);

/// True only if the static point is certainly never in the moving closed triangle.
bool triangleMissesPoint(const VertexMotion& p, const VertexMotion& q, const VertexMotion& r, const double* point);

/// A time in [0,1] before which a coordinate range cannot come within `reach` of [lo, hi], rounded down; above 1 when
/// it never does. min and max: the range's ends at t=0 and, `stride` numbers on, at t=1; in between it lies within the
/// straight lines that join them.
double firstMeeting(const double* min, const double* max, int stride, double lo, double hi, double reach);

}  // namespace dccd
