#include "elementary/exact_tiers.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "simd/exact_batch.h"

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
  if (verdict == simd::BATCH_NO) return noContact(Tier::DOUBLE_BATCH);
  if (verdict != simd::BATCH_YES) return undecided(Tier::DOUBLE_BATCH);
  return contactInCell(static_cast<std::int64_t>(cell), toc_bits, Tier::DOUBLE_BATCH);
}

ElementaryResult decideUncertain(PairKind kind, const PairMotion& pair, int toc_bits) {
  ElementaryResult result = decideByCoincidence(kind, pair, toc_bits);
  if (result.verdict == Verdict::UNDECIDED) result = decideAtSimpleTime(kind, pair, toc_bits);
  if (result.verdict == Verdict::UNDECIDED) result = decideBySubdivision(kind, pair);
  if (result.verdict == Verdict::UNDECIDED) result = decideByDoubleDouble(kind, pair, toc_bits);
  if (result.verdict == Verdict::UNDECIDED) result = decideByFixedIntegers(kind, pair, toc_bits);
  return result.verdict == Verdict::UNDECIDED ? decideByBigIntegers(kind, pair, toc_bits) : result;
}

ElementaryResult decideWithTier(Tier tier, PairKind kind, const PairMotion& pair, int toc_bits) {
  if (kind != PairKind::VERTEX_FACE && kind != PairKind::EDGE_EDGE) {
    throw std::invalid_argument(std::string("exact test: kind ") + toString(kind) + " is not vertex-face or edge-edge");
  }
  switch (tier) {
    case Tier::COINCIDENCE:
      return decideByCoincidence(kind, pair, toc_bits);
    case Tier::DOUBLE_BATCH:
      return decideByBatch(kind, pair, toc_bits);
    case Tier::BERNSTEIN:
      return decideBySubdivision(kind, pair);
    case Tier::DOUBLE_DOUBLE:
      return decideByDoubleDouble(kind, pair, toc_bits);
    case Tier::FIXED_INTEGER:
      return decideByFixedIntegers(kind, pair, toc_bits);
    case Tier::BIG_INTEGER:
      return decideByBigIntegers(kind, pair, toc_bits);
    case Tier::COUNT:
      break;
  }
  throw std::invalid_argument(std::string("exact test: there is no tier ") + toString(tier));
}

}  // namespace exact
}  // namespace dccd
