// The rung `fast`: the batched kernel of the exact test without its bounds. Floating point all the way: an answer near
// a tie may be wrong either way, and the TOC is approximate.
#include <algorithm>
#include <stdexcept>
#include <string>

#include "dccd/elementary.h"
#include "simd/exact_batch.h"
#include "simd/float_mode.h"

namespace dccd {
namespace {

constexpr std::size_t BLOCK = 512;  ///< pairs whose outputs lie on the stack at once

class FastRung : public Rung {
 public:
  void run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const override;
};

void FastRung::run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const {
  const ScopedFloatMode mode;
  if (batch.kind != PairKind::VERTEX_FACE && batch.kind != PairKind::EDGE_EDGE) {
    throw std::invalid_argument(std::string("fast test: kind ") + toString(batch.kind) +
                                " is not vertex-face or edge-edge");
  }
  if (batch.minimum_separation_m != nullptr) {
    throw std::invalid_argument("fast test: a minimum separation needs the rung conservative");
  }
  static_assert(sizeof(VertexMotion) == 8 * sizeof(double) && sizeof(Quad) == 4 * sizeof(std::uint32_t));
  std::uint8_t verdict[BLOCK];
  std::uint64_t cell[BLOCK];
  double lo[BLOCK], hi[BLOCK];
  simd::BatchInput input;
  input.kind = batch.kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
  for (std::size_t begin = 0; begin < batch.count; begin += BLOCK) {
    input.vertices = batch.vertices->t0;
    input.quads = reinterpret_cast<const std::uint32_t(*)[4]>(batch.pairs + begin);
    input.count = std::min(BLOCK, batch.count - begin);
    simd::fastBatch(input, {verdict, cell, lo, hi});
    for (std::size_t i = 0; i < input.count; ++i) {
      ElementaryResult& result = results[begin + i];
      result = {};
      const bool contact = verdict[i] == simd::BATCH_YES;
      result.verdict = contact ? Verdict::CONTACT : Verdict::NO_CONTACT;
      result.toc_lower = contact ? lo[i] : 1;
      if (contact) result.toc_upper = lo[i];
      result.tier = Tier::DOUBLE_BATCH;
    }
    counters.settled[static_cast<std::size_t>(Tier::DOUBLE_BATCH)] += input.count;
  }
}

}  // namespace

std::unique_ptr<Rung> makeFastRung(const AccuracyOptions&) { return std::make_unique<FastRung>(); }

}  // namespace dccd
