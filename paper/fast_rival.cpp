#include "paper/fast_rival.h"

#include <algorithm>
#include <stdexcept>

#include "paper/simd/fast_batch.h"
#include "simd/float_mode.h"

namespace dccd {
namespace {

constexpr std::size_t BLOCK = 512;  ///< pairs whose outputs lie on the stack at once

class FastRival : public Rung {
 public:
  void run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const override;
};

void FastRival::run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const {
  if (factsOf(batch.kind).isOnMap() || batch.minimum_separation_m) {
    throw std::invalid_argument("fast takes pairs of mesh features without a separation");
  }
  const ScopedFloatMode mode;
  std::uint8_t verdict[BLOCK];
  std::uint64_t cell[BLOCK];
  double lo[BLOCK], hi[BLOCK];
  simd::BatchInput input;
  input.vertices = reinterpret_cast<const double*>(batch.vertices);
  input.kind = batch.kind == PairKind::VERTEX_FACE ? simd::BatchKind::VERTEX_FACE : simd::BatchKind::EDGE_EDGE;
  for (std::size_t begin = 0; begin < batch.count; begin += BLOCK) {
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

std::unique_ptr<Rung> makeFastRival() { return std::make_unique<FastRival>(); }

}  // namespace dccd
