// dynamic_reconfigure, kept to one file, for its headers are large. Its server writes what it holds back to the
// parameter server in types of its own, so it lives under ~live, apart from the parameters proper.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include <ros/node_handle.h>

#include "config/monitor_config.h"

namespace dccd {

class Reconfigure {
 public:
  /// Writes the live values into the options; the rest of them stays.
  using Change = std::function<void(MonitorOptions&, MarkerConfig&)>;
  /// Called from the handle's callback queue.
  struct Events {
    /// To be in force from the next step on. Returns why that is refused, and all stays; empty: it is not.
    std::function<std::string(const Change&)> change;
    std::function<void(const std::string& why)> refused;  ///< one value, for the log
  };
  /// Starts with the values of `config`; nobody else is to change them. A value that is refused is so alone, and the
  /// one before stays in force: what the services answer is in force from the next step on.
  Reconfigure(const ros::NodeHandle& private_node, const MonitorConfig& config, Events events);
  ~Reconfigure();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
