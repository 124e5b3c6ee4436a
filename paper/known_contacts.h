// What a setting of the accuracy ladder gets wrong, and how its time compares.
#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "dccd/outcome.h"

namespace dccd {

/// An interval that holds a time of contact, in steps.
struct TimeCell {
  double lower, upper;
};
/// Largest distance of either end of what was found from the time, wherever in its cell that lies.
double tocError(const TimeCell& found, const TimeCell& truth);

/// What is known of a step beforehand. A line a contact: kind (VF or EE), four vertices and, where known, the time of
/// contact or a cell that holds it (two numbers); separated by blanks or commas. Lines that begin with # or "kind" are
/// left out. VF: vertex, the face's three; EE: two and two; within these in any order.
class KnownContacts {
 public:
  using Pair = std::tuple<PairKind, std::array<Index, 4>>;

  /// Throws std::runtime_error naming file, line and what is wrong with it.
  static KnownContacts fromFile(const std::string& path);
  static KnownContacts fromOutcome(const Outcome& outcome);

  /// In one order, whichever way round the features were given.
  static Pair pairOf(PairKind kind, std::array<Index, 4> vertices);
  std::size_t size() const { return times_.size(); }
  bool holds(const Pair& pair) const { return times_.count(pair) > 0; }
  std::optional<TimeCell> timeOf(const Pair& pair) const;

 private:
  std::map<Pair, std::optional<TimeCell>> times_;
};

/// What one answer got wrong.
struct AccuracyErrors {
  std::size_t missed = 0, false_contacts = 0, undecided = 0;
  double toc_error = 0;  ///< of the worst of the certain contacts that there are, in steps
  std::size_t timed_by_truth =
      0;  ///< contacts whose time was in the truth; of the others the finest setting's was taken
};
AccuracyErrors errorsOf(const Outcome& outcome, const KnownContacts& truth, const KnownContacts& finest);

/// Median and its 95 % interval from the order statistics (binomial), without any assumption on the distribution. With
/// fewer than 6 values the interval is that of all of them.
struct MedianInterval {
  double low = 0, median = 0, high = 0;
};
MedianInterval medianOf(std::vector<double> values);

}  // namespace dccd
