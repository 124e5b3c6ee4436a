// The node's topics. A message is built only when somebody listens; latched ones always, since they are for later
// comers.
#pragma once

#include "output/output_messages.h"

#include <functional>
#include <map>
#include <string>
#include <vector>

#include <diagnostic_msgs/DiagnosticArray.h>
#include <ros/node_handle.h>

#include "config/monitor_config.h"
#include "output/safe_until_messages.h"

namespace dccd {

class Outputs {
 public:
  /// Topics of effects that the configuration has no use for are not there.
  Outputs(ros::NodeHandle& private_node, const MonitorConfig& config);

  /// What a robot waits for, before all that is only looked at: first contact, contacts, patches and their events. The
  /// call of what is returned publishes them, once, before another list is made.
  std::function<void()> makeResult(const Outcome& outcome, const std::vector<Body>& bodies, const std::string& frame);
  void publishMarkers(const Outcome& outcome, const std::vector<Body>& bodies, const MarkerConfig& markers,
                      const std::string& frame, const IntendedPath& path);
  /// After the step's prediction, which it tells of.
  void publishStats(const Outcome& outcome, const StatsContext& context, const std::string& frame);
  /// Whether anybody listens to statistics.
  bool wantsStats() const;
  /// Whether anybody listens to predictions.
  bool wantsPrediction() const;
  /// Whether anybody listens to distances.
  bool wantsDistances() const;
  /// Whether anybody listens to markers.
  bool wantsMarkers() const;
  /// Also one without an answer.
  void publishPrediction(const Outcome& prediction, double horizon_s, const std::vector<Body>& bodies,
                         const MarkerConfig& markers, const std::string& frame);
  /// Latched. Only where the configuration promises something.
  void publishSafeUntil(const deformable_ccd::SafeUntil& message);
  /// Only where paths are listened to.
  void publishAlongPath(const deformable_ccd::AlongPath& message);
  /// Built only if somebody listens, and where it is asked for.
  void publishLimits(const std::function<deformable_ccd::Limits()>& make);
  void publishEffects(const diagnostic_msgs::DiagnosticArray& effects);
  /// Latched. Only where some body separates.
  /// Nothing is shown any more: after a reset or when disabled. An empty frame: nothing was shown yet.
  void publishNothing(const std::string& frame);

 private:
  ros::Publisher contacts_, first_contact_, stats_, markers_, effects_, predicted_, time_to_contact_, patches_, events_,
      clearance_, safe_until_, along_path_, limits_;
  deformable_ccd::ContactArray list_;  // each is made in the memory of the one before
};

}  // namespace dccd
