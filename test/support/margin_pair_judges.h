// Whether what decides a pair is wrong about it: a batch, a tier of exact, its cubic, the conservative rung, a filter.
#pragma once

#include <functional>

#include "dccd/elementary.h"
#include "support/margin_pairs.h"

namespace dccd {
namespace test {
namespace margins {

/// Whether the batched tier is wrong about a pair: verdict, cell or bracket.
IsWrong judgeBatch(const MarginInput& input);

/// Whether one tier of exact is wrong about a pair.
std::function<IsWrong(const MarginInput&)> judgeTier(
    std::function<ElementaryResult(PairKind, const PairMotion&, int)> tier, int toc_bits);

/// Whether the planar filter leaves out a contact.
IsWrong judgePlanarFilter(const MarginInput& input);

enum class CubicBound { VALUE, VALUE_PAIRS, SLOPE };
/// Whether f, whose roots are the times at which a pair is coplanar, is further off than its bound at the input's time.
IsWrong judgeCubic(const MarginInput& input, CubicBound bound);

/// Whether the conservative rung is wrong about a pair, a distance and a tolerance.
IsWrong judgeDistance(const MarginInput& input);

}  // namespace margins
}  // namespace test
}  // namespace dccd
