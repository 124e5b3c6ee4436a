#include "support/margin_checks.h"

#include <cmath>
#include <map>

#include "elementary/exact_tiers.h"
#include "support/margin_bounds.h"
#include "support/margin_numbers.h"
#include "support/margin_pair_judges.h"
#include "support/margin_pairs.h"
#include "support/margin_predicates.h"

namespace dccd {
namespace test {
namespace {

using namespace margins;

std::vector<MarginCheck> makeChecks() {
  const auto tier = [](ElementaryResult (*decide)(PairKind, const PairMotion&, int)) { return decide; };
  std::vector<MarginCheck> checks = {
      {"BATCH_VALUE", [](RandomSource& random) { return partingPair(random, -48); }, changeOne, judgeBatch, 4000},
      {"BATCH_MINOR", flatPair, changeOne, judgeBatch, 4000},
      {"BATCH_SEPARATION", restingPair, changeOne, judgeBatch, 4000},
      {"SIMPLE_TIME", returningPair, changeOne, judgeTier(tier(exact::decideAtSimpleTime), 32), 4000},
      {"INSIDE_MINOR", [](RandomSource& random) { return crossingPair(random, -54); }, changeOne,
       judgeTier(tier(exact::decideByDoubleDouble), 52), 4000},
      {"QUADRATIC_SIGN", [](RandomSource& random) { return crossingPair(random, -44); }, changeOne,
       judgeTier(tier(exact::decideByFixedIntegers), 10), 4000},
      {"CUBIC_VALUE", pairAndTime, changeOne,
       [](const MarginInput& input) { return judgeCubic(input, CubicBound::VALUE); }, 4000},
      {"CUBIC_VALUE_PAIRS", pairAndTime, changeOne,
       [](const MarginInput& input) { return judgeCubic(input, CubicBound::VALUE_PAIRS); }, 4000},
      {"CUBIC_SLOPE", pairAndTime, changeOne,
       [](const MarginInput& input) { return judgeCubic(input, CubicBound::SLOPE); }, 4000},
      {"ADVANCE_SEPARATION", [](RandomSource& random) { return distancePair(random, false); }, changeOne, judgeDistance,
       1500},
      {"ADVANCE_POINT", [](RandomSource& random) { return distancePair(random, true); }, changeOne, judgeDistance,
       1500},
      {"FUSED_CUBIC", [](RandomSource& random) { return partingPair(random, -18); }, changeInFloat, judgePlanarFilter,
       4000},
      {"FUSED_PLANAR", restingPair, changeOne, judgePlanarFilter, 4000},
      {"SEGMENT_LINE", [](RandomSource& random) { return segmentInput(random, false); }, changeOne, judgeSegment, 4000},
      {"SEGMENT_PLANE", [](RandomSource& random) { return segmentInput(random, false); }, changeOne, judgeSegment,
       4000},
      {"SEGMENT_PROJECTED", [](RandomSource& random) { return segmentInput(random, true); }, changeOne, judgeSegment,
       4000},
      {"ORIENTATION_2D", orientation2dInput, changeOne, judgeOrientation2d, 20000},
      {"ORIENTATION_3D", orientation3dInput, changeOne, judgeOrientation3d, 20000},
      {"CROSSING_TIME", crossingInput, changeOne, judgeCrossing, 20000},
      {"SIDE", sideInput, changeOne, judgeSide, 4000},
      {"VOXEL_KEY", keyInput, changeOne, judgeKey, 20000},
      {"MAP_BOUND", meetingInput, changeOne, judgeMeeting, 20000},
      {"SEPARATION_SUM", meetingInput, changeOne, judgeMeeting, 20000},
      {"TOC_BOUND", boundInput, changeOne, judgeBound, 4000},
      {"UNFOLDED_COORDINATE", viewInput, changeOne, judgeView, 4000},
  };
  // So small that what the margins are made of vanishes. What covers that is large, to be a normal number: an input
  // goes wrong only where it is gone.
  const auto tiny = [](MarginInput input, int exponent) {
    for (double& x : input.x) x = std::ldexp(x, exponent);
    return input;
  };
  checks.push_back({"FUSED_UNDERFLOW",
                    [tiny](RandomSource& random) {
                      const bool planar = random() % 2;
                      return tiny(planar ? restingPair(random) : partingPair(random, -18), planar ? -74 : -49);
                    },
                    changeOne, judgePlanarFilter, 4000, 0});
  checks.push_back({"SEGMENT_UNDERFLOW",
                    [tiny](RandomSource& random) {
                      const bool flat = random() % 2;
                      return tiny(segmentInput(random, flat), flat ? -537 : -358);
                    },
                    changeOne, judgeSegment, 4000, 0});
  // These bounds add up what dozens of roundings can do at once, or one margin serves several quantities, of which the
  // others need less: f's outer coefficients beside its middle ones (FUSED_CUBIC), minors beside their sums
  // (FUSED_PLANAR). Search has found no input that needs a tenth of them.
  static const std::map<std::string, double> LESS = {
      {"ADVANCE_POINT", 0.01}, {"BATCH_MINOR", 0.05},       {"CUBIC_VALUE_PAIRS", 0.03},
      {"FUSED_CUBIC", 0.01},   {"FUSED_PLANAR", 0.01},      {"SEGMENT_LINE", 0.03},
      {"SEGMENT_PLANE", 0.01}, {"SEGMENT_PROJECTED", 0.03}, {"SIMPLE_TIME", 0.03},
  };
  for (MarginCheck& check : checks) {
    const auto less = LESS.find(check.margin);
    if (less != LESS.end()) check.held_at = less->second;
  }
  return checks;
}

}  // namespace

const std::vector<MarginCheck>& marginChecks() {
  static const std::vector<MarginCheck> checks = makeChecks();
  return checks;
}

}  // namespace test
}  // namespace dccd
