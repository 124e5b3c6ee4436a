#include "oracle/promises.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "oracle/exact_distance.h"

namespace dccd {
namespace test {
namespace {

std::string outOfRange(const ElementaryResult& result) {
  const bool good = result.toc_lower >= 0 && result.toc_lower <= 1 && result.toc_upper >= 0 && result.toc_upper <= 1;
  return good ? "" : "a time outside the step";
}

/// The earliest sampled time at which the exact distance is at most d; none where the samples show none.
std::optional<double> witnessOfContact(const Query& query, double d) {
  constexpr int SAMPLES = 64, HALVINGS = 40;
  constexpr double ROUNDING = 1e-9;  // the search is in doubles; the exact distance judges its result
  const auto near = [&](double t) { return approximateDistanceAt(query.kind, query.motion, t) <= d * (1 - ROUNDING); };
  for (int i = 0; i <= SAMPLES; ++i) {
    double after = static_cast<double>(i) / SAMPLES;
    if (!near(after)) continue;
    double before = std::max(0.0, after - 1.0 / SAMPLES);
    for (int k = 0; k < HALVINGS; ++k) {
      const double middle = (before + after) / 2;
      (near(middle) ? after : before) = middle;
    }
    if (isWithin(query.kind, query.motion, after, d)) return after;
  }
  return std::nullopt;
}

/// What a certain contact's interval says of where the contact begins, held against exact distances at its ends and at
/// SAMPLES - 1 times within: that it is narrow and the features certainly come within d in it, or else that they are
/// within the tolerance of d all the while.
std::string brokenInterval(const AccuracyOptions& options, const Query& query, double d,
                           const ElementaryResult& result) {
  constexpr int SAMPLES = 4;
  constexpr double NARROW = 0x1p-20;
  if (result.toc_lower > result.toc_upper) return "the interval ends before it begins";
  const Rational most = Rational(d) + Rational(options.tolerance_m),
                 least = Rational(d) - Rational(options.tolerance_m);
  const auto square_at = [&](double t) { return squaredDistanceAt(query.kind, query.motion, t); };
  if (square_at(result.toc_upper) > most * most) return "beyond the tolerance at the interval's end";
  const double width = result.toc_upper - result.toc_lower;
  if (width <= NARROW && d > 0 && isWithin(query.kind, query.motion, result.toc_upper, d)) return "";
  for (int i = 0; i <= SAMPLES; ++i) {
    const Rational square = square_at(result.toc_lower + width * i / SAMPLES);
    if (square > most * most || (least > 0 && square < least * least)) {
      return "a wide interval in which the distance is not within the tolerance of the separation";
    }
  }
  return "";
}

}  // namespace

std::string brokenPromise(const AccuracyOptions& options, const Query& query, std::optional<Root>& toc,
                          const ElementaryResult& result) {
  const std::string range = outOfRange(result);
  if (!range.empty()) return range;
  if (result.verdict == Verdict::NO_CONTACT) return toc ? "a contact is missed" : "";
  if (options.rung == Accuracy::EXACT) {
    if (result.verdict == Verdict::UNDECIDED) return "undecided";
    if (!toc) return "a contact that there is not";
    return isCellOf(*toc, result, options.toc_bits) ? "" : "not the cell of the time of contact";
  }
  if (toc && tocError(*toc, result.toc_lower) < 0) return "the contact is reported late";
  if (result.verdict != Verdict::CONTACT) return "";
  if (!isWithin(query.kind, query.motion, result.toc_lower, options.tolerance_m)) {
    return "at the reported time the features are more than the tolerance apart";
  }
  if (toc && tocError(*toc, result.toc_upper) > 0) return "the contact comes after the interval";
  return brokenInterval(options, query, 0, result);
}

std::string brokenSeparationPromise(const AccuracyOptions& options, const Query& query, double minimum_separation_m,
                                    const ElementaryResult& result) {
  const std::string range = outOfRange(result);
  if (!range.empty()) return range;
  const std::optional<double> witness = witnessOfContact(query, minimum_separation_m);
  if (witness && result.verdict == Verdict::NO_CONTACT) return "the features come closer than the minimum separation";
  if (witness && result.toc_lower > *witness) return "the minimum separation is reached before the reported time";
  if (result.verdict != Verdict::CONTACT) return "";
  const Rational bound = Rational(minimum_separation_m) + Rational(options.tolerance_m);
  const bool apart = squaredDistanceAt(query.kind, query.motion, result.toc_lower) > bound * bound;
  if (apart) return "at the reported time the features are more than minimum separation and tolerance apart";
  return brokenInterval(options, query, minimum_separation_m, result);
}

ElementaryResult testQuery(const Rung& test, const Query& query, double minimum_separation_m) {
  VertexMotion vertices[4] = {};
  for (int i = 0; i < 4; ++i) {
    std::memcpy(vertices[i].t0, query.motion.x[0][i], sizeof query.motion.x[0][i]);
    std::memcpy(vertices[i].t1, query.motion.x[1][i], sizeof query.motion.x[1][i]);
  }
  const Quad quad = {0, 1, 2, 3};
  PairBatch batch;
  batch.kind = query.kind;
  batch.vertices = vertices;
  batch.pairs = &quad;
  batch.count = 1;
  batch.minimum_separation_m = minimum_separation_m > 0 ? &minimum_separation_m : nullptr;
  ElementaryResult result;
  TierCounters counters;
  test.run(batch, &result, counters);
  return result;
}

}  // namespace test
}  // namespace dccd
