// The node. Exit status 1 when a parameter is wrong, with one line that says which; 0 after SIGINT and SIGTERM, when
// the step that runs is finished.
#include <atomic>
#include <csignal>
#include <exception>
#include <string>
#include <vector>

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "config/parameter_reader.h"
#include "node/collision_monitor.h"

namespace {

std::atomic<bool> ended{false}, stands{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

/// Where neither a launch file nor the command line has set it, an earlier start has.
std::string whoElseSetIt(const std::vector<std::string>& arguments, const std::string& error) {
  for (const std::string& argument : arguments) {
    const std::size_t end = argument.find(":=");
    if (argument.rfind("__log:=", 0) == 0) return "";  // of roslaunch
    if (argument.rfind("_", 0) != 0 || end == std::string::npos) continue;
    if (error.find("~" + argument.substr(1, end - 1)) != std::string::npos) return "";
  }
  return " (an earlier start may have left it: rosparam delete " + ros::this_node::getName() + ")";
}

}  // namespace

int main(int argc, char** argv) {
  const std::vector<std::string> arguments(argv + 1, argv + argc);  // roscpp takes its own out
  // roscpp's own handler would take the topics away before the monitor has said that it proves nothing any more. Until
  // the monitor stands roscpp may wait for a master, and nothing else ends that.
  ros::init(argc, argv, "collision_monitor", ros::init_options::NoSigintHandler);
  for (const int signal : {SIGINT, SIGTERM}) {  // containers and service managers send SIGTERM
    std::signal(signal, [](int) {
      ended = true;
      if (!stands) ros::requestShutdown();
    });
  }
  const ros::NodeHandle node;  // outlives the monitor: with the last handle roscpp ends, and logging with it
  try {
    const auto goes_on = [] { return ros::ok() && !ended; };
    const dccd::CollisionMonitor monitor{node, ros::NodeHandle("~"), dccd::CollisionMonitor::Process::OWN, goes_on};
    stands = true;
    while (ros::ok() && !ended) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  } catch (const std::exception& error) {
    if (ended) return 0;  // parameters that nobody gave any more
    const bool is_named = dynamic_cast<const dccd::ParameterError*>(&error);
    ROS_FATAL_STREAM("collision_monitor cannot start: " << error.what()
                                                        << (is_named ? whoElseSetIt(arguments, error.what()) : ""));
    return 1;
  }
  return 0;
}
