// The node's class as a nodelet: deformable_ccd/CollisionMonitor.
#include <exception>
#include <memory>

#include <nodelet/nodelet.h>
#include <pluginlib/class_list_macros.hpp>

#include "node/collision_monitor.h"

namespace dccd {

class CollisionMonitorNodelet : public nodelet::Nodelet {
 private:
  void onInit() override {
    try {
      monitor_ = std::make_unique<CollisionMonitor>(getNodeHandle(), getPrivateNodeHandle(),
                                                    CollisionMonitor::Process::SHARED);
    } catch (const std::exception& error) {
      NODELET_FATAL_STREAM("collision_monitor cannot start: " << error.what());
      throw;  // the manager then refuses to load, but says nothing about why
    }
  }
  std::unique_ptr<CollisionMonitor> monitor_;
};

}  // namespace dccd

PLUGINLIB_EXPORT_CLASS(dccd::CollisionMonitorNodelet, nodelet::Nodelet)
