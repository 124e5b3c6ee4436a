// What a step cost, summed, and the names of its rows.
#include <algorithm>

#include "dccd/outcome.h"

namespace dccd {

StepStats& StepStats::operator+=(const StepStats& other) {
  for (std::size_t i = 0; i < stages.size(); ++i) stages[i] += other.stages[i];
  for (std::size_t i = 0; i < effects.size(); ++i) effects[i] += other.effects[i];
  tiers += other.tiers;
  total_ms += other.total_ms;
  for (const StepCounter& counter : STEP_COUNTERS) {
    std::uint64_t& sum = this->*counter.value;
    const std::uint64_t part = other.*counter.value;
    sum = counter.same_in_every_part ? std::max(sum, part) : sum + part;
  }
  return *this;
}

const char* toString(Stage stage) {
  static const char* const NAMES[] = {"record",     "bounds",   "broad_phase", "planar",
                                      "elementary", "obstacle", "start_state", "sort"};
  return NAMES[static_cast<std::size_t>(stage)];
}

const char* toString(StartState state) {
  static const char* const NAMES[] = {"CLEAR", "INTERSECTING", "NOT_CHECKED"};
  return NAMES[static_cast<std::size_t>(state)];
}

}  // namespace dccd
