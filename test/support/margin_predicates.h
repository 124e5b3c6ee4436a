// Predicates of the start state and the map: inputs where a sign, an order or a voxel's key is as good as undecided,
// and whether the predicate is wrong about them.
#pragma once

#include "support/margin_checks.h"

namespace dccd {
namespace test {
namespace margins {

/// p, q, a, b, c: the segment pq ends in the plane of the face abc or passes its border, as exactly as doubles can say;
/// flat: all of it in one plane.
MarginInput segmentInput(RandomSource& random, bool flat);
IsWrong judgeSegment(const MarginInput& input);

/// Points that nearly lie on one line, or in one plane.
MarginInput orientation2dInput(RandomSource& random);
IsWrong judgeOrientation2d(const MarginInput& input);
MarginInput orientation3dInput(RandomSource& random);
IsWrong judgeOrientation3d(const MarginInput& input);

/// Two crossings: plane, from, to of each, nearly at the same time.
MarginInput crossingInput(RandomSource& random);
IsWrong judgeCrossing(const MarginInput& input);

/// A moving edge that passes a resting line at its border, or parts from it; variant: the axis.
MarginInput sideInput(RandomSource& random);
IsWrong judgeSide(const MarginInput& input);

/// A resolution and a coordinate on a plane of such a map, or beside it.
MarginInput keyInput(RandomSource& random);
IsWrong judgeKey(const MarginInput& input);

}  // namespace margins
}  // namespace test
}  // namespace dccd
