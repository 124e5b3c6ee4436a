// The effect plan of a running monitor: renewed only when the scene changes, in force from the next step on.
#pragma once

#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>

#include "config/monitor_config.h"

namespace dccd {

class EffectTracker {
 public:
  /// Throws std::invalid_argument when an effect is asked for that the scene cannot have.
  /// `map_source`: the octomap's resolved topic or its file; empty: as the configuration calls it.
  explicit EffectTracker(const MonitorConfig& config, const std::string& map_source = {});

  /// The octomap's resolved topic or its file.
  const std::string& mapSource() const { return scene_.map_source; }
  /// False: the octomap is switched off, nothing is subscribed to for it.
  bool mayUseMap() const;
  bool mapExpected() const { return plan_.running(Effect::OCTOMAP); }
  /// A map has come or may come any time, for somebody publishes maps; a file is as good.
  bool mapSeen() const { return scene_.map_seen; }
  /// A map has come, or somebody is there who publishes maps.
  void expectMap();
  /// Whether anybody subscribes to predictions, or they are asked for otherwise.
  void hearPredictions(bool heard);
  /// Whether anybody subscribes to distances, or to markers, in which those are drawn that there are; where something
  /// is promised they are wanted all the same.
  void hearDistances(bool heard, bool drawn = false);
  /// Somebody may read each of them.
  bool areAllDistancesRead() const { return all_read_; }
  /// A body has come, or is another one.
  void setBody(std::size_t body, const Body& what);
  /// Sets what the plan decides of a monitor's options. False: they are so already.
  bool decide(MonitorOptions& options) const;
  /// Learns topologies, whether there is a map and what is left out from the outcome.
  void learn(const Outcome& outcome);
  /// True when the plan has changed since the last call, or at the first one.
  bool takeNewPlan();

  const EffectPlan& plan() const { return plan_; }
  std::vector<std::string> lines() const { return plan_.lines(); }
  /// Of each effect its name, the reason, and as values its setting and whether it is running.
  diagnostic_msgs::DiagnosticArray message(const ros::Time& stamp, const std::string& frame) const;

 private:
  EffectScene scene_;
  EffectSettings settings_;
  bool promised_ = false, all_read_ = true;
  EffectPlan plan_, told_;
};

}  // namespace dccd
