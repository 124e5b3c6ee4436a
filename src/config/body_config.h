// The part of the configuration that is about bodies: what they are, where they come from, what they keep apart from.
#pragma once

#include "config/monitor_config.h"

namespace dccd {

/// Limits of numbers that have none of their own.
constexpr double LARGE = 1e9;
constexpr int MANY = 1000000000;

/// minimum_separation_m of the section [m], or the fallback.
double separationOf(ParameterReader& reader, double fallback);
/// The bodies, and which of them is the clock. After the separation that is for all of them.
void readBodies(ParameterReader& reader, MonitorConfig& config);
/// minimum_separation_pairs. After the bodies.
void readSeparationPairs(ParameterReader& reader, MonitorConfig& config);

}  // namespace dccd
