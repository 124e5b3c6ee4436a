// What the monitor of a cell answers of each step, beside what the step shows by itself: who sent what came, by whose
// clock, whether it was used, and whether it is still what the configuration named.
#include <algorithm>
#include <cmath>
#include <iomanip>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "input/short_text.h"
#include "input/transform_tracks.h"
#include "node/liveness.h"
#include "node/monitor_pipeline.h"

namespace dccd {
namespace {

// What is stamped later than it comes is stamped by another clock. Two that are kept alike by NTP differ by less; what
// they differ by is how far things are from where they are taken to be at one time.
constexpr double MOST_AHEAD_S = 0.25;
// Where the clock body's stamps are ahead, what is behind them by more than this was not late on its way alone.
constexpr double MOST_LATE_S = 1;

std::string timesOf(double lead_s) {
  std::ostringstream text;
  text << std::setprecision(3) << std::abs(lead_s) << (lead_s > 0 ? " s later" : " s earlier");
  return text.str();
}

/// So that a sentence that tells it does not become another one with each.
std::string roughly(std::uint64_t count) {
  if (count < 10) return std::to_string(count);
  std::uint64_t least = 10;
  while (count / least >= 10) least *= 10;
  return "at least " + std::to_string(least);
}

/// How far from the fixed frame's origin bodies are at most [m].
double reachOf(const Step& step) {
  double squared = 0;
  for (const Body& body : step.bodies) {
    for (const Positions* positions : {body.t0.get(), body.t1.get()}) {
      for (const Vec3& p : *positions) {
        if (p.allFinite()) squared = std::max(squared, p.squaredNorm());
      }
    }
  }
  return std::sqrt(squared);
}

}  // namespace

void MonitorPipeline::answerForCell(std::int64_t came_ns, std::int64_t now_ns, Outcome& outcome) {
  nameMissing(outcome);
  if (!outcome.answered) return;
  Claim& claim = outcome.claim;
  const ObstacleMap& map = outcome.step->map;
  claim.answer(Question::ROBOT, robotsProblems(*outcome.step));
  claim.answer(Question::NEWEST_MAP, newerMapProblem(came_ns, now_ns, map));
  claim.answer(Question::MAP_PLACE, mapPlaceProblem(*outcome.step));
  claim.answer(Question::TRANSFORMS, transformsProblems());
  // Frames that were on their way when something was let go show it held, and contacts before a phase are not of it.
  const bool is_of_before = !changed_.empty() && outcome.step->start_ns < changedAt(outcome.step->stamp_ns);
  claim.answer(Question::CALLS, is_of_before ? "after this step began " + changed_ : "");
  claim.answer(Question::FIXED_FRAME, learntFramesProblems(*outcome.step));
  answerForClocks(*outcome.step, claim);
  for (std::size_t b = 0; b < outcome.step->bodies.size(); ++b) {
    claim.answer(Question::SENDER, sendersProblem(b), b);
    claim.answer(Question::NUMBERING, numberingProblem(b), b);
  }
  nameMissedClouds(outcome);
  for (std::size_t b = 0; b < passed_over_.size(); ++b) {
    if (!passed_over_[b].may_be_things) continue;
    outcome.excluded.push_back("other markers on the topic of body '" + config_.bodies[b].body.name + "'");
  }
}

void MonitorPipeline::nameMissedClouds(Outcome& outcome) const {
  if (!outcome.step->map.surface) return;
  for (std::size_t source = 0; source < missed_clouds_.size(); ++source) {
    const MissedClouds& missed = missed_clouds_[source];
    const std::uint64_t before = source < missed_before_.size() ? missed_before_[source] : 0;
    if (missed.count == before) continue;
    const std::uint64_t count = missed.count - before;
    outcome.excluded.push_back(roughly(count) + (count == 1 ? " cloud" : " clouds") + " on " +
                               config_.clouds[source].topic + " that came " + (count == 1 ? "is" : "are") +
                               " not in the map (the newest: " + missed.newest + ")");
  }
}

void MonitorPipeline::nameMissing(Outcome& outcome) const {
  if (outcome.status != StepStatus::NO_BODY) return;
  for (std::size_t b = 0; b < waiting_.size(); ++b) {
    if (refused_[b].empty() && !(waiting_[b] && waiting_[b]->kept)) continue;
    outcome.reason = missing(b);
    return;
  }
}

std::string MonitorPipeline::newerMapProblem(std::int64_t came_ns, std::int64_t now_ns, const ObstacleMap& map) const {
  for (const auto& [topic, senders] : map_senders_) {
    if (map.surface && senders.in_turn) return senders.problem("maps on " + topic);
  }
  for (const UnplacedMap& one : unplaced_maps_) {
    if (!map.surface || one.map.arrival_ns > came_ns) continue;  // without a map NO_MAP says why
    return "an octomap that came before this frame has no place: no transform of its frame '" + one.map.frame_id +
           "' at " + secondsOf(one.map.stamp_ns) + "; raise transform_timeout_s to what tf lags behind";
  }
  // One that is stamped after the frames is in use once these reach its stamp, and it has its time for that.
  const std::optional<std::int64_t> since_ns = monitor_->mapWaitsSince();
  const bool is_long = since_ns && secondsBetween(*since_ns, now_ns) > config_.answer_timeout_s;
  return is_long ? waitsTooLong(config_.answer_timeout_s) : "";
}

/// Where all stamps are ahead alike, it is the clock here that is behind, and nothing is apart in time.
void MonitorPipeline::answerForClocks(const Step& step, Claim& claim) const {
  const std::optional<double> clock_s = sources_[config_.monitor.clock_body].lead.seconds();
  // What holds at all times may be old.
  const auto problem = [&](const std::string& name, const std::optional<double>& ahead_s,
                           bool may_be_old = false) -> std::string {
    if (!clock_s || !ahead_s) return "";  // none has said yet when it came
    const bool is_ahead = *ahead_s > MOST_AHEAD_S && *ahead_s - *clock_s > MOST_AHEAD_S;
    const bool is_behind = !may_be_old && *clock_s > MOST_AHEAD_S && *clock_s - *ahead_s > MOST_LATE_S;
    if (!is_ahead && !is_behind) return "";
    return "stamps of " + name + " are up to " + timesOf(*ahead_s) + " than they come, those of body '" +
           config_.bodies[config_.monitor.clock_body].body.name + "' " + timesOf(*clock_s) +
           ": clocks of two computers differ; synchronise them";
  };
  std::set<std::string> frames = monitor_->heldFrames();
  for (const std::optional<Rigid>& rigid : rigid_) {
    if (rigid && !rigid->isNone()) frames.insert(rigid->frame);
  }
  for (std::size_t b = 0; b < step.bodies.size(); ++b) {
    const bool is_sent = b < sources_.size(), is_stream = is_sent && !isStatic(b);
    if (is_stream && !sources_[b].frame.empty()) frames.insert(sources_[b].frame);
    const std::string name = "body '" + step.bodies[b].name + "'";
    claim.answer(Question::CLOCK, is_sent ? problem(name, sources_[b].lead.seconds(), !is_stream) : "", b);
  }
  claim.answer(Question::MAP_CLOCK,
               step.map.surface ? problem("maps on " + config_.mapName(), map_lead_.seconds()) : "");
  std::map<std::string, std::string> problems;  // by the frame that is ahead
  for (const std::string& frame : frames) {
    const std::optional<TransformFeed::Ahead> ahead = transforms_.mostAhead(fixed_frame_, frame);
    if (ahead) problems.emplace(ahead->frame, problem("the frame '" + ahead->frame + "'", ahead->seconds));
  }
  std::vector<std::string> sentences;
  for (const auto& one : problems) sentences.push_back(one.second);
  claim.answer(Question::TRANSFORM_CLOCKS, sentences);
}

/// Stamps that are far from the call are of another time, as in a bag that is played without its clock.
StampNs MonitorPipeline::changedAt(StampNs stamp_ns) const {
  constexpr double OTHER_TIME_S = 10;
  const double ahead_s = std::max(0.0, sources_[config_.monitor.clock_body].lead.seconds().value_or(0));
  const bool is_other_time =
      changed_ns_ == 0 || std::abs(secondsBetween(changed_ns_, stamp_ns)) > OTHER_TIME_S + ahead_s;
  return is_other_time ? newest_ns_ : changed_ns_ + std::llround(ahead_s * 1e9);
}

bool MonitorPipeline::hasLetGo() const {
  return std::any_of(attached_.begin(), attached_.end(), [](const auto& one) { return one && !one->held; });
}

std::set<std::string> MonitorPipeline::learntFramesInUse(const Step& step) const {
  std::set<std::string> frames;
  // The map of clouds stays in the frame that was learnt first.
  const bool is_learnt = step.map.frame_id == fixed_frame_ || (config_.takesClouds() && config_.octomap_frame.empty());
  if (step.map.surface && is_learnt) frames.insert(step.map.frame_id);
  if (trusted_map_ && (trusted_map_->frame_id.empty() || trusted_map_->frame_id == fixed_frame_)) {
    frames.insert(fixed_frame_);
  }
  for (const std::optional<DecodedMesh>& mesh : static_meshes_) {
    if (mesh && mesh->frame_id == fixed_frame_) frames.insert(fixed_frame_);
  }
  for (std::size_t i = 0; i < attached_.size(); ++i) {
    const std::optional<Rigid>& rigid = rigid_[config_.bodies.size() + i];
    if (attached_[i] && !attached_[i]->held && rigid->let_go_ns == Rigid::NEVER) frames.insert(rigid->frame);
  }
  return frames;
}

/// A frame that was learnt may be a camera's. One that has moved once is not at rest, and what is held in it has moved.
std::vector<std::string> MonitorPipeline::learntFramesProblems(const Step& step) {
  if (!config_.fixed_frame.empty()) return {};
  const std::set<std::string> in_use = learntFramesInUse(step);
  std::set<std::string> frames = in_use;
  frames.insert(fixed_frame_);  // it may have moved before something is held in it
  std::vector<std::string> problems;
  // Most cells name the frame, or have no tf.
  std::optional<double> reach_m;
  for (const std::string& frame : frames) {
    const std::string root = transforms_.rootOf(frame);
    if (root.empty() && !learnt_frames_.hasLookedAt(frame)) continue;  // tf has it in no other one
    if (!reach_m) reach_m = reachOf(step);
    const FramesAtRest::Word word = learnt_frames_.look(
        tracks_, frame, root, lookFrom(learnt_frames_, frame, step.start_ns), step.stamp_ns, *reach_m);
    if (in_use.count(frame) == 0) continue;
    const std::string name = "the fixed frame '" + frame + "' was learnt and ";
    const std::string cure = "; set fixed_frame to a frame at rest";
    if (word.moved_m > config_.monitor.detector.rigid_tolerance_m) {
      problems.push_back(name + "moves in '" + word.reference + "'" + cure);
    } else if (!word.unknown.empty()) {
      problems.push_back(name + "may move (" + word.unknown + ")" + cure);
    }
  }
  return problems;
}

/// What tf carries nobody else sends.
std::string MonitorPipeline::sendersProblem(std::size_t body) const {
  if (body >= sources_.size()) return "";
  return sources_[body].senders.problem("frames of body '" + config_.bodies[body].body.name + "'");
}

/// A camera may move: of its place the time of its newest cloud counts alone, and all that tf says of that, be it
/// later.
std::vector<std::string> MonitorPipeline::transformsProblems() {
  std::vector<std::string> problems{transforms_doubt_};
  for (std::size_t b = 0; b < seen_from_.size(); ++b) {
    if (!seen_from_[b] || seen_from_[b]->frame == fixed_frame_) continue;
    auto& [frame, stamp_ns, epoch, doubt] = *seen_from_[b];
    if (doubt.empty()) doubt = tracks_.doubtAt(fixed_frame_, frame, stamp_ns);
    if (doubt.empty()) doubt = transforms_.doubtNextTo(fixed_frame_, frame, stamp_ns);
    if (doubt.empty() && epoch != tracks_.epoch()) {
      doubt = "since then stamps of tf went back, or a static transform is another one";
    }
    if (doubt.empty()) continue;
    problems.push_back("where the camera's frame '" + frame + "' was at the stamp of the newest cloud of body '" +
                       config_.bodies[b].body.name + "' is not known until the next one (" + doubt + ")");
  }
  return problems;
}

/// Another number of vertices, corners or ropes numbers them anew, and so do corners that come apart: those that are
/// named by number are others then.
std::string MonitorPipeline::numberingProblem(std::size_t b) const {
  if (b >= sources_.size() || !sources_[b].is_renumbered) return "";
  const BodyConfig& body = config_.bodies[b];
  const auto namesVertices = [&](const Expectation& one) {
    return std::any_of(one.partners.begin(), one.partners.end(),
                       [&](const ExpectedPartner& partner) { return partner.body == b && !partner.vertices.empty(); });
  };
  const std::vector<Expectation>& expected = config_.monitor.detector.expected;
  const bool is_named = !body.body.vertex_mask.empty() || std::any_of(expected.begin(), expected.end(), namesVertices);
  if (!is_named) return "";
  return "vertices of body '" + body.body.name +
         "' have other numbers than in its first frame, and vertex_mask or expected_contacts names them by number; "
         "send a mesh with indices, the same ones each time; if the numbers fit the mesh of now, call ~reset";
}

/// Of the links and of what they hold, in the step's map.
std::size_t MonitorPipeline::robotsVoxels(const Step& step) {
  if (counted_voxels_ == step.map.own.voxels) return robots_voxels_;
  counted_voxels_ = step.map.own.voxels;
  const auto isRobots = [&](const OwnVoxel& voxel) {
    const bool is_attached = voxel.body >= config_.bodies.size();
    return !voxel.doubted && (is_attached || !config_.bodies[voxel.body].body.link.empty());
  };
  robots_voxels_ = 0;
  if (counted_voxels_) {
    robots_voxels_ =
        static_cast<std::size_t>(std::count_if(counted_voxels_->begin(), counted_voxels_->end(), isRobots));
  }
  return robots_voxels_;
}

/// Links that are not watched, another description, too many voxels of its own.
std::vector<std::string> MonitorPipeline::robotsProblems(const Step& step) {
  std::vector<std::string> problems;
  const std::size_t most = config_.robot_asked.max_own_voxels, own = most > 0 ? robotsVoxels(step) : 0;
  if (own > most) {
    problems.push_back(std::to_string(own) +
                       " voxels of the map are own of the robot and what it holds, and robot/max_own_voxels is " +
                       std::to_string(most) + "; see that its meshes, scale and transforms fit, or raise it");
  }
  for (const auto* sentences : {&config_.robot.missing, &robot_changed_}) {
    problems.insert(problems.end(), sentences->begin(), sentences->end());
  }
  return problems;
}

const std::vector<std::string>& MonitorPipeline::robotChanged(const std::vector<std::string>& parameters) {
  robot_changed_.clear();
  for (const std::string& name : parameters) {
    robot_changed_.push_back("parameter " + name +
                             " is another one than at the start; restart the monitor, which watches the robot of then");
  }
  if (!robot_changed_.empty()) voidWhatWasSaid(robot_changed_.front());
  return robot_changed_;
}

}  // namespace dccd
