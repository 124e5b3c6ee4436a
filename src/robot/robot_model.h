// A robot's texts become the meshes that are watched, in the frames of its links.
#pragma once

#include <string>

#include "config/robot_config.h"

namespace dccd {

/// A URDF or SRDF, or why there is none.
struct RobotText {
  std::string name;     ///< of its parameter or file
  std::string text;     ///< empty: `problem` says why
  std::string problem;  ///< what is wrong, to go after the name
};

/// Never throws for what a text or mesh holds: what cannot be watched is `missing`, a sentence each, and the rest
/// holds. `semantic` with an empty name: none was asked for. Round primitives are meshed from outside to within the
/// tolerance [m].
Robot makeRobot(const RobotText& description, const RobotText& semantic, const RobotConfig& config, double tolerance_m);

}  // namespace dccd
