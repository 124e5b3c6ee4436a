// What the node listens to, and which of it somebody named: by a parameter, or by a remapping, of which the parameters
// know nothing. What is named is called for; a default names nothing.
#pragma once

#include <string>

#include <ros/node_handle.h>

#include "config/monitor_config.h"

namespace dccd {

/// Adds what remappings name. Where no parameter names the map's topic, a remapping of the default one does, or else
/// one of `octomap`, which is what people try first; octomap_topic is then the name to subscribe to. Throws
/// ParameterError where they name both a map and clouds.
void takeRemappings(const ros::NodeHandle& node, MonitorConfig& config);

/// The resolved topic of the octomap or of the clouds that it is made of, or its file.
std::string mapSourceOf(const ros::NodeHandle& node, const MonitorConfig& config);

/// "cloth: /tracker/cloth (named), octomap: /octomap_binary (default), tf", after takeRemappings().
std::string inputsOf(const ros::NodeHandle& node, const MonitorConfig& config);

}  // namespace dccd
