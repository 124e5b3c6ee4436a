// What a step cost, summed; and what became of a step, in words.
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

const char* toString(StepStatus status) {
  static constexpr const char* NAMES[] = {
      "OK",          "FIRST_FRAME", "TOPOLOGY_CHANGED", "GAP",       "TIME_JUMP",     "NO_TRANSFORM", "NO_MAP",
      "NO_BODY",     "PARTIAL",     "DEADLINE",         "TRUNCATED", "DUPLICATE",     "TELEPORT",     "VERTEX_COUNT",
      "BAD_MESSAGE", "QUEUE_FULL",  "DISABLED",         "RESET",     "INTERNAL_ERROR"};
  static_assert(sizeof(NAMES) / sizeof(NAMES[0]) == static_cast<std::size_t>(StepStatus::COUNT));
  return status < StepStatus::COUNT ? NAMES[static_cast<std::size_t>(status)] : "?";
}

bool isAnswered(StepStatus status) {
  return status == StepStatus::OK || status == StepStatus::NO_MAP || status == StepStatus::PARTIAL ||
         status == StepStatus::DEADLINE || status == StepStatus::TRUNCATED;
}

bool isSeam(StepStatus status) {
  return status == StepStatus::FIRST_FRAME || status == StepStatus::TOPOLOGY_CHANGED || status == StepStatus::GAP ||
         status == StepStatus::TIME_JUMP || status == StepStatus::TELEPORT;
}

const char* toString(StartState state) {
  static const char* const NAMES[] = {"CLEAR", "INTERSECTING", "NOT_CHECKED"};
  return NAMES[static_cast<std::size_t>(state)];
}

}  // namespace dccd
