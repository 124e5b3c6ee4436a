// The node's class as a nodelet: deformable_ccd/CollisionMonitor.
#include <memory>

#include <nodelet/nodelet.h>
#include <pluginlib/class_list_macros.hpp>

#include "ros/collision_monitor.h"

namespace deformable_ccd {

class CollisionMonitorNodelet : public nodelet::Nodelet {
 private:
  // What it throws about a parameter reaches the manager, which refuses to load and logs the sentence.
  void onInit() override { monitor_ = std::make_unique<CollisionMonitor>(getNodeHandle(), getPrivateNodeHandle()); }
  std::unique_ptr<CollisionMonitor> monitor_;
};

}  // namespace deformable_ccd

PLUGINLIB_EXPORT_CLASS(deformable_ccd::CollisionMonitorNodelet, nodelet::Nodelet)
