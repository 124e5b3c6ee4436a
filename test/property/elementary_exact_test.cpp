// The exact rung on hard pairs, in any order of their vertices and axes: the oracle's answers, at any scale.
#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <sstream>

#include "dccd/elementary.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "support/flush_to_zero.h"
#include "support/generators.h"
#include "support/query_property.h"
#include "support/query_symmetries.h"

namespace dccd {
namespace test {
namespace {

constexpr std::array<int, 3> TOC_BITS = {10, 32, 52};

AccuracyOptions exactOptions(int toc_bits) {
  AccuracyOptions options;
  options.toc_bits = toc_bits;
  return options;
}

std::string described(const ElementaryResult& result) {
  std::ostringstream text;
  text.precision(17);
  text << "verdict " << int(result.verdict) << " [" << result.toc_lower << ", " << result.toc_upper << "] tier "
       << toString(result.tier);
  return text.str();
}

TEST(ElementaryExact, VerdictAndCellAreTheOracles) {
  std::vector<std::unique_ptr<Rung>> tests;
  for (int bits : TOC_BITS) tests.push_back(makeRung(exactOptions(bits)));
  checkHardQueries("exact-oracle", longRun() ? 1000000 : 20000, [&](const Query& query) -> std::string {
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    for (std::size_t i = 0; i < tests.size(); ++i) {
      const ElementaryResult result = testQuery(*tests[i], query);
      const std::string broken = brokenPromise(exactOptions(TOC_BITS[i]), query, toc, result);
      if (!broken.empty()) return broken + " at " + std::to_string(TOC_BITS[i]) + " bits: " + described(result);
    }
    return {};
  });
}

TEST(ElementaryExact, NoScaleChangesTheAnswer) {
  const auto test = makeRung(exactOptions(32));
  checkHardQueries("exact-scale", longRun() ? 200000 : 10000, [&](const Query& query) -> std::string {
    const ElementaryResult expected = testQuery(*test, query);
    for (int exponent : {-1000, -600, -300, -1, 1, 300, 600, 1000}) {
      Query scaled;
      if (!scaledExactly(query, exponent, scaled)) continue;
      const ElementaryResult result = testQuery(*test, scaled);
      if (sameAnswer(result, expected)) continue;
      return "2^" + std::to_string(exponent) + " changes " + described(expected) + " to " + described(result);
    }
    return {};
  });
}

// The rung brings the floating-point mode that its proofs assume, and leaves the caller's as it was.
TEST(ElementaryExact, FlushToZeroSetBySomebodyElseChangesNothing) {
  const auto exact = makeRung(exactOptions(32));
  AccuracyOptions options;
  options.rung = Accuracy::CONSERVATIVE;
  const auto conservative = makeRung(options);
  const auto flushed = [](const Rung& rung, const Query& query, ElementaryResult& result) {
    const FlushToZero mode;
    result = testQuery(rung, query);
    return mode.isInForce();
  };
  const std::size_t runs = longRun() ? 300000 : 10000;
  checkHardQueries("flush-to-zero", runs, [&](const Query& query) -> std::string {
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    ElementaryResult result;
    if (!flushed(*exact, query, result)) return "the caller's mode was not restored";
    const std::string broken = brokenPromise(exactOptions(32), query, toc, result);
    if (!broken.empty()) return broken + ": " + described(result);
    if (!flushed(*conservative, query, result)) return "conservative: the caller's mode was not restored";
    return sameAnswer(result, testQuery(*conservative, query)) ? "" : "conservative: another answer";
  });
}

// A coarser cell is the finer one with bits cut off: cells of all widths name one time.
TEST(ElementaryExact, CellsOfAllWidthsContainEachOther) {
  std::vector<std::unique_ptr<Rung>> tests;
  for (int bits = 10; bits <= 52; ++bits) tests.push_back(makeRung(exactOptions(bits)));
  checkHardQueries("exact-nested", longRun() ? 100000 : 2000, [&](const Query& query) -> std::string {
    ElementaryResult finer = testQuery(*tests.back(), query);
    for (int bits = 51; bits >= 10; --bits) {
      const ElementaryResult coarser = testQuery(*tests[static_cast<std::size_t>(bits - 10)], query);
      const bool nested = coarser.verdict == finer.verdict &&
                          (finer.verdict == Verdict::NO_CONTACT ||
                           (coarser.toc_lower <= finer.toc_lower && finer.toc_upper <= coarser.toc_upper));
      if (!nested) return std::to_string(bits) + " bits: " + described(coarser) + ", finer: " + described(finer);
      finer = coarser;
    }
    return {};
  });
}

}  // namespace
}  // namespace test
}  // namespace dccd
