// What options may be, and when two are the same.
#include <stdexcept>
#include <string>
#include <utility>

#include "base/accuracy.h"
#include "step/conclude.h"
#include "step/expected_contacts.h"
#include "step/option_rows.h"

namespace dccd {

void checkHoldsDistance(const Options& options, const std::string& what) {
  if (holdsDistance(options.accuracy.rung)) return;
  throw std::invalid_argument(std::string("accuracy = ") + toString(options.accuracy.rung) + " with " + what +
                              "; a distance above 0 needs accuracy = conservative");
}

/// Which of two would hold is the order's matter.
static void checkSeparations(const std::vector<Body>& bodies) {
  for (std::size_t a = 0; a < bodies.size(); ++a) {
    for (const auto& [b, separation_m] : bodies[a].separations) {
      const double* const back_m = b < bodies.size() ? namedSeparation(bodies[b], a) : nullptr;
      for (const double* const named_m : {namedSeparation(bodies[a], b), back_m}) {
        if (!named_m || *named_m == separation_m) continue;
        throw std::invalid_argument("body '" + bodies[a].name + "' and its partner name two separations, " +
                                    std::to_string(separation_m) + " and " + std::to_string(*named_m) + " m");
      }
    }
  }
}

void check(const Options& options, const std::vector<Body>& bodies) {
  // Asked in each step: sentences are made for what is wrong.
  const auto refuse = [](const std::string& text) { throw std::invalid_argument(text); };
  if (options.num_threads < 1 || options.num_threads > 1024) {
    refuse("num_threads = " + std::to_string(options.num_threads) + " is out of range; 1 to 1024");
  }
  if (!(options.step_budget_ms >= 0 && options.step_budget_ms <= 1e9)) {
    refuse("step_budget_ms = " + std::to_string(options.step_budget_ms) + " is out of range; 0 (none) to 1e9");
  }
  if (!(options.max_compute_ms >= 0 && options.max_compute_ms <= 1e12)) {
    refuse("max_compute_ms = " + std::to_string(options.max_compute_ms) + " is out of range; 0 (none) to 1e12");
  }
  if (!(options.rigid_tolerance_m > 0)) refuse("rigid_tolerance_m must be above 0");
  if (options.max_substeps < 1) refuse("max_substeps must be 1 or more");
  for (const auto& [name, value_m] : {std::make_pair("tolerance_m", options.clearance.tolerance_m),
                                      std::make_pair("max_m", options.clearance.max_m)}) {
    if (value_m > 0 && value_m <= 1e9) continue;
    refuse(std::string("clearance.") + name + " = " + std::to_string(value_m) + " is out of range; above 0, to 1e9");
  }
  if (!(options.clearance.self_m >= 0 && options.clearance.self_m <= 1e9)) {
    refuse("clearance.self_m = " + std::to_string(options.clearance.self_m) + " is out of range; 0 (none) to 1e9");
  }
  for (const Box& box : options.exclude_boxes) {
    if (box.empty()) refuse("exclude_boxes: a box's min exceeds its max");
  }
  if (options.earliest_only && !options.expected.empty()) {
    refuse("earliest_only with expected contacts: the first may be an expected one, which would hide all others");
  }
  if (!bodies.empty()) checkPartners(options.expected, bodies.size());
  makeRung(options.accuracy);  // throws where a number of the accuracy is out of range
  checkSeparations(bodies);
  const double separation_m = largestSeparation(bodies);
  if (separation_m > 0) checkHoldsDistance(options, "minimum_separation_m = " + std::to_string(separation_m));
}

bool operator==(const Options& a, const Options& b) { return optionRows(a) == optionRows(b); }

}  // namespace dccd
