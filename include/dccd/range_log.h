// One recording cut in ranges that are computed apart and joined again (doc/fleet.md). What follows from one step alone
// a range says itself; what depends on the steps before, which patch is which and what became of predictions that were
// made before the cut, it leaves to the join, in a file of what these need.
#pragma once

#include <cstdint>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "dccd/export.h"
#include "dccd/look_ahead_score.h"
#include "dccd/outcome.h"

namespace dccd {

struct PatchSpot;
struct PatchUnexpected;

/// Frames of the clock body, by Outcome::sequence, the last one included.
struct StepRange {
  std::uint64_t first = 1, last = std::numeric_limits<std::uint64_t>::max();
  bool holds(std::uint64_t sequence) const { return first <= sequence && sequence <= last; }
};

/// What a range leaves to the join. Its functions are those of PatchTracker and of LookAheadScore, which are called in
/// the same order when the ranges are joined; those of LookAheadScore only until nothing that was predicted before the
/// range is waited for any more. From there on the range keeps the score itself.
class DCCD_EXPORT RangeLog {
 public:
  /// look_ahead_s: 0: nothing is predicted. Throws std::runtime_error naming the file.
  RangeLog(const std::string& path, StepRange range, double look_ahead_s);

  const StepRange& range() const { return range_; }
  void seam(std::size_t body);
  void follow(const std::vector<PatchSpot>& spots, const std::vector<PatchUnexpected>& unexpected,
              const std::vector<std::uint8_t>& on_new_voxel, const Outcome& outcome);
  /// Ends what belongs to this outcome: it is written where the range holds it, else forgotten.
  void tell(const Outcome& outcome);
  void observe(const Outcome& outcome);
  void predict(const Outcome& prediction);
  /// Throws std::runtime_error naming the file.
  void close();

 private:
  void contacts(char kind, const Outcome& outcome);

  std::string path_;
  std::ofstream file_;
  StepRange range_;
  std::string waiting_;  // records of the outcome that comes next
  std::vector<std::shared_ptr<const Topology>> topologies_;
  std::optional<LookAheadScore> score_;
  std::optional<StampNs> begin_ns_;  // of the first answered step
  bool keeps_score_ = false;
};

/// Joins the logs of ranges, in their order, as one run would have gone.
class DCCD_EXPORT RangeJoin {
 public:
  /// look_ahead_s: 0: none.
  RangeJoin(double patch_gap_s, double look_ahead_s);
  ~RangeJoin();

  /// Calls with each outcome: of those with patches these and their events, sequence, stamps and status are set.
  /// Throws std::runtime_error naming the file and what is wrong with it.
  void add(const std::string& path, const std::function<void(const Outcome&)>& sink);
  /// A range is missing: nothing is carried over it.
  void gap();
  std::optional<LookAheadSummary> lookAhead() const;

 private:
  struct DCCD_HIDDEN Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
