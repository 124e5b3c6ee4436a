#include "support/exact_tier.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "elementary/exact_tiers.h"
#include "simd/exact_batch.h"

namespace dccd {
namespace test {

ElementaryResult decideByBatch(PairKind kind, const PairMotion& pair, int toc_bits) {
  VertexMotion vertices[4] = {};
  for (int i = 0; i < 4; ++i) {
    std::copy(pair.x[0][i], pair.x[0][i] + 3, vertices[i].t0);
    std::copy(pair.x[1][i], pair.x[1][i] + 3, vertices[i].t1);
  }
  const std::uint32_t quads[1][4] = {{0, 1, 2, 3}};
  simd::BatchInput input;
  input.vertices = vertices[0].t0;
  input.quads = quads;
  input.count = 1;
  input.kind = kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
  input.toc_bits = toc_bits;
  std::uint8_t verdict;
  std::uint64_t cell;
  double lo, hi;
  simd::exactBatch(input, {&verdict, &cell, &lo, &hi});
  if (verdict == simd::BATCH_NO) return exact::noContact(Tier::DOUBLE_BATCH);
  if (verdict != simd::BATCH_YES) return exact::undecided(Tier::DOUBLE_BATCH);
  return exact::contactInCell(static_cast<std::int64_t>(cell), toc_bits, Tier::DOUBLE_BATCH);
}

ElementaryResult decideWithTier(Tier tier, PairKind kind, const PairMotion& pair, int toc_bits) {
  switch (tier) {
    case Tier::COINCIDENCE:
      return exact::decideByCoincidence(kind, pair, toc_bits);
    case Tier::DOUBLE_BATCH:
      return decideByBatch(kind, pair, toc_bits);
    case Tier::DOUBLE_DOUBLE:
      return exact::decideByDoubleDouble(kind, pair, toc_bits);
    case Tier::FIXED_INTEGER:
      return exact::decideByFixedIntegers(kind, pair, toc_bits);
    case Tier::BIG_INTEGER:
      return exact::decideByBigIntegers(kind, pair, toc_bits);
    case Tier::BERNSTEIN:  // the rung conservative's
      return exact::undecided(tier);
    case Tier::COUNT:
      break;
  }
  throw std::invalid_argument(std::string("there is no tier ") + toString(tier));
}

}  // namespace test
}  // namespace dccd
