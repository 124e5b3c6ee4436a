// What a range of a bag (--from, --to) leaves in its folder for --merge, beside the tables.
#pragma once

#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "dccd/effect_plan.h"
#include "node/bag_replay.h"

namespace dccd {

constexpr const char* RANGE_LOG = "range.log";

struct RangeResult {
  std::string folder;
  std::string bag_name;
  std::uint64_t bag_bytes = 0, parameters = 0;  // MonitorConfig::hash()
  StepRange frames;                             // last: of the bag's end none
  double from_s = 0, to_s = 0;                  // infinity: to the end
  BagReplaySummary summary;                     // its effects are below
  std::vector<EffectDecision> effects;
  nlohmann::json report;  // Report::state()

  bool isEmpty() const { return frames.last < frames.first; }
  bool reachesEnd() const { return frames.last == StepRange().last; }
};

/// Written last: a folder without it is no range. Throws std::runtime_error naming the file.
void writeRange(const RangeResult& range);
/// Throws std::runtime_error naming the file and what is wrong with it.
RangeResult readRange(const std::string& folder);
/// By their first frames. Throws std::runtime_error naming the folder of what is of another bag, was computed with
/// other parameters, or holds what another one holds.
std::vector<RangeResult> readRanges(const std::vector<std::string>& folders, const std::string& bag,
                                    std::uint64_t parameters);
/// Of the whole, from the ranges in their order: what the last one knows, and the answers of each.
BagReplaySummary joined(const std::vector<RangeResult>& ranges);

}  // namespace dccd
