#include "ros/output_messages.h"

#include "ros/bag_replay.h"

#include <algorithm>
#include <cstdio>
#include <map>
#include <optional>
#include <set>

#include <rosbag/view.h>
#include <tf2_msgs/TFMessage.h>

#include "ros/effects.h"
#include "ros/known_types.h"
#include "ros/transforms.h"

namespace deformable_ccd {
namespace {

// Transforms are fed this far ahead of the meshes and kept this long behind them; so a long bag needs no more memory.
const ros::Duration TF_AHEAD(10.0);
const ros::Duration TF_KEPT(60.0);

std::string absolute(const std::string& topic) { return topic.empty() || topic[0] == '/' ? topic : "/" + topic; }

LoadedMap refusedMap(const std::string& problem) {
  LoadedMap map;
  map.problem = problem;
  return map;
}

std::vector<std::uint8_t> bytesOf(const rosbag::MessageInstance& message) {
  std::vector<std::uint8_t> bytes(message.size());
  ros::serialization::OStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  message.write(stream);
  return bytes;
}

class Progress {
 public:
  Progress(bool show, std::uint64_t total) : show_(show), total_(std::max<std::uint64_t>(total, 1)) {}
  void step(std::uint64_t done) {
    const int percent = static_cast<int>(100 * done / total_);
    if (!show_ || percent == last_) return;
    last_ = percent;
    std::fprintf(stderr, "\r[%-50s] %3d %%", std::string(static_cast<std::size_t>(percent / 2), '#').c_str(), percent);
    if (percent == 100) std::fputc('\n', stderr);
  }

 private:
  bool show_;
  std::uint64_t total_;
  int last_ = -1;
};

}  // namespace

struct BagReplay::Run {
  const Sink& sink;
  const Sink& predictions;
  rosbag::Bag bag;
  tf2::BufferCore transforms{TF_KEPT + TF_AHEAD};
  TransformFeed feed{transforms};
  MonitorPipeline pipeline;
  EffectTracker effects;
  std::optional<LookAheadScore> look_ahead;
  std::map<std::string, std::size_t> body_of_topic;
  BagReplaySummary summary;
  std::set<std::string> complained;

  Run(const BagReplay& r, const Sink& to, const Sink& predictions_to)
      : sink(to), predictions(predictions_to), bag(r.path_), pipeline(r.config_, transforms), effects(r.config_) {
    if (r.config_.monitor.look_ahead_s > 0) look_ahead.emplace(r.config_.monitor.look_ahead_s);
    for (std::size_t b = 0; b < r.config_.bodies.size(); ++b) {
      const std::string topic = r.config_.bodies[b].isRigid() ? "" : absolute(r.config_.bodies[b].topic);
      summary.mesh_topics.push_back(topic);
      if (!topic.empty()) body_of_topic[topic] = b;
    }
  }

  /// The prediction that follows from an answered outcome, whose statistics get its cost.
  std::optional<StepOutcome> predict(StepOutcome& outcome) {
    if (!look_ahead) return std::nullopt;
    look_ahead->observe(outcome);
    if (!outcome.answered) return std::nullopt;
    std::optional<StepOutcome> prediction = pipeline.monitor().predict();
    look_ahead->predict(*prediction);
    outcome.stats[Effect::LOOK_AHEAD] = lookAheadStats(*prediction);
    return prediction;
  }

  void complain(const std::string& text) {
    if (complained.insert(text).second) summary.complaints.push_back(text);
  }

  void setMap(LoadedMap map, std::int64_t now_ns) {
    ++summary.maps;
    if (!map.surface) {
      ++summary.maps_refused;
      complain("octomap refused: " + map.problem);
      map.problem = "the octomap was refused: " + map.problem;
    }
    pipeline.setMap(std::move(map), now_ns);
  }

  void drain(const ros::Time& at) {
    StepOutcome outcome;
    while (pipeline.next(static_cast<std::int64_t>(at.toNSec()), outcome)) {
      effects.learn(outcome, pipeline.monitor());
      const std::optional<StepOutcome> prediction = predict(outcome);
      sink(outcome, pipeline, at);
      if (prediction && predictions) predictions(*prediction, pipeline, at);
      effects.apply(pipeline.monitor(), summary.maps > 0);
    }
    for (std::size_t b = 0; b < summary.mesh_topics.size(); ++b) {
      const std::string complaint = pipeline.takeComplaint(b);
      if (!complaint.empty()) complain(summary.mesh_topics[b] + ": " + complaint);
    }
  }

  void mesh(std::size_t body, const rosbag::MessageInstance& message) {
    const ros::Time at = message.getTime();
    const std::int64_t now_ns = static_cast<std::int64_t>(at.toNSec());
    ++summary.mesh_messages;
    const std::string problem = meshTypeProblem(message.getDataType(), message.getMD5Sum());
    // Nothing is dropped: a frame that still waits gives up before the next one is taken.
    drain(at);
    if (!pipeline.idle(body)) {
      pipeline.refuse(body, now_ns, now_ns, "the frame before it still waited for its transform");
    } else if (!problem.empty()) {
      pipeline.refuse(body, now_ns, now_ns, problem);
    } else {
      pipeline.take(body, {message.getDataType(), bytesOf(message), now_ns, now_ns});
    }
    if (!pipeline.hint(body).empty()) complain(summary.mesh_topics[body] + ": " + pipeline.hint(body));
    drain(at);
  }
};

BagReplay::BagReplay(const std::string& bag, MonitorConfig config, BagReplayOptions options)
    : path_(bag), config_(std::move(config)), options_(std::move(options)) {
  // A frame whose transform the bag does not hold within the window will not get it: there is nothing to wait for.
  config_.transform_timeout_s = 0;
  if (!options_.octomap_file.empty()) config_.octomap_file = options_.octomap_file;
  rosbag::Bag file(path_);
  rosbag::View view(file);
  std::set<std::string> topics;
  for (const rosbag::ConnectionInfo* c : view.getConnections()) topics.insert(c->topic);
  bool found = false;
  std::string wanted, present;
  for (const BodyConfig& body : config_.bodies) {
    if (body.isRigid()) continue;
    found |= topics.count(absolute(body.topic)) > 0;
    wanted += (wanted.empty() ? "" : ", ") + absolute(body.topic);
  }
  for (const std::string& t : topics) present += (present.empty() ? "" : ", ") + t;
  if (!found) {
    throw std::runtime_error(path_ + ": no topic " + wanted + "; the bag has " +
                             (present.empty() ? "no messages" : present));
  }
}

BagReplay::~BagReplay() = default;

std::string BagReplay::firstMeshTopic(const std::string& bag) {
  rosbag::Bag file(bag);
  rosbag::View view(file);
  for (const rosbag::ConnectionInfo* c : view.getConnections()) {
    if (meshTypeProblem(c->datatype, c->md5sum).empty()) return c->topic;
  }
  return "";
}

std::string BagReplay::firstMapTopic(const std::string& bag) {
  rosbag::Bag file(bag);
  rosbag::View view(file);
  for (const rosbag::ConnectionInfo* c : view.getConnections()) {
    if (mapTypeProblem(c->datatype, c->md5sum).empty()) return c->topic;
  }
  return "";
}

BagReplaySummary BagReplay::run(const Sink& sink, const MessageSink& messages, const Sink& predictions) {
  Run run(*this, sink, predictions);
  const std::string map_topic = absolute(config_.octomap_topic);
  const bool bag_maps = config_.octomap_file.empty() && run.effects.mayUseMap();

  rosbag::View all(run.bag);
  if (all.size() == 0) return run.summary;
  run.summary.duration_s = (all.getEndTime() - all.getBeginTime()).toSec();
  if (!config_.octomap_file.empty() && run.effects.mayUseMap()) {
    run.setMap(loadMapFile(config_.octomap_file, config_), 0);
  }

  rosbag::View maps(run.bag, rosbag::TopicQuery(map_topic));
  ros::Time first_map;
  if (bag_maps && maps.size() > 0) {
    const rosbag::View::iterator at_first = maps.begin();  // owns the message that it refers to
    const rosbag::MessageInstance& first = *at_first;
    first_map = first.getTime();
    const std::string problem = mapTypeProblem(first.getDataType(), first.getMD5Sum());
    run.setMap(problem.empty() ? decodeMapMessage(bytesOf(first), config_) : refusedMap(problem),
               static_cast<std::int64_t>(all.getBeginTime().toNSec()));
  }
  run.effects.apply(run.pipeline.monitor(), run.summary.maps > 0);

  rosbag::View tf_view(run.bag, rosbag::TopicQuery(std::vector<std::string>{"/tf", "/tf_static"}));
  rosbag::View static_view(run.bag, rosbag::TopicQuery("/tf_static"));
  for (const rosbag::MessageInstance& m : static_view) {
    if (const auto tf = m.instantiate<tf2_msgs::TFMessage>()) run.feed.add(*tf, true);
  }
  auto next_tf = tf_view.begin();
  Progress progress(options_.show_progress, all.size());
  std::uint64_t done = 0;
  ros::Time at = all.getBeginTime();
  for (const rosbag::MessageInstance& m : all) {
    at = m.getTime();
    for (; next_tf != tf_view.end() && next_tf->getTime() <= at + TF_AHEAD; ++next_tf) {
      if (const auto tf = next_tf->instantiate<tf2_msgs::TFMessage>()) {
        run.feed.add(*tf, next_tf->getTopic() == "/tf_static");
      }
      ++run.summary.transforms;
    }
    if (messages) messages(m);
    const auto body = run.body_of_topic.find(m.getTopic());
    if (body != run.body_of_topic.end()) {
      run.mesh(body->second, m);
    } else if (bag_maps && m.getTopic() == map_topic && at > first_map) {
      const std::string problem = mapTypeProblem(m.getDataType(), m.getMD5Sum());
      run.setMap(problem.empty() ? decodeMapMessage(bytesOf(m), config_) : refusedMap(problem),
                 static_cast<std::int64_t>(at.toNSec()));
    }
    progress.step(++done);
  }
  run.pipeline.finish();
  run.drain(at);
  run.summary.frames = run.pipeline.monitor().total();
  run.summary.effects = run.effects.plan();
  run.summary.left_out = run.pipeline.monitor().leftOut();
  if (run.look_ahead) run.summary.look_ahead = run.look_ahead->summary();
  return run.summary;
}

}  // namespace deformable_ccd
