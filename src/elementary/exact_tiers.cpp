#include "elementary/exact_tiers.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace deformable_ccd {
namespace exact {

ElementaryResult contactInCell(std::int64_t cell, int toc_bits, Tier tier) {
  const double width = std::ldexp(1.0, -toc_bits);
  ElementaryResult result;
  result.toc_lower = static_cast<double>(cell) * width;
  result.toc_upper = std::min(1.0, static_cast<double>(cell + 1) * width);
  result.verdict = Verdict::CONTACT;
  result.tier = tier;
  return result;
}

ElementaryResult noContact(Tier tier) {
  ElementaryResult result;
  result.verdict = Verdict::NO_CONTACT;
  result.toc_lower = 1;
  result.tier = tier;
  return result;
}

ElementaryResult undecided(Tier tier) {
  ElementaryResult result;
  result.tier = tier;
  return result;
}

ElementaryResult decideByCoincidence(PairKind kind, const PairMotion& pair, int toc_bits) {
  const auto meet = [&](int i, int j) { return std::equal(pair.x[0][i], pair.x[0][i] + 3, pair.x[0][j]); };
  const bool coincident = kind == PairKind::VERTEX_FACE ? meet(0, 1) || meet(0, 2) || meet(0, 3)
                                                        : meet(0, 2) || meet(0, 3) || meet(1, 2) || meet(1, 3);
  return coincident ? contactInCell(0, toc_bits, Tier::COINCIDENCE) : undecided(Tier::COINCIDENCE);
}

ElementaryResult decideWithTier(Tier tier, PairKind kind, const PairMotion& pair, int toc_bits) {
  if (kind != PairKind::VERTEX_FACE && kind != PairKind::EDGE_EDGE) {
    throw std::invalid_argument(std::string("exact test: kind ") + toString(kind) + " is not vertex-face or edge-edge");
  }
  switch (tier) {
    case Tier::COINCIDENCE:
      return decideByCoincidence(kind, pair, toc_bits);
    case Tier::FIXED_INTEGER:
      return decideByFixedIntegers(kind, pair, toc_bits);
    case Tier::BIG_INTEGER:
      return decideByBigIntegers(kind, pair, toc_bits);
    default:
      break;
  }
  throw std::invalid_argument(std::string("exact test: there is no tier ") + toString(tier));
}

}  // namespace exact
}  // namespace deformable_ccd
