// A bag, or the pieces of one, through the monitor without a master: the same pipeline as the node's, driven by the
// bag's clock, nothing dropped.
#pragma once

#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <ros/time.h>
#include <rosbag/bag.h>

#include "input/known_types.h"
#include "node/bag_reading.h"
#include "node/map_loader.h"
#include "node/monitor_pipeline.h"
#include "report/look_ahead_score.h"

namespace dccd {

/// A bag replayed as if less had been recorded.
struct Variation {
  std::size_t every_nth_frame = 1;  ///< of each mesh topic, from the first one on
  std::size_t voxels = 1;           ///< the map's are this many times as large: a power of two
  TopologyFilter topology;          ///< null: as it came
};

struct BagReplayOptions {
  std::string octomap_file;    ///< instead of the bag's maps; empty: none
  std::string tf_static_file;  ///< a bag whose /tf_static holds for frames that have none in this one; empty: none
  std::string intended_topic = std::string(MONITOR_NAMESPACE) + "/intended";  ///< the bag's ~intended
  bool show_progress = false;
  Variation variation;
};

/// What a replay met besides outcomes.
struct BagReplaySummary {
  std::vector<std::string> mesh_topics;  ///< one per body; empty for rigid ones
  std::uint64_t mesh_messages = 0, maps = 0, maps_refused = 0, points_no_measurement = 0;
  std::string fixed_frame;            ///< at the end
  std::string map_source;             ///< its topic or file, and who named it, in words
  std::vector<std::string> problems;  ///< refused messages, each kind once; maps that are missing or not listened to
  std::vector<std::string> not_looked_at;  ///< a map that is not there, meshes that nobody listens to: a sentence each
  std::vector<std::string> doubts;         ///< MonitorPipeline::doubts(), each once
  std::string unanswered_end;              ///< that other bodies moved on where no frame came any more; empty: none did
  FrameCounters frames;
  EffectPlan effects;                          ///< at the end
  std::optional<LookAheadSummary> look_ahead;  ///< where look_ahead_s is above 0
  PromiseCounts promises;                      ///< of safe_until
  std::vector<double> promised_s;              ///< for how long, of each
  std::string first_broken;                    ///< why the first that was void was so; empty: there is none
  double duration_s = 0;
};

class BagReplay {
 public:
  /// Called for each outcome, in order; `at` is the bag time of the message that led to it, `so_far` counts messages up
  /// to that one.
  using Sink =
      std::function<void(const Outcome&, MonitorPipeline&, const BagReplaySummary& so_far, const ros::Time& at)>;
  /// Called for each message of the bag, in order, before its outcomes.
  using MessageSink =
      std::function<void(const rosbag::MessageInstance&, const MonitorPipeline&, const BagReplaySummary& so_far)>;

  /// Where nobody names a topic for the map, and the default one is not in the bag, the bag's first one is taken.
  /// `bags`: one, or the pieces of one. Throws rosbag::BagException when one cannot be read, std::runtime_error when no
  /// body has a topic in them, or where they are not of one run.
  BagReplay(std::vector<std::string> bags, MonitorConfig config, BagReplayOptions options);

  /// The first topic of the bag that carries meshes, is no monitor's own and none of `clouds`, for configurations
  /// that name none. Empty: none.
  static std::string firstMeshTopic(const std::vector<std::string>& bags, const std::vector<std::string>& clouds);
  /// What tf_static_file says.
  const tf2_msgs::TFMessage& lentTransforms() const { return lent_; }

  /// Tf is fed ahead of the messages by a window, so that no frame waits for a transform that the bag holds, but not
  /// across a loop's end before the meshes have come to it, too; a map that
  /// was recorded after the first frame (latched ones are, often) is known from the start.
  /// `predictions` gets, where there is a look-ahead, that of each step after the step itself; of a step without an
  /// answer the step again. `anew` gets the newest answer where something else is intended since then.
  BagReplaySummary run(const Sink& sink, const MessageSink& messages = nullptr, const Sink& predictions = nullptr,
                       const Sink& anew = nullptr);

 private:
  struct Run;
  std::vector<std::string> paths_;
  MonitorConfig config_;
  BagReplayOptions options_;
  tf2_msgs::TFMessage lent_;
  std::vector<std::string> pauses_;            // between bags, a sentence each
  std::vector<std::string> map_topics_;        // of the bag
  std::map<std::string, std::string> topics_;  // of the bag, with their types

  void chooseMapTopic();
  std::string mapSource() const;
  std::string unheardMaps() const;
  std::string missingMap(const BagReplaySummary& summary) const;
  std::string unusedMap(const BagReplaySummary& summary, bool may_use_map) const;
  std::string unheardMeshes(const BagReplaySummary& summary) const;
  void tellMissing(Run& run) const;
};

}  // namespace dccd
