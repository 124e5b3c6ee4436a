// Short texts of robots for tests.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "config/monitor_config.h"
#include "robot/robot_model.h"

namespace dccd {
namespace test {

inline std::string robotOf(const std::string& elements) { return "<robot name='test'>" + elements + "</robot>"; }

/// A link with collision elements of these geometries, each with what is to go before it.
inline std::string link(const std::string& name, const std::string& collisions) {
  return "<link name='" + name + "'>" + collisions + "</link>";
}
inline std::string collision(const std::string& geometry, const std::string& before = "") {
  return "<collision>" + before + "<geometry>" + geometry + "</geometry></collision>";
}
inline std::string joint(const std::string& parent, const std::string& child, const std::string& type = "fixed",
                         const std::string& rest = "") {
  return "<joint name='" + parent + "_" + child + "' type='" + type + "'><parent link='" + parent + "'/><child link='" +
         child + "'/>" + rest + "</joint>";
}

inline Robot robotFrom(const std::string& urdf, const std::string& srdf = "", const RobotConfig& config = {},
                       double tolerance_m = 1e-3) {
  return makeRobot({"test.urdf", urdf, ""}, {srdf.empty() ? "" : "test.srdf", srdf, ""}, config, tolerance_m);
}

/// What reads this robot, whatever the parameters name.
inline RobotLoader loads(const std::string& urdf, const std::string& srdf = "") {
  return [=](const RobotConfig& config, double tolerance_m) { return robotFrom(urdf, srdf, config, tolerance_m); };
}

inline const RobotPart& partOf(const Robot& robot, const std::string& name) {
  const auto at =
      std::find_if(robot.parts.begin(), robot.parts.end(), [&](const RobotPart& part) { return part.name == name; });
  if (at == robot.parts.end()) throw std::runtime_error("no part " + name);
  return *at;
}

inline std::string joinedText(const std::vector<std::string>& sentences) {
  std::string text;
  for (const std::string& sentence : sentences) text += sentence + "\n";
  return text;
}

inline bool says(const std::vector<std::string>& sentences, const std::string& part) {
  return joinedText(sentences).find(part) != std::string::npos;
}

}  // namespace test
}  // namespace dccd
