// The rung `conservative`: never misses, never late; false positives only closer than the tolerance. Without a minimum
// separation the batched certified test (exact tier T1) answers nearly every pair, more sharply than asked; the rest,
// and every pair with a minimum separation, goes through conservative advancement. What that finds near without a
// minimum separation the exact tiers decide.
#include <algorithm>

#include "dccd/elementary.h"
#include "dccd/tolerances.h"
#include "elementary/batch_input.h"
#include "elementary/conservative_advance.h"
#include "elementary/exact_tiers.h"
#include "simd/float_mode.h"

namespace dccd {
namespace {

constexpr int BATCH_TOC_BITS = 10;  ///< the batch's cells are not used, only its brackets; coarse ones cost least

class ConservativeRung : public Rung {
 public:
  explicit ConservativeRung(const AccuracyOptions& options) : options_(options) {}
  void run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const override;

 private:
  ElementaryResult fromBatch(PairKind kind, const conservative::Corners& corners, const BlockOutput& output,
                             std::size_t i) const;
  ElementaryResult sharpened(const PairBatch& batch, std::size_t i, const conservative::Corners& corners,
                             const ElementaryResult& near) const;

  AccuracyOptions options_;
};

/// What the batched test's answer is worth: NO as it stands, YES when the bracket of the TOC is so narrow that at its
/// lower end the features are within the tolerance, UNDECIDED otherwise.
ElementaryResult ConservativeRung::fromBatch(PairKind kind, const conservative::Corners& corners,
                                             const BlockOutput& output, std::size_t i) const {
  if (output.verdict[i] == simd::BATCH_NO) return exact::noContact(Tier::DOUBLE_BATCH);
  if (output.verdict[i] == simd::BATCH_YES || output.verdict[i] == simd::BATCH_YES_BRACKET) {
    const double width = output.hi[i] - output.lo[i];  // exact: both are multiples of 2^-52
    if (conservative::closingSpeed(kind, corners) * width * (1 + tolerance::CLOSING_SPEED) <= options_.tolerance_m) {
      return {output.lo[i], output.hi[i], Verdict::CONTACT, Tier::DOUBLE_BATCH};
    }
  }
  return exact::undecided(Tier::DOUBLE_BATCH);
}

/// What features that come nearer than the tolerance truly do: distances cannot say when they meet, signs can.
ElementaryResult ConservativeRung::sharpened(const PairBatch& batch, std::size_t i,
                                             const conservative::Corners& corners, const ElementaryResult& near) const {
  constexpr int TOC_BITS = 52;
  const PairMotion motion = exact::motionOf(batch.vertices, batch.pairs[i]);
  const ElementaryResult result = exact::decideUncertain(batch.kind, motion, TOC_BITS);
  const double moved =
      conservative::closingSpeed(batch.kind, corners) * (tolerance::TIME_GRID * (1 + tolerance::CLOSING_SPEED));
  if (result.verdict == Verdict::NO_CONTACT || moved <= options_.tolerance_m) return result;
  return {near.toc_lower, 1, Verdict::UNDECIDED, near.tier};
}

void ConservativeRung::run(const PairBatch& batch, ElementaryResult* results, TierCounters& counters) const {
  const ScopedFloatMode mode;
  BlockOutput output;
  simd::BatchInput input = inputOf(batch, Accuracy::CONSERVATIVE);
  input.toc_bits = BATCH_TOC_BITS;
  for (std::size_t begin = 0; begin < batch.count; begin += BLOCK) {
    const double* separation = batch.minimum_separation_m == nullptr ? nullptr : batch.minimum_separation_m + begin;
    setBlock(batch, begin, input);
    const bool batched =
        separation == nullptr || std::find(separation, separation + input.count, 0.0) != separation + input.count;
    if (batched) simd::exactBatch(input, {output.verdict, output.cell, output.lo, output.hi});
    for (std::size_t i = 0; i < input.count; ++i) {
      const Quad& quad = batch.pairs[begin + i];
      const conservative::Corners corners = {&batch.vertices[quad[0]], &batch.vertices[quad[1]],
                                             &batch.vertices[quad[2]], &batch.vertices[quad[3]]};
      ElementaryResult& result = results[begin + i];
      result = {};
      const conservative::Limits limits = {options_.tolerance_m, separation == nullptr ? 0 : separation[i],
                                           options_.max_subdivisions, batch.deadline};
      if (limits.minimum_separation_m == 0) result = fromBatch(batch.kind, corners, output, i);
      if (result.verdict == Verdict::UNDECIDED) result = conservative::advance(batch.kind, corners, limits);
      if (result.verdict == Verdict::CONTACT && limits.minimum_separation_m == 0 && result.tier != Tier::DOUBLE_BATCH) {
        result = sharpened(batch, begin + i, corners, result);
      }
      ++counters.settled[static_cast<std::size_t>(result.tier)];
    }
  }
}

}  // namespace

std::unique_ptr<Rung> makeConservativeRung(const AccuracyOptions& options) {
  return std::make_unique<ConservativeRung>(options);
}

}  // namespace dccd
