// Pairs of features that aim at the bound of a margin: a MarginInput begins with the 24 coordinates of the pair, and
// its variant is the kind.
#pragma once

#include "dccd/elementary.h"
#include "support/margin_numbers.h"

namespace dccd {
namespace test {
namespace margins {

PairKind kindOf(const MarginInput& input);
PairMotion motionOf(const MarginInput& input);
MarginInput inputOf(PairKind kind, const PairMotion& motion);
PairKind anyKind(RandomSource& random);

/// Weights of a point within both features, on a border of one for `border`.
void weights(RandomSource& random, PairKind kind, bool border, double& a, double& b);

/// Coplanar at t = 0 up to rounding, where they meet, and then apart, slowly.
MarginInput partingPair(RandomSource& random, int slowest);
/// The same, and at the end of the step a vertex is exactly where one of the other feature is.
MarginInput returningPair(RandomSource& random);
/// Coplanar all the time up to rounding, at a border of a feature at some time, and slow or at rest.
MarginInput restingPair(RandomSource& random);
/// Meets at a border at some time in mid-step, or misses it narrowly, everything moving as fast as it is large.
MarginInput crossingPair(RandomSource& random, int closest);
/// In one plane but for a height that makes f nearly a third power of t - r, so that its root is known badly, while the
/// features sweep over each other's border in that plane.
MarginInput flatPair(RandomSource& random);
/// A pair, and as the last number a time at which it is coplanar up to rounding.
MarginInput pairAndTime(RandomSource& random);
/// A pair, a distance and a tolerance.
MarginInput distancePair(RandomSource& random, bool near);

/// To one beside it at the accuracy of float, of which the margins of the planar filter are made, still coplanar at
/// t = 0.
void changeInFloat(MarginInput& input, RandomSource& random);

}  // namespace margins
}  // namespace test
}  // namespace dccd
