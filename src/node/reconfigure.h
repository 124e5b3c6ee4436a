// dynamic_reconfigure, kept to one file, for its headers are large. Its server writes what it holds back to the
// parameter server in types of its own, so it lives under ~live, apart from the parameters proper.
#pragma once

#include <functional>
#include <memory>

#include <ros/node_handle.h>

#include "config/monitor_config.h"

namespace dccd {

class Reconfigure {
 public:
  /// Writes the live values into the options; the rest of them stays.
  using Change = std::function<void(MonitorOptions&, MarkerConfig&)>;
  using Changed = std::function<void(const Change&)>;
  /// Starts with the values of `config`. `changed` is called from the handle's callback queue with what to change.
  Reconfigure(const ros::NodeHandle& private_node, const MonitorConfig& config, Changed changed);
  ~Reconfigure();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
