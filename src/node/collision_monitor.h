// The node's class: the same object as a node (collision_monitor_node) and as a nodelet.
#pragma once

#include <functional>
#include <memory>

#include <ros/init.h>
#include <ros/node_handle.h>

namespace dccd {

class CollisionMonitor {
 public:
  /// Reads the parameters under `private_node`, subscribes, advertises and starts its own threads: callbacks never wait
  /// for a step. Throws ParameterError or std::invalid_argument with one sentence that names the parameter.
  /// Waits for a robot's description, while `goes_on` holds and up to ten seconds.
  /// Process::OWN ends within a second of the monitor's end, whatever still runs. In a SHARED one topics of a named
  /// type are subscribed to by that type, so that publishers in it hand over their objects.
  enum class Process { OWN, SHARED };
  CollisionMonitor(const ros::NodeHandle& node, const ros::NodeHandle& private_node, Process process,
                   const std::function<bool()>& goes_on = ros::ok);
  /// Stops in mid-stream: the step that runs is cut, nothing is published after it.
  ~CollisionMonitor();
  CollisionMonitor(const CollisionMonitor&) = delete;
  CollisionMonitor& operator=(const CollisionMonitor&) = delete;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
