// What each rung promises (doc/algorithm.md, "The elementary test"), judged against the oracle with no tolerance of its
// own.
#pragma once

#include <optional>
#include <string>

#include "oracle/oracle.h"
#include "oracle/query_file.h"

namespace dccd {
namespace test {

/// What the rung promised for this pair and did not keep; empty where it kept everything. `toc` is the oracle's.
///   every rung    times finite and within the step
///   conservative  no contact missed, no bound late; where it says CONTACT the features are at most the tolerance apart
///                 from toc_lower to toc_upper, and their first contact, if they have one, is in between
///   exact         the oracle's verdict and the cell of its time
std::string brokenPromise(const AccuracyOptions& options, const Query& query, std::optional<Root>& toc,
                          const ElementaryResult& result);

/// The same for `conservative` with a minimum separation: contact begins where the features come that close. Judged by
/// witnesses: times at which the exact distance is known. A time of contact between them that the samples miss is not
/// judged; what is reported as broken is broken. Where it says CONTACT, the features are within the separation at
/// toc_upper and the interval is at most 2^-20 of the step wide, or they are within the tolerance of the separation all
/// the while.
std::string brokenSeparationPromise(const AccuracyOptions& options, const Query& query, double minimum_separation_m,
                                    const ElementaryResult& result);

/// One pair through run(), with a minimum separation where it is greater than 0.
ElementaryResult testQuery(const Rung& test, const Query& query, double minimum_separation_m = 0);

/// Verdict and bracket, not the tier that settled them.
inline bool sameAnswer(const ElementaryResult& a, const ElementaryResult& b) {
  return a.verdict == b.verdict && a.toc_lower == b.toc_lower && a.toc_upper == b.toc_upper;
}

}  // namespace test
}  // namespace dccd
