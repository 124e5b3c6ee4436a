// The rung `fast`: the batched kernel of the exact test without its bounds. Floating point all the way: an answer near
// a tie may be wrong either way, and the TOC is approximate.
#include <algorithm>

#include "dccd/elementary.h"
#include "elementary/batch_input.h"
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
  std::uint8_t verdict[BLOCK];
  std::uint64_t cell[BLOCK];
  double lo[BLOCK], hi[BLOCK];
  simd::BatchInput input = inputOf(batch, Accuracy::FAST);
  for (std::size_t begin = 0; begin < batch.count; begin += BLOCK) {
    setBlock(batch, begin, BLOCK, input);
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
