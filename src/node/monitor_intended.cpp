// The pipeline's part for what is intended: what follows from it for the newest answer, and what would from another
// one.
#include <limits>
#include <sstream>
#include <tuple>

#include "node/monitor_pipeline.h"
#include "output/safe_until_messages.h"

namespace dccd {

std::vector<CarriedBody> MonitorPipeline::carriedBodies(const Step& step) const {
  std::vector<CarriedBody> carried;
  for (std::size_t b = 0; b < rigid_.size(); ++b) {
    if (!rigid_[b] || rigid_[b]->isNone() || rigid_[b]->frame == fixed_frame_ || rigid_[b]->let_go_ns != Rigid::NEVER)
      continue;
    CarriedBody& one = carried.emplace_back();
    one.body = static_cast<std::uint16_t>(b);
    one.frame = rigid_[b]->frame;
    one.frame_from_body = rigid_[b]->frame_from_mesh;
    for (const Vec3& p : rigid_[b]->reference) one.reach_m = std::max(one.reach_m, p.norm());
  }
  const std::vector<SpeedBound> bounds = speedBounds();
  for (std::size_t b = 0, rigid = carried.size(); b < step.bodies.size() && b < bounds.size(); ++b) {
    for (std::size_t c = 0; c < rigid; ++c) {
      if (carried[c].body != bounds[b].carrier) continue;
      CarriedBody one = carried[c];
      one.body = static_cast<std::uint16_t>(b);
      one.carrier = bounds[b].carrier;
      one.relative_m_s = bounds[b].relative_m_s;
      one.reach_m = 0;
      for (const Vec3& p : *step.bodies[b].t1)
        one.reach_m = std::max(one.reach_m, (step.bodies[one.carrier].pose_t1.inverse() * p).norm());
      carried.push_back(one);
    }
  }
  return carried;
}

IntendedMotion::Lookup MonitorPipeline::places() {
  return [this](const std::string& frame, StampNs stamp_ns) -> std::optional<Eigen::Isometry3d> {
    Eigen::Isometry3d fixed_from_frame = Eigen::Isometry3d::Identity();
    std::string reason;
    if (!transforms_.lookup(fixed_frame_, frame, stamp_ns, fixed_from_frame, reason)) return std::nullopt;
    return fixed_from_frame;
  };
}

/// What is published waits for it.
AlongPath MonitorPipeline::searchAlong(const IntendedPath& path, FirstTouch* first) {
  const Options& options = monitor_->options().detector;
  const Deadline deadline = Deadline::after(tolerance::LOOK_AHEAD_SHARE * timeLimitMs(options));
  return path_search_.run(*answered_, options, speedBounds(), config_.speed_law, path, deadline, first);
}

deformable_ccd::SafeUntil MonitorPipeline::safeUntilMessage(const Outcome& outcome, const ros::Time& now) const {
  deformable_ccd::SafeUntil promise = toSafeUntil(outcome, promises_, speedBounds(), now, fixed_frame_);
  if (intended_.along.rests_on_path) promise.assumed.push_back(assumedOf(outcome, intended_.path));
  return promise;
}

deformable_ccd::Limits MonitorPipeline::limitsMessage(const Outcome& outcome) {
  const auto& [max_m, horizon_s] = *config_.limits;
  if (outcome.answered && !statement_.assurance.proved)  // or its promises are void
    return toLimits(outcome, {{}, {}, horizon_s, 0, {"the step is not proved"}}, {}, fixed_frame_);
  const Options& options = monitor_->options().detector;
  const Deadline deadline = Deadline::after(tolerance::LOOK_AHEAD_SHARE * timeLimitMs(options));
  const std::vector<SpeedBound> bounds = speedBounds();
  const ApproachLimits limits = approach_search_.run(outcome, options, bounds, max_m, horizon_s, deadline);
  return toLimits(outcome, limits, bounds, fixed_frame_);
}

deformable_ccd::AlongPath MonitorPipeline::alongPathMessage(const Outcome& outcome) const {
  return toAlongPath(outcome, intended_.path, intended_.along, fixed_frame_);
}

/// Whatever it throws, what the bounds alone allow stands.
void MonitorPipeline::followIntended() {
  const Step& step = *answered_->step;
  intended_ = {};
  intended_.along.until = safeUntil(*answered_, speedBounds());
  intended_.along.unused = "no path is in force";
  std::function<std::string(const Outcome&)> why_void;  // as the next answer tells
  try {
    if (const std::optional<IntendedPath> path = motion_->from(step, carriedBodies(step), places())) {
      Intended found{*path, searchAlong(*path)};
      why_void = [path = beginningAt(*path, step), before = answered_->step](const Outcome& next) {
        const double ahead_s = secondsBetween(before->stamp_ns, next.stamp_ns);
        Step now = *next.step;
        // How far what is carried has left its place PromiseWatch looks at.
        for (const IntendedPath::Of& of : path.bodies)
          if (of.frameOf() != of.body && std::max<std::size_t>(of.body, of.carrier) < now.bodies.size())
            now.bodies[of.body].t1 = share(carriedTo(*before, now, of.body, of.carrier));
        const PlaceOnPath place = placeOnPath(path, now, 0, ahead_s);
        if (place.off_m <= path.tubeAt(ahead_s)) return std::string();
        std::ostringstream text;
        text << "the robot was " << place.off_m << " m off the intended path, and " << path.tubeAt(ahead_s)
             << " m are allowed";
        return text.str();
      };
      intended_ = std::move(found);
    }
  } catch (const std::exception& error) {
    intended_.along.unused = std::string("a fault of the monitor: ") + error.what();
  }
  promises_.extend(*answered_, intended_.along.until, intended_.along.rests_on_path ? why_void : nullptr);
}

const Outcome* MonitorPipeline::reconsider() {
  if (!std::exchange(intends_anew_, false) || !answered_) return nullptr;
  followIntended();
  return &*answered_;
}

deformable_ccd::WouldTouch::Response MonitorPipeline::notProved(const std::string& reason) {
  deformable_ccd::WouldTouch::Response answer;
  answer.reason = reason;
  answer.first = answer.point.x = answer.point.y = answer.point.z = std::numeric_limits<double>::quiet_NaN();
  return answer;
}

deformable_ccd::WouldTouch::Response MonitorPipeline::wouldTouch(const trajectory_msgs::JointTrajectory& trajectory,
                                                                 const std::string& unproved) {
  if (!unproved.empty()) return notProved(unproved);
  if (!answered_ || !statement_.assurance.proved) return notProved("the newest step is not proved");
  std::string problem;
  const IntendedPath path =
      motion_->asked(trajectory, *answered_->step, carriedBodies(*answered_->step), places(), problem);
  FirstTouch first;
  if (problem.empty()) problem = searchAlong(path, &first).unused;
  auto answer = notProved(problem);
  if (!problem.empty()) return answer;
  answer.assumed = assumptions(*answered_, speedBounds());
  answer.assumed.push_back(assumedOf(*answered_, path));
  answer.first = first.free_s;
  answer.verdict = first.body && !first.unknown.empty() ? answer.NOT_PROVED : first.body ? answer.TOUCHES : answer.FREE;
  answer.reason = "on all of it nothing touches that is not expected";
  if (!first.body) return answer;
  putNames(*first.body, answered_->step->bodies, answer.bodies);
  std::tie(answer.point.x, answer.point.y, answer.point.z) =
      std::tie(first.point.x(), first.point.y(), first.point.z());
  answer.reason = first.unknown.empty() ? "they may touch then" : "they may touch, " + first.unknown;
  return answer;
}

SpeedScale MonitorPipeline::speedScale(const Outcome& outcome) const {
  if (!config_.speed_law) return {};
  if (intended_.along.unused.empty()) return intended_.along.scale;
  return dccd::speedScale(outcome, speedBounds(), *config_.speed_law);
}

}  // namespace dccd
