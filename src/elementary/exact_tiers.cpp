#include "elementary/exact_tiers.h"

#include <algorithm>
#include <cmath>

namespace dccd {
namespace exact {

PairMotion motionOf(const VertexMotion* vertices, const Quad& quad) {
  PairMotion pair;
  for (int i = 0; i < 4; ++i) {
    std::copy(vertices[quad[i]].t0, vertices[quad[i]].t0 + 3, pair.x[0][i]);
    std::copy(vertices[quad[i]].t1, vertices[quad[i]].t1 + 3, pair.x[1][i]);
  }
  return pair;
}

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

}  // namespace exact
}  // namespace dccd
