// Where a robot's URDF and SRDF come from: the parameter server, or files.
#pragma once

#include <functional>

#include <ros/node_handle.h>

#include "config/robot_config.h"

namespace dccd {

/// By a parameter's name, resolved by the node; an address (package://, file://) or a name that ends in .urdf, .srdf or
/// .xml is a file. Waits for parameters up to ten seconds together, while `goes_on` holds; `waits` is told for
/// which.
RobotLoader robotOfParameters(const ros::NodeHandle& node, std::function<bool()> goes_on,
                              std::function<void(const std::string&)> waits);

/// By files alone, where there is no parameter server.
RobotLoader robotOfFiles();

}  // namespace dccd
