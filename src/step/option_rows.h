// The options of a step, a row each: that they are compared, recorded and replayed follows from here.
#pragma once

#include <tuple>

#include "dccd/detect.h"

namespace dccd {

/// An option, and whether it is in the file of a recorded step. A replay does without what changes no answer.
template <bool RECORDED, class Value>
struct OptionRow {
  Value& value;
  friend bool operator==(const OptionRow& a, const OptionRow& b) { return a.value == b.value; }
};
template <class Value>
OptionRow<true, Value> recorded(Value& value) {
  return {value};
}
template <class Value>
OptionRow<false, Value> notRecorded(Value& value) {
  return {value};
}

/// A tuple of rows in the order of the file. A new field of the options does not build until it is
/// named here.
template <class SomeOptions>
auto optionRows(SomeOptions& options) {
  auto& [accuracy, num_threads, step_budget_ms, max_compute_ms, earliest_only, check_start_state, keep_bounds,
         unfolded_test, rigid_tolerance_m, max_substeps, max_contacts, max_found, max_found_per_feature,
         suppress_initial, exclude_boxes, obstacle_expected, expected, patches, clearance, excluded] = options;
  auto& [rung, tolerance_m, toc_bits, max_subdivisions] = accuracy;
  auto& [clearance_wanted, clearance_tolerance_m, clearance_max_m, clearance_self_m] = clearance;
  return std::make_tuple(recorded(rung), recorded(tolerance_m), recorded(toc_bits), recorded(max_subdivisions),
                         recorded(num_threads), recorded(step_budget_ms), recorded(earliest_only),
                         recorded(check_start_state), recorded(unfolded_test), recorded(rigid_tolerance_m),
                         recorded(max_substeps), recorded(max_contacts), recorded(max_found),
                         recorded(max_found_per_feature), recorded(suppress_initial), recorded(exclude_boxes),
                         recorded(obstacle_expected), recorded(expected), recorded(patches), recorded(clearance_wanted),
                         recorded(clearance_tolerance_m), recorded(clearance_max_m), recorded(clearance_self_m),
                         notRecorded(max_compute_ms), notRecorded(keep_bounds), notRecorded(excluded));
}

}  // namespace dccd
