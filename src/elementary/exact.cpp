// The rung `exact`: the tiers of doc/algorithm.md, cheapest first, until one decides. Complete: never undecided.
#include <algorithm>
#include <cmath>

#include "dccd/elementary.h"
#include "elementary/batch_input.h"
#include "elementary/exact_double_double.h"
#include "elementary/exact_tiers.h"
#include "simd/float_mode.h"

namespace dccd {
namespace exact {

ElementaryResult decideUncertain(PairKind kind, const PairMotion& pair, int toc_bits) {
  ElementaryResult result = decideByCoincidence(kind, pair, toc_bits);
  if (result.verdict == Verdict::UNDECIDED) result = decideInPlane(kind, pair, toc_bits);
  if (result.verdict == Verdict::UNDECIDED) result = decideAtSimpleTime(kind, pair, toc_bits);
  if (result.verdict == Verdict::UNDECIDED) result = decideByDoubleDouble(kind, pair, toc_bits);
  if (result.verdict == Verdict::UNDECIDED) result = decideByFixedIntegers(kind, pair, toc_bits);
  return result.verdict == Verdict::UNDECIDED ? decideByBigIntegers(kind, pair, toc_bits) : result;
}

}  // namespace exact

namespace {

/// What is left when time is up still goes through the batched tier, which knows most of it at once, but not for longer
/// than this: denormal numbers are slow.
constexpr std::chrono::microseconds TIME_FOR_BATCHES(100);

/// A pair for which the batched tier has no complete answer.
ElementaryResult finish(const PairBatch& batch, std::size_t pair_index, const BlockOutput& output, std::size_t i,
                        int toc_bits) {
  // A pair takes up to half a millisecond from here on, and the clock some forty nanoseconds.
  if (batch.deadline && batch.deadline->isOver()) return exact::undecided(Tier::DOUBLE_BATCH);
  const PairMotion pair = exact::motionOf(batch.vertices, batch.pairs[pair_index]);
  if (output.verdict[i] == simd::BATCH_YES_BRACKET) {
    const ElementaryResult simple = exact::contactAtSimpleTime(batch.kind, pair, output.lo[i], output.hi[i], toc_bits);
    if (simple.verdict == Verdict::CONTACT) return simple;
    const exact::CoplanarityCubic f(batch.kind, pair);
    const std::int64_t cell = exact::cellOfRoot(f, output.lo[i], output.hi[i], toc_bits);
    if (cell >= 0) return exact::contactInCell(cell, toc_bits, Tier::DOUBLE_DOUBLE);
  }
  return exact::decideUncertain(batch.kind, pair, toc_bits);
}

/// Allocates only for coordinates that span more than exact::FIXED_INTEGER_MAX_BITS bits.
class ExactRung : public Rung {
 public:
  explicit ExactRung(int toc_bits) : toc_bits_(toc_bits) {}
  void run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const override;

 private:
  int toc_bits_;
};

void ExactRung::run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const {
  const ScopedFloatMode mode;
  BlockOutput output{};
  simd::BatchInput input = inputOf(batch, Accuracy::EXACT);
  input.toc_bits = toc_bits_;
  const ElementaryResult no_contact = exact::noContact(Tier::DOUBLE_BATCH);
  const double width = std::ldexp(1.0, -toc_bits_);
  for (std::size_t begin = 0; begin < batch.count; begin += BLOCK) {
    setBlock(batch, begin, input);
    if (batch.deadline && batch.deadline->movedBy(TIME_FOR_BATCHES).isOver()) {
      std::fill_n(results + begin, input.count, exact::undecided(Tier::DOUBLE_BATCH));
      counters.settled[static_cast<std::size_t>(Tier::DOUBLE_BATCH)] += input.count;
      continue;
    }
    simd::exactBatch(input, {output.verdict, output.cell, output.lo, output.hi});
    std::size_t finished = 0;  // after the batched tier
    for (std::size_t i = 0; i < input.count; ++i) {
      ElementaryResult& result = results[begin + i];
      if (output.verdict[i] <= simd::BATCH_YES) {  // inside the step: its cells are below 2^toc_bits
        // By a table, without a branch: nothing foretells which it is. Of a "no" the cell is not looked at.
        const auto cell = static_cast<double>(static_cast<std::int64_t>(output.cell[i]));
        const ElementaryResult either[2] = {no_contact,
                                            {cell * width, (cell + 1) * width, Verdict::CONTACT, Tier::DOUBLE_BATCH}};
        result = either[output.verdict[i]];
      } else {
        result = finish(batch, begin + i, output, i, toc_bits_);
        ++counters.settled[static_cast<std::size_t>(result.tier)];
        ++finished;
      }
    }
    counters.settled[static_cast<std::size_t>(Tier::DOUBLE_BATCH)] += input.count - finished;
  }
}

}  // namespace

std::unique_ptr<Rung> makeExactRung(const AccuracyOptions& options) {
  return std::make_unique<ExactRung>(options.toc_bits);
}

}  // namespace dccd
