// Replays a bag with one thing coarser at a time (doc/accuracy.md, "What accuracy costs a user").
#pragma once

#include <string>
#include <vector>

#include "node/bag_replay.h"
#include "report/accuracy_study.h"

namespace dccd {

/// The reference is the bag as it was recorded, with the finest setting that the configuration allows. Throws what
/// BagReplay throws.
AccuracyStudy runStudy(const std::vector<std::string>& bags, const MonitorConfig& config,
                       const BagReplayOptions& options);

}  // namespace dccd
