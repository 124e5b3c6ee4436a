// What a step promises as messages. Used by the node and by analyze_bag.
#pragma once

#include <string>
#include <vector>

#include <deformable_ccd/AlongPath.h>
#include <deformable_ccd/Limits.h>
#include <deformable_ccd/SafeUntil.h>
#include <deformable_ccd/SpeedScale.h>

#include "dccd/approach_limits.h"
#include "dccd/intended.h"
#include "dccd/monitor_extras.h"

namespace dccd {

/// The watch has followed the outcome; `now`: when it is published.
deformable_ccd::SafeUntil toSafeUntil(const Outcome& outcome, const PromiseWatch& watch,
                                      const std::vector<SpeedBound>& bounds, const ros::Time& now,
                                      const std::string& frame);
/// What the distances allow; whether all else is proved is said by limitSpeed().
deformable_ccd::SpeedScale toSpeedScale(const Outcome& outcome, const SpeedScale& speed, const std::string& frame);
/// What a path says of a step.
deformable_ccd::AlongPath toAlongPath(const Outcome& outcome, const IntendedPath& path, const AlongPath& along,
                                      const std::string& frame);
deformable_ccd::Limits toLimits(const Outcome& outcome, const ApproachLimits& limits,
                                const std::vector<SpeedBound>& bounds, const std::string& frame);
/// What a promise rests on, a sentence each; that it rests on a path, too.
std::vector<std::string> assumptions(const Outcome& outcome, const std::vector<SpeedBound>& bounds);
std::string assumedOf(const Outcome& outcome, const IntendedPath& path);
/// Why the newest answer is too old for the law, which counts from its frame's stamp, but at least from its arrival; so
/// long ago were the two [s]. Empty: it is not.
std::string whyTooOld(double since_stamp_s, double since_arrival_s, const SpeedLaw& law);
/// 0 for this reason.
void limitSpeed(const std::string& reason, deformable_ccd::SpeedScale& message);

}  // namespace dccd
