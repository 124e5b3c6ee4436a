#include "node/robot_source.h"

#include <chrono>
#include <sstream>
#include <stdexcept>
#include <utility>

#include <ros/console.h>

#include "config/parameter_tree.h"
#include "input/mesh_resource.h"
#include "robot/robot_model.h"

namespace dccd {
namespace {

constexpr double LOOK_AGAIN_S = 0.1;
constexpr std::chrono::seconds LONGEST_WAIT(10);

bool isFile(const std::string& name) {
  const std::string ending = fileEnding(name);
  return name.find("://") != std::string::npos || ending == "urdf" || ending == "srdf" || ending == "xml";
}

RobotText readFile(const std::string& name, const std::string& what) {
  RobotText read;
  read.name = name;
  if (name.empty()) return read;
  try {
    read.text = yamlText(pathOf(name), what);
  } catch (const std::invalid_argument& error) {
    read.problem = std::string("cannot be read: ") + error.what();
  }
  if (read.text.empty() && read.problem.empty()) read.problem = "is empty";
  return read;
}

/// Asks the parameter server until it has both or time is up.
class ParameterTexts {
 public:
  using Waits = std::function<void(const std::string&)>;
  ParameterTexts(const ros::NodeHandle& node, const std::function<bool()>& goes_on, const Waits& waits)
      : node_(node), until_(Clock::now() + LONGEST_WAIT), goes_on_(goes_on), waits_(waits) {}

  /// The parameter as robot_state_publisher and RViz find it: in the node's namespace, or in one around that.
  /// `held`: of a parameter, under its resolved name, what it holds.
  RobotText read(const std::string& name, const std::string& what, std::map<std::string, std::string>& held) const {
    if (name.empty() || isFile(name)) return readFile(name, what);
    RobotText read;
    std::string found;
    try {
      std::string resolved = node_.resolveName(name);
      bool told = false;
      while (!node_.searchParam(name, found) && goes_on_() && Clock::now() < until_) {
        if (!std::exchange(told, true)) {
          std::ostringstream text;
          text << "waits for parameter " << resolved << ", " << what << ", for " << LONGEST_WAIT.count()
               << " s at most";
          ROS_INFO_STREAM(text.str());
          waits_(text.str());
        }
        ros::WallDuration(LOOK_AGAIN_S).sleep();
      }
      if (!found.empty()) resolved = found;
      node_.getParam(resolved, read.text);
      read.name = "parameter " + resolved;
      held[resolved] = read.text;
    } catch (const ros::Exception& error) {
      read.name = "parameter " + name;
      read.problem = std::string("cannot be asked for: ") + error.what();
      return read;
    }
    if (!read.text.empty()) return read;
    std::ostringstream waited;
    waited << "was set by nobody for " << LONGEST_WAIT.count() << " s; publish it before, or correct robot";
    read.problem = !found.empty() ? "is empty or no text; " + what + " is needed" : waited.str();
    return read;
  }

 private:
  using Clock = std::chrono::steady_clock;
  const ros::NodeHandle& node_;
  Clock::time_point until_;
  const std::function<bool()>& goes_on_;
  const Waits& waits_;
};

}  // namespace

RobotLoader robotOfParameters(const ros::NodeHandle& node, std::function<bool()> goes_on,
                              std::function<void(const std::string&)> waits) {
  return [node, goes_on = std::move(goes_on), waits = std::move(waits)](const RobotConfig& config, double tolerance_m) {
    const ParameterTexts texts(node, goes_on, waits);
    std::map<std::string, std::string> held;
    const RobotText description = texts.read(config.description, "a URDF", held);
    Robot robot = makeRobot(description, texts.read(config.semantic, "an SRDF", held), config, tolerance_m);
    robot.parameters = std::move(held);
    return robot;
  };
}

RobotLoader robotOfFiles() {
  return [](const RobotConfig& config, double tolerance_m) {
    for (const std::string& name : {config.description, config.semantic}) {
      if (name.empty() || isFile(name)) continue;
      throw ParameterError("robot names '" + name +
                           "', but there is no parameter server: write the path of a file .urdf or .srdf");
    }
    return makeRobot(readFile(config.description, "a URDF"), readFile(config.semantic, "an SRDF"), config, tolerance_m);
  };
}

}  // namespace dccd
