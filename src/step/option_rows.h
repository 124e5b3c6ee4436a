// The options of a step, a row each: that they are compared, recorded and replayed follows from here.
#pragma once

#include <cstdint>
#include <tuple>

#include "dccd/detect.h"

namespace dccd {

constexpr std::uint32_t NOT_RECORDED = 0;  ///< a replay does without: it changes no answer

/// An option, and the version of the file of a recorded step since which it is there.
template <std::uint32_t SINCE, class Value>
struct OptionRow {
  Value& value;
  friend bool operator==(const OptionRow& a, const OptionRow& b) { return a.value == b.value; }
};
template <std::uint32_t SINCE, class Value>
OptionRow<SINCE, Value> row(Value& value) {
  return {value};
}

/// A tuple of rows, those of a version in the order of the file. A new field of the options does not build until it is
/// named here.
template <class SomeOptions>
auto optionRows(SomeOptions& options) {
  auto& [accuracy, broad_phase, num_threads, step_budget_ms, max_compute_ms, earliest_only, check_start_state,
         keep_bounds, unfolded_test, rigid_tolerance_m, max_substeps, max_contacts, max_found, max_found_per_feature,
         suppress_initial, exclude_boxes, obstacle_expected, expected, off, patches, excluded] = options;
  auto& [rung, tolerance_m, toc_bits, max_subdivisions] = accuracy;
  return std::make_tuple(
      row<1>(rung), row<1>(tolerance_m), row<1>(toc_bits), row<1>(max_subdivisions), row<1>(broad_phase),
      row<1>(num_threads), row<1>(step_budget_ms), row<1>(earliest_only), row<1>(check_start_state),
      row<1>(unfolded_test), row<1>(max_contacts), row<1>(suppress_initial), row<1>(exclude_boxes),
      row<1>(obstacle_expected), row<1>(rigid_tolerance_m), row<1>(max_substeps), row<3>(max_found),
      row<3>(max_found_per_feature), row<4>(expected), row<5>(patches), row<6>(off), row<NOT_RECORDED>(max_compute_ms),
      row<NOT_RECORDED>(keep_bounds), row<NOT_RECORDED>(excluded));
}

}  // namespace dccd
