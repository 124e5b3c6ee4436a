// A step as RViz markers. Built only for a subscriber.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include "output/output_messages.h"

#include "config/monitor_config.h"
#include "dccd/intended.h"

namespace dccd {

/// First a DELETEALL, then a few list markers, in namespaces as doc/interface.md lists them: contacts, those that were
/// there when the step began, expected ones, a normal of each patch, faces, edges of voxels, a text where a patch
/// began, the shortest segment between each two partners; if asked for the map around the bodies, and the bodies with
/// their names.
visualization_msgs::MarkerArray toMarkers(const Outcome& outcome, const std::vector<Body>& bodies,
                                          const MarkerConfig& config, const std::string& frame);

/// Beside these: where the middle of each body on the path goes, as thick as its tube at the end.
void addPath(const Outcome& outcome, const IntendedPath& path, const std::string& frame,
             visualization_msgs::MarkerArray& array);

/// To be shown beside those of the step that it begins after.
visualization_msgs::MarkerArray toPredictedMarkers(const Outcome& prediction, double horizon_s,
                                                   const std::vector<Body>& bodies, const MarkerConfig& config,
                                                   const std::string& frame);

}  // namespace dccd
