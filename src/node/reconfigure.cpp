#include "node/reconfigure.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <type_traits>
#include <utility>

#include <boost/thread/recursive_mutex.hpp>

#include <deformable_ccd/CollisionMonitorConfig.h>
#include <dynamic_reconfigure/server.h>

#include "base/accuracy.h"

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

bool isFinite(const deformable_ccd::CollisionMonitorConfig& live) {
  dynamic_reconfigure::Config all;
  live.__toMessage__(all);
  return std::all_of(all.doubles.begin(), all.doubles.end(), [](const auto& one) { return std::isfinite(one.value); });
}

/// Whether both messages have the same one value.
bool isSame(const dynamic_reconfigure::Config& a, const dynamic_reconfigure::Config& b) {
  const auto same = [](const auto& one, const auto& other) {
    return one.empty() || one.front().value == other.front().value;
  };
  return same(a.bools, b.bools) && same(a.ints, b.ints) && same(a.doubles, b.doubles);
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
  const bool holds_distance;
  Live in_force;
  Events events;
  boost::recursive_mutex mutex;  // shared with the server, which asks for it so that updateConfig cannot deadlock
  dynamic_reconfigure::Server<Live> server;

  Impl(const ros::NodeHandle& node, const MonitorConfig& config, Events call)
      : holds_distance(config.holdsDistance()), in_force(toLive(config)), events(std::move(call)), server(mutex, node) {
    server.updateConfig(in_force);
    bool first = true;  // setCallback calls at once, with what is in force already
    server.setCallback([this, first](Live& live, std::uint32_t) mutable {
      if (!first) apply(live);
      first = false;
    });
  }

  /// What the monitor says of them, which also knows what is attached.
  std::string take(const Live& live) {
    const std::string problem =
        events.change([live](MonitorOptions& options, MarkerConfig& markers) { fromLive(live, options, markers); });
    if (problem.empty()) in_force = live;
    return problem;
  }

  /// All at once; or where the monitor refuses that, each value by itself, so that a bad one is refused alone. The
  /// server has clamped them to their ranges, which a NaN passes.
  void apply(Live& live) {
    // The only rung that holds a distance.
    if (holds_distance && !holdsDistance(static_cast<Accuracy>(live.accuracy))) {
      live.accuracy = static_cast<int>(Accuracy::CONSERVATIVE);
    }
    if (!isFinite(live) || !take(live).empty()) takeEach(live);
    live = in_force;
  }

  void takeEach(const Live& wanted) {
    for (const auto& parameter : Live::__getParamDescriptions__()) {
      dynamic_reconfigure::Config value, before;
      parameter->toMessage(value, wanted);
      parameter->toMessage(before, in_force);
      if (isSame(value, before)) continue;
      Live tried = in_force;
      parameter->fromMessage(value, tried);
      const std::string problem = isFinite(tried) ? take(tried) : "it is no number";
      if (problem.empty()) continue;
      events.refused("~live/" + parameter->name + " " + textOf(value) + " was refused, " + textOf(before) +
                     " stays: " + problem);
    }
  }
};

Reconfigure::Reconfigure(const ros::NodeHandle& private_node, const MonitorConfig& config, Events events) {
  ros::NodeHandle live(private_node, "live");
  live.setCallbackQueue(private_node.getCallbackQueue());
  impl_ = std::make_unique<Impl>(live, config, std::move(events));
}

Reconfigure::~Reconfigure() = default;

}  // namespace dccd
