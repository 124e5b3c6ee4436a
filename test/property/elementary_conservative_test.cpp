// The conservative rung on hard pairs: never misses, never late, near at the reported time; with and without a minimum
// separation. UNDECIDED is always allowed for one pair, but not for many.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <iostream>
#include <memory>

#include "dccd/elementary.h"
#include "oracle/oracle.h"
#include "oracle/promises.h"
#include "support/generators.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

AccuracyOptions conservativeOptions(double tolerance_m) {
  AccuracyOptions options;
  options.rung = Accuracy::CONSERVATIVE;
  options.tolerance_m = tolerance_m;
  return options;
}

std::string described(const ElementaryResult& result) {
  char text[96];
  std::snprintf(text, sizeof text, ": verdict %d, toc_lower %.17g", int(result.verdict), result.toc_lower);
  return text;
}

/// The largest coordinate difference between points of the pair.
double sizeOf(const Query& query) {
  double size = 0;
  for (int axis = 0; axis < 3; ++axis) {
    double lo = HUGE_VAL, hi = -HUGE_VAL;
    for (const auto& points : query.motion.x) {
      for (const auto& point : points) {
        lo = std::min(lo, point[axis]);
        hi = std::max(hi, point[axis]);
      }
    }
    size = std::max(size, hi - lo);
  }
  return size;
}

/// A number that depends on the pair alone, so that a pair shrinks and replays with choices of its own.
std::uint64_t digestOf(const Query& query) {
  std::uint64_t digest = 0;
  for (int i = 0; i < 24; ++i) {
    std::uint64_t bits;
    std::memcpy(&bits, &query.motion.x[0][0][0] + i, sizeof bits);
    digest = (digest ^ bits) * 0x9E3779B97F4A7C15u;
  }
  return digest >> 32;
}

TEST(ElementaryConservative, NeverMissesNeverLateAndNearWhenItSaysSo) {
  constexpr double TOLERANCES[] = {1e-3, 1e-6, 1e-9};
  std::vector<std::unique_ptr<Rung>> tests;
  for (double tolerance : TOLERANCES) tests.push_back(makeRung(conservativeOptions(tolerance)));
  std::size_t runs = 0, undecided = 0;
  checkHardQueries("conservative-oracle", longRun() ? 1000000 : 20000, [&](const Query& query) -> std::string {
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    for (std::size_t i = 0; i < tests.size(); ++i) {
      const ElementaryResult result = testQuery(*tests[i], query);
      ++runs;
      undecided += result.verdict == Verdict::UNDECIDED;
      const std::string broken = brokenPromise(conservativeOptions(TOLERANCES[i]), query, toc, result);
      if (!broken.empty()) return broken + ", tolerance " + std::to_string(TOLERANCES[i]) + described(result);
    }
    return {};
  });
  std::cout << "conservative: " << undecided << " of " << runs << " answers undecided\n";
  EXPECT_LT(undecided, runs / 20);
}

TEST(ElementaryConservative, MinimumSeparation) {
  const AccuracyOptions options = conservativeOptions(1e-6);
  const auto test = makeRung(options);
  std::size_t runs = 0, undecided = 0, contacts = 0;
  checkHardQueries("conservative-separation", longRun() ? 120000 : 10000, [&](const Query& query) -> std::string {
    constexpr double FRACTIONS[] = {1e-6, 1e-3, 0.03, 0.2, 0.7};
    const double separation = sizeOf(query) * FRACTIONS[digestOf(query) % 5];
    if (!(separation > 1e-290 && separation < 1e290)) return {};
    const ElementaryResult result = testQuery(*test, query, separation);
    ++runs;
    undecided += result.verdict == Verdict::UNDECIDED;
    contacts += result.verdict == Verdict::CONTACT;
    const std::string broken = brokenSeparationPromise(options, query, separation, result);
    char text[64];
    std::snprintf(text, sizeof text, ", minimum separation %.17g", separation);
    return broken.empty() ? broken : broken + text + described(result);
  });
  std::cout << "conservative with minimum separation: " << runs << " pairs, " << contacts << " contacts, " << undecided
            << " undecided\n";
  EXPECT_GT(contacts, runs / 50) << "too few contacts to judge anything";
  EXPECT_LT(undecided, runs / 50);
}

// The cap is a count of subdivisions: a smaller one may leave more undecided, never a wrong answer.
TEST(ElementaryConservative, TheCapOnlyLeavesMoreUndecided) {
  AccuracyOptions options = conservativeOptions(1e-9);
  options.max_subdivisions = 3;
  const auto test = makeRung(options);
  checkHardQueries("conservative-cap", longRun() ? 200000 : 5000, [&](const Query& query) -> std::string {
    std::optional<Root> toc = firstContact(query.kind, query.motion);
    const ElementaryResult result = testQuery(*test, query);
    const std::string broken = brokenPromise(options, query, toc, result);
    return broken.empty() ? broken : broken + described(result);
  });
}

}  // namespace
}  // namespace test
}  // namespace dccd
