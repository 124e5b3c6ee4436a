// /diagnostics: one status a second with rates, drops, resets, latency and the map's age.
#pragma once

#include "output/output_messages.h"

#include <string>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/time.h>

namespace dccd {

constexpr const char* DIAGNOSTICS_TOPIC = "/diagnostics";

class Diagnostics {
 public:
  /// `monitor`: the namespace that it publishes in.
  explicit Diagnostics(const std::string& monitor);
  /// What its status is called.
  const std::string& name() const { return name_; }
  void add(const Outcome& outcome, double latency_s);
  /// Once a second by the clock of `now_ns`.
  bool isDue(std::int64_t now_ns) const;
  /// The status since the last call; begins the next period. `context`: the state of now, whether or not there has been
  /// an outcome; `hint`: what looks like a mistake; `map_topic`: where the octomap is looked for, or empty when none is
  /// expected.
  diagnostic_msgs::DiagnosticArray take(std::int64_t now_ns, const ros::Time& stamp, const StatsContext& context,
                                        bool enabled, const std::string& map_topic, const std::string& hint);

 private:
  void judge(diagnostic_msgs::DiagnosticStatus& status, bool drops, bool enabled, const std::string& map_topic,
             const std::string& hint) const;

  std::string name_;
  std::int64_t last_ns_ = 0;
  // Since the last status.
  std::uint64_t outcomes_ = 0, answers_ = 0;
  double worst_latency_s_ = 0;
  std::uint64_t dropped_before_ = 0;  // frames dropped in all, at the last status
  // Of the newest outcome.
  StepStatus status_ = StepStatus::FIRST_FRAME;
  std::string reason_;
  // Of the newest one with an answer: the others had no use for a map.
  std::string map_reason_;
  double map_age_s_ = 0;
  bool map_present_ = false;
};

/// One sentence for people: status, contacts, earliest time.
std::string describe(const Outcome& outcome);

}  // namespace dccd
