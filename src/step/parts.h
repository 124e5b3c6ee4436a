// A step whose bodies turn, as parts that are straight enough.
#pragma once

#include <vector>

#include "culling/scene_arrays.h"
#include "dccd/step.h"

namespace dccd {

/// The parts that a step must be cut into so that the turning body's straight vertex paths stay within the tolerance of
/// its arc [m]; not limited. extent: what spares a look at each vertex, if it is of t0; null: none.
double partsFor(const Body& body, double pose_scale, double tolerance_m, const Extent* extent = nullptr);

/// How far the turning body's straight vertex paths leave its arc at most when the step is cut into so many parts [m],
/// what placing them rounds included; 0 of one that does not turn.
double leavesArcBy(const Body& body, double pose_scale, double parts);

/// The most that a body needs, up to 1e9; 1 where nothing turns. One does not count where neither its arcs nor its
/// straight paths come near anything that it is tested against or, with apart_m, from which its distance is asked for
/// up to there. before: the bodies as a step before left them.
std::size_t neededParts(const Step& step, double tolerance_m, const std::vector<SceneBody>& before = {},
                        double apart_m = 0);

/// Moves `at`, which ends where part `part` - 1 of `parts` equal parts ends, on by one part.
void advance(const Step& step, std::size_t part, std::size_t parts, Step& at);

/// One vertex at the end of the first `part` of `parts` equal parts, as advance() has it.
Vec3 placeVertex(const Step& step, std::size_t body, Index vertex, std::size_t part, std::size_t parts);

}  // namespace dccd
