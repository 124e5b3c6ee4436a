#include "node/bag_replay.h"

#include <algorithm>
#include <iomanip>
#include <map>
#include <optional>
#include <set>
#include <sstream>

#include <rosbag/view.h>
#include <tf2/exceptions.h>

#include "input/message_bytes.h"
#include "input/message_type.h"
#include "input/short_text.h"
#include "input/transforms.h"
#include "node/bag_clouds.h"
#include "node/bag_pieces.h"
#include "octomap/coarser.h"
#include "output/output_messages.h"
#include "report/progress_bar.h"

namespace dccd {
namespace {

constexpr std::size_t MOST_NAMES = 6;

/// As the words of an error begin.
std::string bagsInWords(const std::vector<std::string>& paths) {
  return paths.front() + (paths.size() == 1 ? "" : " and " + std::to_string(paths.size() - 1) + " more");
}

/// As the node takes it: without a stamp of its own the map is of the time at which it came.
LoadedMap readMap(const rosbag::MessageInstance& message, const MonitorConfig& config, const MapMemory& memory,
                  MapOdds* odds = nullptr) {
  LoadedMap map;
  map.problem = mapMessageProblem(message.getDataType(), message.getMD5Sum(), message.size(), config);
  if (map.problem.empty()) map = decodeMapMessage(bytesOf(message), config, &memory, nullptr, odds);
  map.receipt_ns = receiptOf(message);
  if (map.stamp_ns == 0) map.stamp_ns = map.receipt_ns;
  return map;
}

}  // namespace

struct BagReplay::Run {
  const Sink& sink;
  const Sink& predictions;
  const Sink& anew;
  const Variation& variation;
  const std::string intended_topic;
  const OpenBags bags;
  TransformFeed feed{TransformWindow::length().toSec()};
  MonitorPipeline pipeline;
  const MapMemory memory{pipeline.config()};
  MapOdds odds;
  BagClouds clouds{pipeline.config(), feed, memory};
  std::optional<LookAheadScore> look_ahead;
  std::map<std::string, std::vector<std::size_t>> bodies_of_topic;  // several: parts of one message
  std::map<std::string, std::size_t> frames_of_topic;
  std::map<std::string, std::uint64_t> passed_over;  // messages that are of no body
  BagReplaySummary summary;
  std::set<std::string> complained, doubts;
  bool lacked_transform = false;
  std::vector<ros::Time> last_came;  // of each body, its last message; 0: none
  bool repeats_latched = false;      // as rosbag record --repeat-latched does at the begin of a piece

  Run(const BagReplay& r, const Sink& to, const Sink& predictions_to, const Sink& anew_to)
      : sink(to),
        predictions(predictions_to),
        anew(anew_to),
        variation(r.options_.variation),
        intended_topic(r.config_.intent ? bagTopic(r.options_.intended_topic) : ""),
        bags(r.paths_),
        pipeline(r.config_, feed),
        last_came(r.config_.bodies.size()) {
    pipeline.setTopologyFilter(variation.topology);
    if (r.config_.monitor.look_ahead_s > 0) look_ahead.emplace(r.config_.monitor.look_ahead_s);
    pipeline.effects().hearPredictions(look_ahead.has_value());
    for (std::size_t b = 0; b < r.config_.bodies.size(); ++b) {
      const std::string topic = r.config_.bodies[b].isRigid() ? "" : bagTopic(r.config_.bodies[b].topic);
      summary.mesh_topics.push_back(topic);
      if (!topic.empty()) {
        bodies_of_topic[topic].push_back(b);
      } else if (!pipeline.hint(b).empty()) {
        complain(sourceOf(b) + ": " + pipeline.hint(b));
      }
    }
    for (const std::string& sentence : r.config_.robot.missing) complain(sentence);
    for (const std::string& sentence : r.config_.robot.hints) complain("robot: " + sentence);
    if (!intended_topic.empty() && r.topics_.count(intended_topic) == 0)
      complain("the bag has nothing on " + intended_topic + ", to which intent listens");
  }

  /// The prediction that follows from an answered outcome, whose statistics get its cost.
  std::optional<Outcome> predict(Outcome& outcome) {
    if (!look_ahead) return std::nullopt;
    look_ahead->observe(outcome);
    if (!outcome.answered) return std::nullopt;
    std::optional<Outcome> prediction = pipeline.monitor().predict();
    look_ahead->predict(*prediction);
    outcome.stats[Effect::LOOK_AHEAD] = lookAheadStats(*prediction);
    return prediction;
  }

  /// The body's topic, or of one that tf carries its name.
  std::string sourceOf(std::size_t body) const {
    const std::string& topic = summary.mesh_topics[body];
    return topic.empty() ? "body '" + pipeline.config().bodies[body].body.name + "'" : topic;
  }

  void complain(const std::string& text) {
    if (complained.insert(text).second) summary.problems.push_back(text);
  }

  void setMap(LoadedMap map, std::int64_t now_ns) {
    ++summary.maps;
    map.arrival_ns = now_ns;
    summary.points_no_measurement = clouds.counters().no_measurement;
    if (map.surface && variation.voxels > 1) map.surface = coarser(*map.surface, variation.voxels);
    if (!map.surface) {
      ++summary.maps_refused;
      complain((pipeline.config().takesClouds() ? "cloud refused: " : "octomap refused: ") + map.problem);
      map.problem = whyRefused(map.problem, pipeline.config());
    }
    pipeline.setMap(std::move(map), now_ns);
  }

  void mapMessage(const rosbag::MessageInstance& message) {
    const MonitorConfig& config = pipeline.config();
    if (config.takesClouds()) {
      const std::string problem = mapMessageProblem(message.getDataType(), message.getMD5Sum(), message.size(), config);
      if (problem.empty()) return pipeline.hearMap(message.getTopic(), clouds.hold(message), message.getCallerId());
      clouds.refuse(message, problem);
    }
    pipeline.hearMap(message.getTopic(), "", message.getCallerId());
    setMap(readMap(message, config, memory, &odds), static_cast<std::int64_t>(message.getTime().toNSec()));
  }

  void cameraInfo(const rosbag::MessageInstance& message) {
    std::optional<LoadedMap> map = clouds.hearCameraInfo(message);
    if (map) setMap(std::move(*map), static_cast<std::int64_t>(message.getTime().toNSec()));
  }

  /// They are known from the start: a picture may come before its own.
  void hearFirstCameraInfos() {
    for (const std::string& topic : clouds.infoTopics()) {
      OpenBags::View infos(bags, {topic});
      if (infos.size() > 0) clouds.hearCameraInfo(*infos.begin());
    }
  }

  void placeCloud(const ros::Time& at) {
    for (LoadedMap& map : clouds.take(pipeline.fixedFrame())) {
      setMap(std::move(map), static_cast<std::int64_t>(at.toNSec()));
    }
  }

  void drain(const ros::Time& at) {
    Outcome outcome;
    while (pipeline.nextOutcome(static_cast<std::int64_t>(at.toNSec()), outcome)) {
      const std::optional<Outcome> prediction = predict(outcome);
      if (summary.first_broken.empty()) summary.first_broken = pipeline.promises().broken();
      const SafeUntil& promise = pipeline.promises().promise();
      if (promise.isPromise()) summary.promised_s.push_back(promise.seconds());
      lacked_transform = lacked_transform || outcome.reason.find("no transform") != std::string::npos;
      for (const std::string& doubt : pipeline.statement().doubts) {
        if (doubts.insert(doubt).second) summary.doubts.push_back(doubt);
      }
      sink(outcome, pipeline, summary, at);
      if (look_ahead && predictions) predictions(prediction ? *prediction : outcome, pipeline, summary, at);
    }
    for (std::size_t b = 0; b < summary.mesh_topics.size(); ++b) {
      const std::string problem = pipeline.takeProblem(b);
      if (!problem.empty()) complain(sourceOf(b) + ": " + problem);
    }
    const std::string hint = pipeline.takeMapHint();
    if (!hint.empty()) complain(hint);
    complainOfIntended(pipeline.takeIntendedProblem());
  }

  void complainOfIntended(const std::string& problem) {
    const bool is_told = problem.empty() || !complained.insert("intended " + IntendedMotion::kindOf(problem)).second;
    if (!is_told) complain(intended_topic + ": " + problem);
  }

  /// It counts at once.
  void intended(const rosbag::MessageInstance& message) {
    drain(message.getTime());
    try {
      complainOfIntended(pipeline.intention(message)());
    } catch (const std::exception& error) {
      complainOfIntended(std::string("a message was lost: ") + error.what());
    }
    const Outcome* const outcome = pipeline.reconsider();
    if (outcome && anew) anew(*outcome, pipeline, summary, message.getTime());
    complainOfIntended(pipeline.takeIntendedProblem());
  }

  void mesh(std::size_t body, const rosbag::MessageInstance& message, std::vector<std::uint8_t> bytes) {
    const ros::Time at = message.getTime();
    const std::int64_t now_ns = static_cast<std::int64_t>(at.toNSec());
    ++summary.mesh_messages;
    drain(at);  // what waited for other bodies until now gives up first
    const bool is_known = meshTypeProblem(message.getDataType(), message.getMD5Sum()).empty();
    MeshMessage one{message.getDataType(),
                    std::move(bytes),
                    now_ns,
                    now_ns,
                    message.getMD5Sum(),
                    is_known ? "" : message.getMessageDefinition()};
    one.sender = message.getCallerId();
    pipeline.take(body, one);
    if (!pipeline.hint(body).empty()) complain(summary.mesh_topics[body] + ": " + pipeline.hint(body));
    drain(at);
  }

  void meshes(const std::vector<std::size_t>& bodies, const rosbag::MessageInstance& message,
              const std::vector<std::uint8_t>& bytes) {
    bool is_of_none = true;
    for (const std::size_t body : bodies) {
      const std::uint64_t before = pipeline.passedOver(body);
      mesh(body, message, bytes);
      const bool is_other = pipeline.passedOver(body) > before;
      if (!is_other) last_came[body] = message.getTime();
      is_of_none = is_of_none && is_other;
    }
    if (is_of_none) ++passed_over[message.getTopic()];
  }

  /// How long a body moved on after the last frame of the clock body came [s]. One that tf carries: by the stamp of the
  /// newest transform, but not beyond the bag's end.
  double movesOn(std::size_t body, const ros::Time& end) const {
    const std::size_t clock = pipeline.config().monitor.clock_body;
    if (body == clock || pipeline.isStatic(body)) return 0;
    const BodyConfig& config = pipeline.config().bodies[body];
    if (!config.isRigid()) return (last_came[body] - last_came[clock]).toSec();
    const std::optional<StampNs> newest_ns = feed.newestStamp(pipeline.fixedFrame(), config.tf_frame);
    if (!newest_ns) return 0;  // the frames say what is missing
    return (std::min(toRosTime(*newest_ns), end) - last_came[clock]).toSec();
  }

  /// Of that time nothing is looked at: steps are those of the clock body. It counts where a pause between two frames
  /// would be a gap.
  void tellUnansweredEnd(const ros::Time& end) {
    const std::size_t clock = pipeline.config().monitor.clock_body;
    double most_s = 0;
    std::size_t longest = clock;
    for (std::size_t b = 0; b < last_came.size() && !last_came[clock].isZero(); ++b) {
      if (const double s = movesOn(b, end); s > most_s) {
        most_s = s;
        longest = b;
      }
    }
    if (!(most_s > pipeline.config().monitor.store.max_step_s)) return;
    std::ostringstream text;
    text << std::fixed << std::setprecision(3) << "the frames of body '" << pipeline.config().bodies[clock].body.name
         << "', each of which ends a step, end " << most_s << " s before those of body '"
         << pipeline.config().bodies[longest].body.name << "': nothing of that time was looked at";
    summary.unanswered_end = text.str();
  }
};

BagReplay::BagReplay(std::vector<std::string> bags, MonitorConfig config, BagReplayOptions options)
    : paths_(std::move(bags)), config_(std::move(config)), options_(std::move(options)) {
  // A frame whose transform the bag does not hold within the window will not get it: there is nothing to wait for.
  config_.transform_timeout_s = 0;
  if (!options_.octomap_file.empty()) {
    config_.octomap_file = options_.octomap_file;
    config_.octomap_topic_named = config_.cloud_named = false;
  }
  const OpenBags files(paths_);
  paths_ = files.paths();
  if (!options_.tf_static_file.empty()) lent_ = staticsOf(options_.tf_static_file);
  OpenBags::View view(files);
  for (const rosbag::ConnectionInfo* c : view.getConnections()) {
    const bool is_new = topics_.emplace(c->topic, c->datatype).second;
    if (is_new && mapTypeProblem(c->datatype, c->md5sum).empty()) map_topics_.push_back(c->topic);
  }
  chooseMapTopic();
  bool found = false, named = false;
  std::vector<std::string> wanted, there;
  std::string refused;
  for (const rosbag::ConnectionInfo* c : view.getConnections()) {
    if (!findMeshType(c->datatype)) continue;
    const std::string problem = meshTypeProblem(c->datatype, c->md5sum, c->msg_def);
    if (!problem.empty()) refused += "; " + c->topic + ": " + problem;
  }
  for (const BodyConfig& body : config_.bodies) {
    if (body.isRigid()) continue;
    found |= topics_.count(bagTopic(body.topic)) > 0;
    named |= body.topic_named || config_.bodies.size() > 1;
    wanted.push_back(bagTopic(body.topic));
  }
  for (const auto& [topic, type] : topics_) there.push_back(topic + " (" + type + ")");
  if (!found) {
    const auto isMesh = [](const auto& topic) { return findMeshType(topic.second) != nullptr; };
    const bool has_others_alone = !there.empty() && std::none_of(topics_.begin(), topics_.end(), isMesh);
    throw std::runtime_error(
        bagsInWords(paths_) + (named ? ": no topic " + listOf(wanted) : ": no topic of a mesh type") +
        "; the bag has " + (there.empty() ? "no messages" : listOf(there)) + refused +
        (has_others_alone ? "; points in messages of another type are to be published again in one "
                            "of a mesh type: doc/messages.md, \"Messages of another type\", has "
                            "the lines"
                          : ""));
  }
  std::vector<std::string> meshes;
  for (const auto& [topic, type] : topics_) {
    if (findMeshType(type)) meshes.push_back(topic);
  }
  pauses_ = pausesOfOneRun(files, meshes);
}

void BagReplay::chooseMapTopic() {
  for (CloudSource& source : config_.clouds) source.topic = bagTopic(source.topic);
  config_.octomap_topic = bagTopic(config_.octomap_topic);
  const bool there = std::find(map_topics_.begin(), map_topics_.end(), config_.octomap_topic) != map_topics_.end();
  if (!config_.octomap_topic_named && !there && !map_topics_.empty()) config_.octomap_topic = map_topics_.front();
}

std::string BagReplay::mapSource() const {
  if (config_.takesMapFileAlone() || config_.cloud_named) return config_.mapName() + " (named)";
  if (config_.octomap_topic_named) return config_.octomap_topic + " (named)";
  if (config_.octomap_topic == bagTopic(DEFAULT_OCTOMAP_TOPIC)) return config_.octomap_topic + " (default)";
  return config_.octomap_topic + " (the first of the bag; nobody named one)";
}

std::string BagReplay::unheardMaps() const {
  std::vector<std::string> unheard;
  for (const std::string& topic : map_topics_) {
    if (topic != config_.octomap_topic) unheard.push_back(topic);
  }
  // A file was given to be taken instead, or clouds.
  if (unheard.empty() || config_.takesMapFileAlone() || config_.cloud_named) return "";
  return "nobody listens to the octomaps on " + listOf(unheard) + "; octomap_topic is " + config_.octomap_topic;
}

std::string BagReplay::missingMap(const BagReplaySummary& summary) const {
  if (summary.maps > summary.maps_refused) return "";
  const bool is_file = config_.takesMapFileAlone();
  if (config_.takesClouds()) {
    return summary.maps > 0 ? "no cloud on " + config_.mapName() + " could be used"
                            : "the bag has no cloud on " + config_.mapName() + ", which is to make the map";
  }
  if (summary.maps > 0) {
    return (is_file ? "the octomap of " + config_.octomap_file : "no octomap on " + config_.octomap_topic) +
           (is_file ? " could not be used" : " could be used");
  }
  return "the bag has no octomap on " + config_.octomap_topic + ", which " +
         (config_.octomap_topic_named ? "octomap_topic names" : "effects/octomap calls for") + "; it has " +
         (map_topics_.empty() ? "none" : "them on " + listOf(map_topics_));
}

/// That no step had a map, where that is so.
std::string BagReplay::unusedMap(const BagReplaySummary& summary, bool may_use_map) const {
  const std::string nothing = "nothing was checked against a map: ";
  if (!may_use_map) return nothing + "effects/octomap is off";
  const std::string missing = missingMap(summary);
  if (missing.empty()) return "";
  return nothing + (map_topics_.empty() && !config_.namesOctomap() ? "the bag has none" : missing);
}

/// Topics that could be bodies and are none.
std::string BagReplay::unheardMeshes(const BagReplaySummary& summary) const {
  std::set<std::string> heard(summary.mesh_topics.begin(), summary.mesh_topics.end());
  for (const std::string& topic : config_.liveMapNames()) heard.insert(topic);
  std::vector<std::string> unheard;
  for (const auto& [topic, type] : topics_) {
    if (heard.count(topic) == 0 && findMeshType(type) && !isMonitorsMarkers(topic, topics_)) unheard.push_back(topic);
  }
  if (unheard.empty()) return "";
  const std::size_t more = unheard.size() - std::min(unheard.size(), MOST_NAMES);
  unheard.resize(unheard.size() - more);
  return "nothing was checked against what is on " + listOf(unheard) +
         (more > 0 ? " and " + std::to_string(more) + " more" : "");
}

std::string BagReplay::firstMeshTopic(const std::vector<std::string>& bags, const std::vector<std::string>& clouds) {
  const OpenBags files(bags);
  OpenBags::View view(files);
  std::map<std::string, std::string> types;
  for (const rosbag::ConnectionInfo* c : view.getConnections()) types[c->topic] = c->datatype;
  for (const rosbag::ConnectionInfo* c : view.getConnections()) {
    const auto isTopic = [&](const std::string& cloud) { return bagTopic(cloud) == c->topic; };
    if (std::any_of(clouds.begin(), clouds.end(), isTopic) || isMonitorsMarkers(c->topic, types)) continue;
    if (meshTypeProblem(c->datatype, c->md5sum, c->msg_def).empty()) return c->topic;
  }
  return "";
}

/// What the run lacked, and so did not look at.
void BagReplay::tellMissing(Run& run) const {
  const bool may_use_map = run.pipeline.effects().mayUseMap();
  if (may_use_map && !unheardMaps().empty()) run.complain(unheardMaps());
  if (run.pipeline.effects().mapExpected()) {
    const std::string missing = missingMap(run.summary);
    if (!missing.empty()) run.complain(missing);
  }
  if (run.lacked_transform && topics_.count("/tf") + topics_.count("/tf_static") == 0) {
    run.complain(
        "the bag has neither /tf nor /tf_static; record them with the meshes, or set fixed_frame to the frame "
        "that the messages name");
  }
  for (std::size_t b = 0; b < run.summary.mesh_topics.size(); ++b) {
    const std::string only = run.pipeline.onlyPassedOver(b);
    if (!only.empty()) run.complain(run.sourceOf(b) + ": " + only);
  }
  for (const auto& [topic, count] : run.passed_over) {
    run.summary.not_looked_at.push_back(std::to_string(count) + " messages of other markers on " + topic +
                                        " were passed over");
  }
  const std::string unused = unusedMap(run.summary, may_use_map);
  for (const std::string& sentence : {unused, unheardMeshes(run.summary)}) {
    if (!sentence.empty()) run.summary.not_looked_at.push_back(sentence);
  }
  const bool lacks_something = run.lacked_transform || (!unused.empty() && may_use_map);
  const auto missing_pieces =
      run.repeats_latched && !lacks_something ? std::vector<std::string>() : missingPieces(paths_, lacks_something);
  for (const auto& sentences : {missing_pieces, pauses_}) {
    run.summary.not_looked_at.insert(run.summary.not_looked_at.end(), sentences.begin(), sentences.end());
  }
}

BagReplaySummary BagReplay::run(const Sink& sink, const MessageSink& messages, const Sink& predictions,
                                const Sink& anew) {
  Run run(*this, sink, predictions, anew);
  const std::vector<std::string> map_topics = config_.liveMapNames();
  const bool may_use_map = run.pipeline.effects().mayUseMap();
  const bool bag_maps = !config_.takesMapFileAlone() && may_use_map;
  run.summary.map_source = may_use_map ? mapSource() : "off";
  OpenBags::View all(run.bags);
  if (all.size() == 0) return run.summary;
  run.repeats_latched = all.begin()->isLatching();
  run.summary.duration_s = (all.getEndTime() - all.getBeginTime()).toSec();
  if (!config_.octomap_file.empty() && may_use_map) {
    run.setMap(loadMapFile(config_.octomap_file, config_, &run.memory), 0);
  }

  OpenBags::View maps(run.bags, map_topics);
  bool first_is_taken = false;
  if (bag_maps && !config_.takesClouds() && maps.size() > 0) {
    const rosbag::View::iterator at_first = maps.begin();  // owns the message that it refers to
    run.setMap(readMap(*at_first, config_, run.memory), static_cast<std::int64_t>(all.getBeginTime().toNSec()));
    first_is_taken = true;
  }
  run.hearFirstCameraInfos();

  TransformWindow transforms(run.bags, run.feed, lent_);
  ProgressBar progress(bagsInWords(paths_), all.size(), options_.show_progress);
  ros::Time at = all.getBeginTime();
  for (const rosbag::MessageInstance& m : all) {
    at = m.getTime();
    if (messages) messages(m, run.pipeline, run.summary);
    const auto bodies = run.bodies_of_topic.find(m.getTopic());
    const bool is_mesh = bodies != run.bodies_of_topic.end() &&
                         run.frames_of_topic[m.getTopic()]++ % options_.variation.every_nth_frame == 0;
    std::vector<std::uint8_t> bytes;
    if (is_mesh) {
      bytes = bytesOf(m);
      for (const std::size_t body : bodies->second) transforms.meshComes(body, stampOf(m.getDataType(), bytes), at);
    }
    transforms.feedUntil(at);
    run.pipeline.doubtTransforms(transforms.isBehind(at)
                                     ? "stamps of tf went back before this frame, and those of the meshes have not yet"
                                     : "");
    for (const std::string& line : run.feed.takeProblems()) run.complain("tf: " + line);
    if (is_mesh) run.meshes(bodies->second, m, bytes);
    run.cameraInfo(m);
    if (m.getTopic() == run.intended_topic) run.intended(m);
    const bool is_map = bag_maps && std::count(map_topics.begin(), map_topics.end(), m.getTopic()) > 0;
    if (is_map && !std::exchange(first_is_taken, false)) run.mapMessage(m);
    run.placeCloud(at);
    progress.advance();
  }
  run.pipeline.finish();
  run.drain(at);
  run.tellUnansweredEnd(at);
  tellMissing(run);
  run.summary.frames = run.pipeline.monitor().total();
  run.summary.fixed_frame = run.pipeline.fixedFrame();
  run.summary.effects = run.pipeline.effects().plan();
  run.summary.promises = run.pipeline.promises().counts();
  if (run.look_ahead) run.summary.look_ahead = run.look_ahead->summary();
  return run.summary;
}

}  // namespace dccd
