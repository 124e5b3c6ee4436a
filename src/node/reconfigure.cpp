#include "node/reconfigure.h"

#include <boost/thread/recursive_mutex.hpp>

#include <deformable_ccd/CollisionMonitorConfig.h>
#include <dynamic_reconfigure/server.h>

#include "dccd/accuracy.h"

namespace dccd {

namespace {

deformable_ccd::CollisionMonitorConfig toLive(const MonitorConfig& config) {
  deformable_ccd::CollisionMonitorConfig live = deformable_ccd::CollisionMonitorConfig::__getDefault__();
  live.accuracy = static_cast<int>(config.monitor.detector.accuracy.rung);
  live.step_budget_ms = config.monitor.detector.step_budget_ms;
  live.max_step_s = config.monitor.store.max_step_s;
  live.max_vertex_step_m = config.monitor.store.max_vertex_step_m;
  live.max_contacts = static_cast<int>(config.monitor.detector.max_contacts);
  live.suppress_initial = config.monitor.detector.suppress_initial;
  live.marker_point_size_m = config.markers.point_size_m;
  live.marker_normal_length_m = config.markers.normal_length_m;
  live.marker_mesh = config.markers.mesh;
  live.marker_obstacle_m = config.markers.obstacle_m;
  return live;
}

void fromLive(const deformable_ccd::CollisionMonitorConfig& live, MonitorOptions& options, MarkerConfig& markers) {
  options.detector.accuracy.rung = static_cast<Accuracy>(live.accuracy);
  options.detector.step_budget_ms = live.step_budget_ms;
  options.store.max_step_s = live.max_step_s;
  options.store.max_vertex_step_m = live.max_vertex_step_m;
  options.detector.max_contacts = static_cast<std::size_t>(live.max_contacts);
  options.detector.suppress_initial = live.suppress_initial;
  markers.point_size_m = live.marker_point_size_m;
  markers.normal_length_m = live.marker_normal_length_m;
  markers.mesh = live.marker_mesh;
  markers.obstacle_m = live.marker_obstacle_m;
}

}  // namespace

struct Reconfigure::Impl {
  bool separates = false;
  Changed changed;
  boost::recursive_mutex mutex;  // shared with the server, which asks for it so that updateConfig cannot deadlock
  dynamic_reconfigure::Server<deformable_ccd::CollisionMonitorConfig> server;

  Impl(const ros::NodeHandle& node, const MonitorConfig& config, Changed call)
      : separates(config.holdsDistance()), changed(std::move(call)), server(mutex, node) {
    server.updateConfig(toLive(config));
    bool first = true;  // setCallback calls at once, with what is in force already
    server.setCallback([this, first](deformable_ccd::CollisionMonitorConfig& live, std::uint32_t) mutable {
      if (!first) apply(live);
      first = false;
    });
  }

  void apply(deformable_ccd::CollisionMonitorConfig& live) {
    const auto rung = static_cast<Accuracy>(live.accuracy);
    if (separates && !holdsDistance(rung)) {
      live.accuracy = static_cast<int>(Accuracy::CONSERVATIVE);  // the only rungs that hold a distance: this and screen
    }
    changed([live](MonitorOptions& options, MarkerConfig& markers) { fromLive(live, options, markers); });
  }
};

Reconfigure::Reconfigure(const ros::NodeHandle& private_node, const MonitorConfig& config, Changed changed) {
  ros::NodeHandle live(private_node, "live");
  live.setCallbackQueue(private_node.getCallbackQueue());
  impl_ = std::make_unique<Impl>(live, config, std::move(changed));
}

Reconfigure::~Reconfigure() = default;

}  // namespace dccd
