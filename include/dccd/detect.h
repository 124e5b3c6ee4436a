// The question: what do these bodies touch during this step? One call, without state but what the caller keeps.
#pragma once

#include <cstddef>
#include <limits>
#include <memory>
#include <vector>

#include "dccd/assurance.h"
#include "dccd/clearance.h"
#include "dccd/elementary.h"
#include "dccd/export.h"
#include "dccd/outcome.h"
#include "dccd/step.h"
#include "dccd/tolerances.h"
#include "dccd/types.h"

namespace dccd {

/// How a step is answered.
struct Options {
  AccuracyOptions accuracy;
  int num_threads = 1;            ///< 1 or more
  double step_budget_ms = 0;      ///< 0: none
  double max_compute_ms = 0;      ///< ends a step that has no budget as if it were one; 0: none
  bool earliest_only = false;     ///< only contacts that may be the first; with `exact` those in the earliest TOC cell
  bool check_start_state = true;  ///< run the static tests when the step needs them
  /// What the steps before have shown is not done again: bodies at rest keep their bounds and their contacts with the
  /// map (no answer changes). Off: to time a step again and again.
  bool keep_bounds = true;
  /// Leave out the self-collision of surfaces that certainly do not fold (no answer changes).
  bool unfolded_test = true;
  /// A step is split until straight paths are this close to a rotation's arc [m].
  double rigid_tolerance_m = tolerance::RIGID_PATH_M;
  std::size_t max_substeps = 64;
  /// The earliest are kept, unexpected ones first; status TRUNCATED.
  std::size_t max_contacts = std::numeric_limits<std::size_t>::max();
  /// A step that finds more than this, contacts and what meets when it begins each by itself, stops looking: status
  /// TRUNCATED, not complete. The same for any number of threads and SIMD target. 0: no limit.
  std::size_t max_found = 0;
  /// The same for each vertex, edge and face of the bodies, but max_contacts at the least: what coincides makes pairs
  /// by the square. 0: no limit.
  std::size_t max_found_per_feature = 0;
  bool suppress_initial = false;      ///< leave initial obstacle contacts out of the list (they still count)
  std::vector<Box> exclude_boxes;     ///< [m], fixed frame: voxels with their centre inside count as free
  bool obstacle_expected = false;     ///< without a map the status is NO_MAP
  std::vector<Expectation> expected;  ///< in force for this step; not with earliest_only, which may find nothing else
  bool patches = false;               ///< say which contacts belong together: Outcome::patches
  ClearanceOptions clearance;         ///< how far apart things are: Outcome::clearances
  /// What was left out by choice before the step was made, a sentence each: goes into Outcome::excluded, changes no
  /// answer.
  std::vector<std::string> excluded;
};
DCCD_EXPORT bool operator==(const Options& a, const Options& b);
/// Throws std::invalid_argument naming the option and value that is out of range, also for these bodies.
DCCD_EXPORT void check(const Options& options, const std::vector<Body>& bodies = {});

/// All that lasts from one step to the next: what of the last step's end is known, which is carried over when a step
/// begins exactly there, and arrays and buffers, which change no answer. Not thread-safe.
class DCCD_EXPORT History {
 public:
  History();
  ~History();
  History(History&& other) noexcept;
  History& operator=(History&& other) noexcept;

  /// Nothing is carried over any more: after a seam, a reset, or a step that threw (which clears by itself).
  void clear();
  /// Nothing is known of a last step: what clear() leaves, and what a new history has.
  bool isClear() const;

  struct DCCD_HIDDEN Impl;

 private:
  std::unique_ptr<Impl> impl_;
};

/// Throws std::invalid_argument naming what of the step or the options does not fit. After warm-up nothing is allocated
/// that grows with the number of steps.
DCCD_EXPORT Outcome detect(const Step& step, const Options& options, History& history, Deadline deadline);
/// What a step may take [ms]; 0: as long as it takes.
inline double timeLimitMs(const Options& options) {
  return options.step_budget_ms > 0 ? options.step_budget_ms : options.max_compute_ms;
}
/// From now on, as long as the options allow a step: its budget, or what ends a step that has none.
inline Deadline deadlineOf(const Options& options) { return Deadline::after(timeLimitMs(options)); }
inline Outcome detect(const Step& step, const Options& options, History& history) {
  return detect(step, options, history, deadlineOf(options));
}

}  // namespace dccd
