// The node. Exit status 1 when a parameter is wrong, with one line that says which; 0 after SIGINT and SIGTERM, when
// the step that runs is finished.
#include <atomic>
#include <csignal>
#include <exception>

#include <ros/callback_queue.h>
#include <ros/ros.h>

#include "config/parameter_reader.h"
#include "node/collision_monitor.h"

namespace {

std::atomic<bool> ended{false};
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler sets it");

}  // namespace

int main(int argc, char** argv) {
  // roscpp's own handler would take the topics away before the monitor has said that it proves nothing any more.
  ros::init(argc, argv, "collision_monitor", ros::init_options::NoSigintHandler);
  for (const int signal : {SIGINT, SIGTERM}) {  // containers and service managers send SIGTERM
    std::signal(signal, [](int) { ended = true; });
  }
  const ros::NodeHandle node;  // outlives the monitor: with the last handle roscpp ends, and logging with it
  try {
    const auto goes_on = [] { return ros::ok() && !ended; };
    const dccd::CollisionMonitor monitor{node, ros::NodeHandle("~"), dccd::CollisionMonitor::Process::OWN, goes_on};
    while (ros::ok() && !ended) ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(0.05));
  } catch (const dccd::ParameterError& error) {
    ROS_FATAL_STREAM("collision_monitor cannot start: " << error.what()
                                                        << " (an earlier start may have left it: rosparam delete "
                                                        << ros::this_node::getName() << ")");
    return 1;
  } catch (const std::exception& error) {
    ROS_FATAL_STREAM("collision_monitor cannot start: " << error.what());
    return 1;
  }
  return 0;
}
