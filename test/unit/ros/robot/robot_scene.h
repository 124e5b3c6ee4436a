// The parameters of a cloth beside a robot.
#pragma once

#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {

/// YAML of what stands under `robot`, of the rest, and of the fixed frame. Nothing waits for a transform.
inline XmlRpcValue robotScene(const std::string& of_robot = "", const std::string& more = "effects: {octomap: 'off'}",
                              const std::string& fixed_frame = "fixed_frame: world, ") {
  const std::string robot = "description: robot_description" + (of_robot.empty() ? "" : ", " + of_robot);
  return parameters(fixed_frame + "max_vertex_step_m: 0.0, transform_timeout_s: 0.0, robot: {" + robot + "}, " + more);
}

}  // namespace test
}  // namespace dccd
