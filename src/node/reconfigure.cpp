#include "node/reconfigure.h"

#include <cmath>
#include <stdexcept>
#include <utility>
#include <vector>

#include <boost/thread/recursive_mutex.hpp>

#include <deformable_ccd/CollisionMonitorConfig.h>
#include <dynamic_reconfigure/server.h>

#include "dccd/accuracy.h"

namespace dccd {

namespace {

deformable_ccd::CollisionMonitorConfig toLive(const MonitorOptions& options, const MarkerConfig& markers) {
  deformable_ccd::CollisionMonitorConfig live = deformable_ccd::CollisionMonitorConfig::__getDefault__();
  live.accuracy = static_cast<int>(options.detector.accuracy.rung);
  live.step_budget_ms = options.detector.step_budget_ms;
  live.max_step_s = options.store.max_step_s;
  live.max_vertex_step_m = options.store.max_vertex_step_m;
  live.max_contacts = static_cast<int>(options.detector.max_contacts);
  live.suppress_initial = options.detector.suppress_initial;
  live.marker_point_size_m = markers.point_size_m;
  live.marker_normal_length_m = markers.normal_length_m;
  live.marker_mesh = markers.mesh;
  live.marker_obstacle_m = markers.obstacle_m;
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

/// Empty: the monitor takes them.
std::string problemOf(const MonitorOptions& options, const std::vector<Body>& bodies) {
  try {
    check(options.detector, bodies);
    MeshStore store(options.store);
    return {};
  } catch (const std::invalid_argument& error) {
    return error.what();
  }
}

}  // namespace

struct Reconfigure::Impl {
  using Live = deformable_ccd::CollisionMonitorConfig;
  bool separates = false;
  MonitorOptions options;  // in force
  MarkerConfig markers;
  std::vector<Body> bodies;
  Events events;
  boost::recursive_mutex mutex;  // shared with the server, which asks for it so that updateConfig cannot deadlock
  dynamic_reconfigure::Server<Live> server;

  Impl(const ros::NodeHandle& node, const MonitorConfig& config, Events call)
      : separates(config.holdsDistance()),
        options(config.monitor),
        markers(config.markers),
        events(std::move(call)),
        server(mutex, node) {
    for (const BodyConfig& body : config.bodies) bodies.push_back(body.body);
    server.updateConfig(toLive(options, markers));
    bool first = true;  // setCallback calls at once, with what is in force already
    server.setCallback([this, first](Live& live, std::uint32_t) mutable {
      if (!first) apply(live);
      first = false;
    });
  }

  /// Takes over one value, where it is another one and good; else says why it is not. The server has clamped it to its
  /// range, which a NaN passes.
  template <typename Value>
  void take(const char* name, Value Live::*value, const Live& wanted, Live& live) {
    if (wanted.*value == live.*value) return;
    const Value before = std::exchange(live.*value, wanted.*value);
    MonitorOptions tried = options;
    MarkerConfig tried_markers = markers;
    fromLive(live, tried, tried_markers);
    std::string problem = problemOf(tried, bodies);
    if (!std::isfinite(static_cast<double>(live.*value))) problem = "it is no number";
    if (problem.empty()) return;
    live.*value = before;
    events.refused(std::string("~live/") + name + " " + std::to_string(wanted.*value) + " was refused, " +
                   std::to_string(before) + " stays: " + problem);
  }

  void apply(Live& live) {
    Live wanted = live;
    if (separates && !holdsDistance(static_cast<Accuracy>(wanted.accuracy))) {
      wanted.accuracy =
          static_cast<int>(Accuracy::CONSERVATIVE);  // the only rungs that hold a distance: this and screen
    }
    live = toLive(options, markers);
    take("accuracy", &Live::accuracy, wanted, live);
    take("step_budget_ms", &Live::step_budget_ms, wanted, live);
    take("max_step_s", &Live::max_step_s, wanted, live);
    take("max_vertex_step_m", &Live::max_vertex_step_m, wanted, live);
    take("max_contacts", &Live::max_contacts, wanted, live);
    take("suppress_initial", &Live::suppress_initial, wanted, live);
    take("marker_point_size_m", &Live::marker_point_size_m, wanted, live);
    take("marker_normal_length_m", &Live::marker_normal_length_m, wanted, live);
    take("marker_mesh", &Live::marker_mesh, wanted, live);
    take("marker_obstacle_m", &Live::marker_obstacle_m, wanted, live);
    fromLive(live, options, markers);
    events.changed(options, markers);
  }
};

Reconfigure::Reconfigure(const ros::NodeHandle& private_node, const MonitorConfig& config, Events events) {
  ros::NodeHandle live(private_node, "live");
  live.setCallbackQueue(private_node.getCallbackQueue());
  impl_ = std::make_unique<Impl>(live, config, std::move(events));
}

Reconfigure::~Reconfigure() = default;

}  // namespace dccd
