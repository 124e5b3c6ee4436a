// The node. Exit status 1 when a parameter is wrong, with one line that says which; 0 after SIGINT and SIGTERM, when
// the step that runs is finished.
#include <csignal>
#include <exception>

#include <ros/ros.h>

#include "node/collision_monitor.h"

int main(int argc, char** argv) {
  ros::init(argc, argv, "collision_monitor");
  // roscpp handles SIGINT alone; containers and service managers send SIGTERM.
  std::signal(SIGTERM, [](int) { ros::requestShutdown(); });
  const ros::NodeHandle node;  // outlives the monitor: with the last handle roscpp ends, and logging with it
  try {
    dccd::CollisionMonitor monitor{node, ros::NodeHandle("~")};
    monitor.installCrashHandler();
    ros::spin();
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM("collision_monitor cannot start: " << error.what());
    return 1;
  }
  return 0;
}
