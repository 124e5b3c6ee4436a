// A step as RViz markers. Built only for a subscriber.
#pragma once

#include <visualization_msgs/MarkerArray.h>

#include "output/output_messages.h"

#include "config/monitor_config.h"

namespace dccd {

/// First a DELETEALL, then a few list markers: contacts (points coloured by TOC, red early to yellow late), normals,
/// faces, voxels (one list per size of leaf), initial contacts apart, and the meshes and the map around them if asked
/// for.
visualization_msgs::MarkerArray toMarkers(const Outcome& outcome, const std::vector<Body>& bodies,
                                          const MarkerConfig& config, const std::string& frame);

}  // namespace dccd
