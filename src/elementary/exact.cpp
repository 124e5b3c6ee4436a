#include "elementary/exact.h"

#include <cstring>
#include <stdexcept>
#include <string>

#include "elementary/exact_tiers.h"
#include "elementary/rungs.h"

namespace deformable_ccd {
namespace {

PairMotion gather(const VertexMotion* vertices, const Quad& quad) {
  PairMotion pair;
  for (int i = 0; i < 4; ++i) {
    std::memcpy(pair.x[0][i], vertices[quad[i]].t0, sizeof pair.x[0][i]);
    std::memcpy(pair.x[1][i], vertices[quad[i]].t1, sizeof pair.x[1][i]);
  }
  return pair;
}

ElementaryResult decide(PairKind kind, const PairMotion& pair, int toc_bits) {
  for (const auto tier : {exact::decideByCoincidence, exact::decideByFixedIntegers}) {
    const ElementaryResult result = tier(kind, pair, toc_bits);
    if (result.verdict != Verdict::UNDECIDED) return result;
  }
  return exact::decideByBigIntegers(kind, pair, toc_bits);
}

}  // namespace

void ExactTest::run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const {
  if (batch.kind != PairKind::VERTEX_FACE && batch.kind != PairKind::EDGE_EDGE) {
    throw std::invalid_argument(std::string("exact test: kind ") + toString(batch.kind) +
                                " is not vertex-face or edge-edge");
  }
  if (batch.minimum_separation_m != nullptr) {
    throw std::invalid_argument("exact test: a minimum separation needs the rung conservative");
  }
  for (std::size_t i = 0; i < batch.count; ++i) {
    results[i] = decide(batch.kind, gather(batch.vertices, batch.pairs[i]), toc_bits_);
    ++counters.settled[static_cast<std::size_t>(results[i].tier)];
  }
}

std::unique_ptr<ElementaryTest> makeExactTest(const AccuracyOptions& options) {
  return std::make_unique<ExactTest>(options.toc_bits);
}

}  // namespace deformable_ccd
