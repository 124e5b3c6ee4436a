// What the node says to people: throttled lines, each with what to do, and the hints that diagnostics repeat.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include <ros/node_handle.h>

#include "config/monitor_config.h"
#include "dccd/stream.h"
#include "input/log_throttle.h"
#include "input/silence.h"
#include "node/monitor_pipeline.h"
#include "node/named_inputs.h"

namespace dccd {

class MonitorLog {
 public:
  MonitorLog(const ros::NodeHandle& node, const std::string& name, const MonitorConfig& config);

  /// One line per kind and period, led by the body's topic, or by the map's when there is no such body.
  void complain(std::size_t body, const std::string& kind, const std::string& text);
  /// The same of another topic.
  void complain(const std::string& kind, const std::string& topic, const std::string& text);
  /// An error line, one per kind and period.
  void alarm(const std::string& kind, const std::string& text);
  /// Whether lines of this kind, which are not to be lost, may be written now.
  bool isDue(const std::string& kind);
  /// An outcome that is not OK: status, reason, and what to do; where a doubt explains it, that alone.
  void tell(const Outcome& outcome, const Statement& said);
  /// While the monitor starts, transforms, maps and bodies that are not there yet are no mistake: the first is told, as
  /// what is waited for, and that it came. False: it has started, or has waited for long enough.
  bool waits(const std::string& what);
  /// No step is OK yet, and the first frame came a moment ago, if one did.
  bool isStarting() const;
  /// Whether it is time to look into silence again: rarely, and not at once.
  bool isSilenceDue(std::int64_t now_ns);
  /// Logs a hint when it is another one than before. `silence`: why nothing comes, see silenceHint().
  void hintAt(std::string silence, const MonitorPipeline& pipeline);
  /// What looks like a mistake now; empty: nothing does.
  const std::string& hint() const { return hint_; }

  /// The body's topic; of a robot's link its name.
  std::string topicOf(std::size_t body) const {
    const BodyConfig& one = config_.bodies[body];
    return one.body.link.empty() ? node_.resolveName(one.topic) : "body '" + one.body.name + "'";
  }
  const std::string& mapSource() const { return map_source_; }

 private:
  ros::NodeHandle node_;
  std::string name_;
  const MonitorConfig& config_;
  std::string map_source_;
  LogThrottle throttle_{5};
  std::int64_t asked_ns_ = 0, first_ns_ = 0;  // the latter of the first outcome
  bool has_started_ = false, told_waiting_ = false;
  std::string hint_, told_hint_;
};

}  // namespace dccd
