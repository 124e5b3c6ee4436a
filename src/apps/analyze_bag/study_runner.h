// Replays a bag with one thing coarser at a time (doc/accuracy.md, "What accuracy costs a user").
#pragma once

#include <string>

#include "node/bag_replay.h"
#include "report/accuracy_study.h"

namespace dccd {

/// The reference is the bag as it was recorded, with the finest setting that the configuration allows. Each run is kept
/// as a file of `folder`, and taken from there when bag and configuration are the same: what was stopped goes on.
/// Throws what BagReplay throws, and std::runtime_error naming a file that cannot be written.
AccuracyStudy runStudy(const std::string& bag, const MonitorConfig& config, const BagReplayOptions& options,
                       const std::string& folder);

}  // namespace dccd
