// The bag of results (analyze_bag -o): the input's messages with the results between them, as the node would have
// published them to subscribers of all topics.
#pragma once

#include <string>

#include <deformable_ccd/SpeedScale.h>

#include "apps/output_bag.h"
#include "node/bag_replay.h"
#include "output/diagnostics.h"

namespace dccd {

class ResultBag {
 public:
  /// `lent`: transforms that no message of the input has; they stand at its beginning. `intended_topic`: an input's,
  /// whatever its name. Throws rosbag::BagException when the file cannot be opened; the others as OutputBag.
  ResultBag(const std::string& path, tf2_msgs::TFMessage lent, std::string intended_topic);
  /// All but what a monitor said when the bag was recorded: that would stand beside the results, under their names.
  void copy(const rosbag::MessageInstance& m, const MonitorPipeline& pipeline, const BagReplaySummary& so_far);
  void add(const Outcome& outcome, MonitorPipeline& pipeline, const BagReplaySummary& so_far, const ros::Time& at);
  void addPrediction(const Outcome& prediction, const MonitorPipeline& pipeline, const ros::Time& at);
  /// Until when and how fast, and what is intended.
  void addAhead(const Outcome& outcome, MonitorPipeline& pipeline, const ros::Time& at);
  void close() { bag_.close(); }

 private:
  template <class Message>
  void write(const char* name, const ros::Time& at, const Message& message);
  bool copyOthersDiagnostics(const rosbag::MessageInstance& m);
  void addPlan(MonitorPipeline& pipeline, const ros::Time& at);
  void addPatches(const Outcome& outcome, const MonitorPipeline& pipeline, const ros::Time& at);
  void addState(const Outcome& outcome, const MonitorPipeline& pipeline, const ros::Time& at);

  OutputBag bag_;
  Diagnostics diagnostics_;
  tf2_msgs::TFMessage lent_;
  std::string intended_topic_;
  std::string map_source_;  // where the octomap is looked for; empty when none is expected
};

/// ~speed_scale of the last outcome at this time; only with `speed_scale`.
deformable_ccd::SpeedScale speedScaleAt(const Outcome& outcome, const MonitorPipeline& pipeline, const ros::Time& at);

}  // namespace dccd
