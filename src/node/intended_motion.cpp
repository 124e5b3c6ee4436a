#include "node/intended_motion.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <sstream>

#include "robot/urdf_text.h"

namespace dccd {
namespace {

using trajectory_msgs::JointTrajectoryPoint;
using Quintic = std::array<double, 6>;

constexpr std::size_t MOST_PIECES = 64;  // of a stretch without a kink
constexpr double SHORTEST_S = 1e-6;      // between two points: a jump in less than stamps tell apart has no speed

template <class... Parts>
std::string clause(const Parts&... parts) {
  std::ostringstream text;
  (text << ... << parts);
  return text.str();
}

Eigen::Isometry3d screw(const Vec3& linear, const Vec3& angular, double time_s) {
  Eigen::Isometry3d moved = Eigen::Isometry3d::Identity();
  const double speed = angular.norm(), angle = speed * time_s;
  if (angle == 0) {
    moved.translation() = linear * time_s;
    return moved;
  }
  const Vec3 axis = angular / speed, along = axis.dot(linear) * axis, to_axis = axis.cross(linear) / speed;
  moved.linear() = Eigen::AngleAxisd(angle, axis).toRotationMatrix();
  moved.translation() = to_axis - moved.linear() * to_axis + along * time_s;
  return moved;
}

/// The way of a joint that is at a and b at two points, h seconds apart, as joint_trajectory_controller takes it: a
/// quintic where both have speeds and accelerations, a cubic where both have speeds, else straight. All are quintics.
Quintic quinticOf(const JointTrajectoryPoint& from, const JointTrajectoryPoint& to, std::size_t j, double h) {
  const double a = from.positions[j], b = to.positions[j];
  const bool has_speeds = !from.velocities.empty() && !to.velocities.empty();
  const double v = h * (has_speeds ? from.velocities[j] : (b - a) / h), w = has_speeds ? h * to.velocities[j] : v;
  const bool is_quintic = has_speeds && !from.accelerations.empty() && !to.accelerations.empty();
  const double c = is_quintic ? h * h * from.accelerations[j] : 6 * (b - a) - 4 * v - 2 * w,
               d = is_quintic ? h * h * to.accelerations[j] : 6 * (a - b) + 2 * v + 4 * w;
  return {a, a + v / 5, a + 2 * v / 5 + c / 20, b - 2 * w / 5 + d / 20, b - w / 5, b};
}

double valueOf(Quintic b, double u) {
  for (std::size_t most = b.size() - 1; most > 0; --most)
    for (std::size_t i = 0; i < most; ++i) b[i] = (1 - u) * b[i] + u * b[i + 1];
  return b[0];
}

/// The coefficients of a derivative bound it.
JointPace paceOf(const Quintic& b, double lasts_s) {
  JointPace pace;
  for (std::size_t i = 0; i < 5; ++i) pace.speed = std::max(pace.speed, std::abs(5 * (b[i + 1] - b[i]) / lasts_s));
  for (std::size_t i = 0; i < 4; ++i) {
    const double bend = 20 * (b[i + 2] - 2 * b[i + 1] + b[i]);
    pace.acceleration = std::max(pace.acceleration, std::abs(bend / lasts_s / lasts_s));
  }
  return pace;
}

}  // namespace

IntendedMotion::IntendedMotion(const IntentConfig& limits, const std::string& description, double bend_m)
    : limits_(limits), bend_m_(bend_m) {
  try {
    if (!description.empty()) tree_.emplace(description);
    if (!tree_) no_tree_ = "there is no robot (robot/description)";
  } catch (const RobotTextError& error) {
    no_tree_ = std::string("the robot's joints cannot be read: ") + error.what();
  }
}

std::string IntendedMotion::segmentsOf(const trajectory_msgs::JointTrajectory& message, Motion& motion) const {
  const auto& names = message.joint_names;
  if (!tree_) return "joint_names: " + no_tree_;
  if (names.empty()) return "joint_names is empty";
  for (std::size_t j = 0; j < names.size(); ++j) {
    if (!tree_->moves(names[j]))
      return clause("joint_names[", j, "] '", names[j], "' is no joint of the robot that turns or slides by itself");
    if (std::count(names.begin(), names.end(), names[j]) > 1) return clause("joint_names has '", names[j], "' twice");
  }
  motion.joints = names;
  if (message.points.size() < 2)
    return clause("points has ", message.points.size(), " of the two or more that it needs");
  double last_s = 0;
  for (std::size_t p = 0; p < message.points.size(); ++p) {
    const JointTrajectoryPoint& point = message.points[p];
    const double time_s = point.time_from_start.toSec();
    if (p == 0 && time_s != 0) return clause("points[0]/time_from_start is ", time_s, " s; it must be 0");
    if (p > 0 && !(time_s - last_s >= SHORTEST_S))
      return clause("points[", p, "]/time_from_start is ", time_s, " s, after ", last_s, " s");
    last_s = time_s;
    const auto problem = [&](const std::vector<double>& values, const char* field) {
      if (values.size() != names.size())
        return clause("points[", p, "]/", field, " has ", values.size(), " values of ", names.size(), " joints");
      for (std::size_t j = 0; j < values.size(); ++j)
        if (!std::isfinite(values[j])) return clause("points[", p, "]/", field, "[", j, "] is ", values[j]);
      return std::string();
    };
    std::string what = problem(point.positions, "positions");
    if (what.empty() && !point.velocities.empty()) what = problem(point.velocities, "velocities");
    if (what.empty() && !point.accelerations.empty()) what = problem(point.accelerations, "accelerations");
    if (!what.empty()) return what;
    if (p == 0) continue;
    const JointTrajectoryPoint& before = message.points[p - 1];
    Segment segment{before.time_from_start.toSec(), time_s, {}};
    for (std::size_t j = 0; j < names.size(); ++j)
      segment.joints.push_back(quinticOf(before, point, j, time_s - segment.begin_s));
    motion.segments.push_back(std::move(segment));
  }
  motion.duration_s = last_s;
  return "";
}

std::string IntendedMotion::take(const trajectory_msgs::JointTrajectory& message, StampNs newest_ns) {
  Motion motion;
  motion.begin_ns = static_cast<StampNs>(message.header.stamp.toNSec());
  std::string problem = segmentsOf(message, motion);
  return add(std::move(motion), std::move(problem), newest_ns);
}

std::string IntendedMotion::take(const geometry_msgs::TwistStamped& message, StampNs newest_ns) {
  Motion motion;
  motion.begin_ns = static_cast<StampNs>(message.header.stamp.toNSec());
  motion.duration_s = limits_.horizon_s;
  motion.frame = message.header.frame_id;
  const geometry_msgs::Vector3 &v = message.twist.linear, &w = message.twist.angular;
  motion.linear = Vec3(v.x, v.y, v.z);
  motion.angular = Vec3(w.x, w.y, w.z);
  std::string problem;
  if (motion.frame.empty()) problem = "header/frame_id is empty";
  if (!motion.linear.allFinite()) problem = clause("twist/linear is (", v.x, ", ", v.y, ", ", v.z, ")");
  if (!motion.angular.allFinite()) problem = clause("twist/angular is (", w.x, ", ", w.y, ", ", w.z, ")");
  return add(std::move(motion), std::move(problem), newest_ns);
}

std::string IntendedMotion::add(Motion motion, std::string problem, StampNs newest_ns) {
  if (!problem.empty()) {
  } else if (motion.begin_ns == 0) {
    problem = "header/stamp is 0: it says when the motion begins";
  } else if (motion.endNs() <= newest_ns) {
    problem = clause("header/stamp is late: the motion ended ", secondsBetween(motion.endNs(), newest_ns),
                     " s before the newest frame");
  } else if (!motions_.empty() && motion.begin_ns < motions_.back().begin_ns) {
    problem = clause("header/stamp goes back by ", secondsBetween(motion.begin_ns, motions_.back().begin_ns), " s");
  } else if (motions_.size() >= MOST_WAITING) {
    problem = clause("more than ", MOST_WAITING, " motions wait for a frame");
  }
  if (!problem.empty()) {
    forget();
    return problem;
  }
  if (!motions_.empty() && motions_.back().begin_ns == motion.begin_ns) motions_.pop_back();
  motions_.push_back(std::move(motion));
  return "";
}

std::string IntendedMotion::kindOf(const std::string& problem) {
  std::string kind = problem.substr(0, problem.find('\''));
  kind.erase(std::remove_if(kind.begin(), kind.end(), [](char c) { return !std::isalpha(c) && c != '/'; }), kind.end());
  return kind;
}

void IntendedMotion::drop(const std::string& problem) {
  forget();
  problem_ = problem;
}

IntendedPath IntendedMotion::emptyPath(const std::vector<CarriedBody>& on_it) const {
  IntendedPath path;
  path.deviation_m = limits_.deviation_m;
  path.deviation_rate_m_s = limits_.deviation_rate_m_s;
  for (const CarriedBody& one : on_it) path.bodies.push_back({one.body, {}, one.carrier, one.relative_m_s});
  return path;
}

std::optional<IntendedPath> IntendedMotion::from(const Step& step, const std::vector<CarriedBody>& carried,
                                                 const Lookup& lookup) {
  while (motions_.size() > 1 && motions_[1].begin_ns <= step.stamp_ns) motions_.pop_front();
  if (motions_.empty() || motions_.front().begin_ns > step.stamp_ns) return std::nullopt;
  if (motions_.front().endNs() <= step.stamp_ns) {
    motions_.pop_front();
    problem_ = "has ended";
    return std::nullopt;
  }
  return motions_.front().isTwist() ? byTwists(step, carried, lookup) : alongTrajectory(step, carried, lookup);
}

std::vector<CarriedBody> IntendedMotion::movedBy(const Motion& motion, const std::vector<CarriedBody>& carried) {
  std::vector<CarriedBody> on_it;
  bool moves_one = false;
  for (const CarriedBody& one : carried) {
    if (!tree_->hasLink(one.frame)) continue;
    const std::set<std::string> joints = tree_->jointsTo(one.frame);
    const auto named = std::count_if(motion.joints.begin(), motion.joints.end(),
                                     [&](const std::string& name) { return joints.count(name) > 0; });
    if (named > 0 && joints.size() > static_cast<std::size_t>(named)) moved_by_others_ = one.frame;
    if (joints.size() != static_cast<std::size_t>(named)) continue;
    on_it.push_back(one);
    moves_one = moves_one || named > 0;
  }
  return moves_one ? on_it : std::vector<CarriedBody>();
}

std::optional<IntendedPath> IntendedMotion::alongTrajectory(const Step& step, const std::vector<CarriedBody>& carried,
                                                            const Lookup& lookup) {
  Motion& motion = motions_.front();
  const std::vector<CarriedBody> on_it = movedBy(motion, carried);
  const std::optional<Eigen::Isometry3d> base = lookup(tree_->root(), step.stamp_ns);
  if (on_it.empty() || !base) {
    drop(on_it.empty() ? "joint_names: they move no link that is watched, or not alone"
                       : "has no place: nobody knows where '" + tree_->root() + "' is");
    return std::nullopt;
  }
  if (motion.last.stamp_ns < step.stamp_ns) motion.before = motion.last;
  const double now_s = secondsBetween(motion.begin_ns, step.stamp_ns), from_s = motion.before.at_s;
  double until_s = std::min(motion.duration_s, now_s + limits_.horizon_s);
  if (motions_.size() > 1) until_s = std::min(until_s, secondsBetween(motion.begin_ns, motions_[1].begin_ns));
  IntendedPath path = emptyPath(on_it);
  double reach_m = 0;
  for (const CarriedBody& one : on_it) reach_m = std::max(reach_m, one.reach_m);
  for (const Segment& segment : motion.segments) {
    const double end_s = std::min(segment.end_s, until_s), lasts_s = segment.end_s - segment.begin_s;
    if (segment.end_s <= from_s || end_s <= segment.begin_s) continue;
    std::map<std::string, JointPace> paces;
    double out_m = 0;
    for (std::size_t j = 0; j < motion.joints.size(); ++j) {
      paces[motion.joints[j]] = paceOf(segment.joints[j], lasts_s);
      for (const double position : segment.joints[j]) out_m = std::max(out_m, std::abs(position));
    }
    double acceleration = 0;
    for (const CarriedBody& one : on_it)
      acceleration = std::max(acceleration, tree_->accelerationBound(one.frame, one.reach_m, paces, out_m));
    const auto poses = [&](double time_s) {
      const double u = std::clamp((from_s + time_s - segment.begin_s) / lasts_s, 0.0, 1.0);
      std::map<std::string, double> positions;
      for (std::size_t j = 0; j < motion.joints.size(); ++j)
        positions[motion.joints[j]] = valueOf(segment.joints[j], u);
      std::vector<Eigen::Isometry3d> all;
      for (const CarriedBody& one : on_it)
        all.push_back(*base * tree_->pose(one.frame, positions) * one.frame_from_body);
      return all;
    };
    addPieces(poses, end_s - from_s, acceleration, reach_m, bend_m_, MOST_PIECES, path);
  }
  if (!problemOf(path, step.bodies).empty()) return std::nullopt;
  const double allowed_m =
      path.tubeAt(secondsBetween(std::max(motion.begin_ns, motion.before.stamp_ns), step.stamp_ns));
  const PlaceOnPath place = placeOnPath(path, step, 0, now_s - from_s, allowed_m);
  if (!(place.off_m <= allowed_m)) {
    drop(clause("does not hold: the robot is ", place.off_m, " m off it, and ", allowed_m,
                " m are allowed (intent/deviation_m)"));
    return std::nullopt;
  }
  motion.last = {from_s + place.time_s, step.stamp_ns};
  // A robot that has fallen behind goes on by its motion only until the next one begins, or this one was to end.
  const StampNs end_ns = motions_.size() > 1 ? std::min(motion.endNs(), motions_[1].begin_ns) : motion.endNs();
  return restOf(path, place.time_s, place.last_s, std::min(limits_.horizon_s, secondsBetween(step.stamp_ns, end_ns)));
}

IntendedPath IntendedMotion::asked(trajectory_msgs::JointTrajectory message, const Step& step,
                                   const std::vector<CarriedBody>& carried, const Lookup& lookup,
                                   std::string& problem) const {
  IntendedMotion alone(*this);
  alone.forget();
  alone.limits_.horizon_s = MOST_PROMISED_S;
  message.header.stamp.fromNSec(static_cast<std::uint64_t>(step.stamp_ns));
  problem = alone.take(message, step.stamp_ns);
  if (!problem.empty()) return {};
  const bool is_long = alone.motions_[0].duration_s > MOST_PROMISED_S;
  const std::optional<IntendedPath> path = alone.from(step, carried, lookup);
  problem = alone.takeProblem();
  if (!alone.moved_by_others_.empty())
    problem = "joint_names: they move '" + alone.moved_by_others_ + "', but not alone";
  if (is_long) problem = clause("it lasts longer than ", MOST_PROMISED_S, " s");
  return path.value_or(IntendedPath());
}

/// Each until the next one begins. A constant twist turns about one axis of space and slides along it.
std::optional<IntendedPath> IntendedMotion::byTwists(const Step& step, const std::vector<CarriedBody>& carried,
                                                     const Lookup& lookup) {
  const std::string& frame = motions_.front().frame;
  const bool in_tree = tree_ && tree_->hasLink(frame);
  std::vector<CarriedBody> on_it;
  for (const CarriedBody& one : carried) {
    const bool is_fixed_to_it = in_tree && tree_->hasLink(one.frame) && !tree_->lastJointTo(frame).empty() &&
                                tree_->lastJointTo(one.frame) == tree_->lastJointTo(frame);
    if (one.frame == frame || is_fixed_to_it) on_it.push_back(one);
  }
  const std::optional<Eigen::Isometry3d> begin = lookup(frame, step.stamp_ns);
  if (on_it.empty() || !begin) {
    drop("header/frame_id '" + frame + "' " + (begin ? "carries nothing that is watched" : "has no place"));
    return std::nullopt;
  }
  IntendedPath path = emptyPath(on_it);
  double far_m = 0, reach_m = 0;
  std::vector<Eigen::Isometry3d> from_frame;
  for (const CarriedBody& one : on_it) {
    from_frame.push_back(begin->inverse() * step.bodies[path.bodies[from_frame.size()].frameOf()].pose_t1);
    reach_m = std::max(reach_m, one.reach_m);
    far_m = std::max(far_m, from_frame.back().translation().norm() + one.reach_m);
  }
  Eigen::Isometry3d at = *begin;
  for (std::size_t m = 0; m < motions_.size() && motions_[m].isTwist() && motions_[m].frame == frame; ++m) {
    const Motion& motion = motions_[m];
    const double begins_s = path.endsAt();
    StampNs end_ns = motion.endNs();
    if (m + 1 < motions_.size()) end_ns = std::min(end_ns, motions_[m + 1].begin_ns);
    const double until_s = secondsBetween(step.stamp_ns, end_ns), turns = motion.angular.norm();
    const auto poses = [&](double time_s) {
      std::vector<Eigen::Isometry3d> all;
      const Eigen::Isometry3d moved = at * screw(motion.linear, motion.angular, time_s - begins_s);
      for (const Eigen::Isometry3d& body : from_frame) all.push_back(moved * body);
      return all;
    };
    addPieces(poses, until_s, turns * (motion.linear.norm() + turns * far_m), reach_m, bend_m_, MOST_PIECES, path);
    at = at * screw(motion.linear, motion.angular, until_s - begins_s);
    if (end_ns == motion.endNs()) break;
  }
  return path;
}

}  // namespace dccd
