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
  return {static_cast<double>(cell) * width, std::min(1.0, static_cast<double>(cell + 1) * width), Verdict::CONTACT,
          tier};
}

ElementaryResult noContact(Tier tier) { return {1, 1, Verdict::NO_CONTACT, tier}; }

ElementaryResult undecided(Tier tier) { return {0, 1, Verdict::UNDECIDED, tier}; }

ElementaryResult decideByCoincidence(PairKind kind, const PairMotion& pair, int toc_bits) {
  const auto meet = [&](int i, int j) { return std::equal(pair.x[0][i], pair.x[0][i] + 3, pair.x[0][j]); };
  const bool coincident = kind == PairKind::VERTEX_FACE ? meet(0, 1) || meet(0, 2) || meet(0, 3)
                                                        : meet(0, 2) || meet(0, 3) || meet(1, 2) || meet(1, 3);
  return coincident ? contactInCell(0, toc_bits, Tier::COINCIDENCE) : undecided(Tier::COINCIDENCE);
}

}  // namespace exact
}  // namespace dccd
