#include "node/reconfigure.h"

#include <cmath>
#include <sstream>
#include <stdexcept>
#include <type_traits>
#include <utility>
#include <vector>

#include <boost/thread/recursive_mutex.hpp>

#include <deformable_ccd/CollisionMonitorConfig.h>
#include <dynamic_reconfigure/server.h>

#include "dccd/accuracy.h"

namespace dccd {

namespace {

/// Calls set(live value, setting) for each of them.
template <class Live, class Options, class Markers, class Set>
void forEachLive(Live& live, Options& monitor, Markers& markers, const Set& set) {
#define DCCD_SET_SETTING(name, value) set(live.name, value);
  DCCD_LIVE_SETTINGS(DCCD_SET_SETTING)
#undef DCCD_SET_SETTING
}

deformable_ccd::CollisionMonitorConfig toLive(const MonitorConfig& config) {
  auto live = deformable_ccd::CollisionMonitorConfig::__getDefault__();
  forEachLive(live, config.monitor, config.markers, [](auto& value, const auto& setting) {
    value = static_cast<std::remove_reference_t<decltype(value)>>(setting);
  });
  return live;
}

void fromLive(const deformable_ccd::CollisionMonitorConfig& live, MonitorOptions& options, MarkerConfig& markers) {
  forEachLive(live, options, markers, [](const auto& value, auto& setting) {
    setting = static_cast<std::remove_reference_t<decltype(setting)>>(value);
  });
}

/// The one value of the message, in words.
std::string textOf(const dynamic_reconfigure::Config& message) {
  std::ostringstream text;
  for (const auto& value : message.bools) text << (value.value ? "true" : "false");
  for (const auto& value : message.ints) text << value.value;
  for (const auto& value : message.doubles) text << value.value;
  return text.str();
}

}  // namespace

struct Reconfigure::Impl {
  using Live = deformable_ccd::CollisionMonitorConfig;
  const MonitorConfig start;  // what cannot be changed live stays as it was
  const std::vector<Body> bodies;
  Live in_force;
  Events events;
  boost::recursive_mutex mutex;  // shared with the server, which asks for it so that updateConfig cannot deadlock
  dynamic_reconfigure::Server<Live> server;

  Impl(const ros::NodeHandle& node, const MonitorConfig& config, Events call)
      : start(config),
        bodies(config.monitorBodies()),
        in_force(toLive(config)),
        events(std::move(call)),
        server(mutex, node) {
    server.updateConfig(in_force);
    bool first = true;  // setCallback calls at once, with what is in force already
    server.setCallback([this, first](Live& live, std::uint32_t) mutable {
      if (!first) apply(live);
      first = false;
    });
  }

  /// Empty: the monitor takes them.
  std::string problemOf(const Live& live) const {
    MonitorOptions options = start.monitor;
    MarkerConfig markers = start.markers;
    fromLive(live, options, markers);
    try {
      check(options.detector, bodies);
      const MeshStore store(options.store);
      return {};
    } catch (const std::invalid_argument& error) {
      return error.what();
    }
  }

  /// Each value by itself: a bad one is refused alone. The server has clamped them to their ranges, which a NaN passes.
  void apply(Live& live) {
    // The only rung that holds a distance.
    if (start.holdsDistance() && !holdsDistance(static_cast<Accuracy>(live.accuracy))) {
      live.accuracy = static_cast<int>(Accuracy::CONSERVATIVE);
    }
    for (const auto& parameter : Live::__getParamDescriptions__()) {
      dynamic_reconfigure::Config value, before;
      parameter->toMessage(value, live);
      parameter->toMessage(before, in_force);
      Live tried = in_force;
      parameter->fromMessage(value, tried);
      const bool is_number = value.doubles.empty() || std::isfinite(value.doubles.front().value);
      const std::string problem = is_number ? problemOf(tried) : "it is no number";
      if (problem.empty()) {
        in_force = tried;
      } else {
        events.refused("~live/" + parameter->name + " " + textOf(value) + " was refused, " + textOf(before) +
                       " stays: " + problem);
      }
    }
    live = in_force;
    events.changed([live](MonitorOptions& options, MarkerConfig& markers) { fromLive(live, options, markers); });
  }
};

Reconfigure::Reconfigure(const ros::NodeHandle& private_node, const MonitorConfig& config, Events events) {
  ros::NodeHandle live(private_node, "live");
  live.setCallbackQueue(private_node.getCallbackQueue());
  impl_ = std::make_unique<Impl>(live, config, std::move(events));
}

Reconfigure::~Reconfigure() = default;

}  // namespace dccd
