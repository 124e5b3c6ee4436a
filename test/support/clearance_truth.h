// The true distances of features, straight from the definition, in rational arithmetic: what judges clearances.
#pragma once

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "oracle/algebraic.h"
#include "support/step_support.h"

namespace dccd {
namespace test {

/// The corners of a vertex, an edge, a face or a box (8, as in dccd::MovingHull), each at t0 and t1.
using TrueHull = std::vector<std::array<Vec3, 2>>;

/// At the time t (taken exactly). Boxes are solid.
Rational trueSquaredDistance(const TrueHull& a, const TrueHull& b, double t);
/// The same in doubles, wrong by rounding: for choosing pairs.
double roughDistance(const TrueHull& a, const TrueHull& b, double t);

/// A body's faces, its edges on no face and its vertices on no edge, of what is not masked; or the leaves of the map.
std::vector<std::pair<std::vector<Index>, TrueHull>> trueFeatures(const Step& step, std::uint16_t body);

/// What is wrong with the clearances of a step whose bodies do not turn, if anything. Judged at the step's end, at
/// `times` more times and where the smallest distances are said to be.
std::string judgeClearances(const Step& step, const Options& options, const Outcome& outcome, int times);

}  // namespace test
}  // namespace dccd
