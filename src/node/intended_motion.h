// ~intended: what a controller says that the robot is to do, as a path of the bodies that are watched.
#pragma once

#include <array>
#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <geometry_msgs/TwistStamped.h>
#include <trajectory_msgs/JointTrajectory.h>

#include "config/monitor_config.h"
#include "dccd/intended.h"
#include "robot/joint_tree.h"

namespace dccd {

/// A body that a frame carries, or what one of these carries (IntendedPath::Of): its vertices are within reach_m of the
/// origin of that body's own frame.
struct CarriedBody {
  std::uint16_t body = 0;
  std::string frame;
  Eigen::Isometry3d frame_from_body = Eigen::Isometry3d::Identity();
  double reach_m = 0;
  std::size_t carrier = SpeedBound::NO_CARRIER;
  double relative_m_s = 0;
};

/// The newest message counts, until its end, or until the robot is found off it; before it begins the one before. One
/// thread.
class IntendedMotion {
 public:
  /// fixed_from_frame at a stamp; none: nobody knows.
  using Lookup = std::function<std::optional<Eigen::Isometry3d>(const std::string& frame, StampNs)>;

  /// `description`: of the robot, a URDF; empty: there is none.
  IntendedMotion(const IntentConfig& limits, const std::string& description, double bend_m);

  /// Returns what is wrong with it, a clause that names the field and the value; empty: it is in force. Once one is
  /// refused none that came before is in force. `newest_ns`: the stamp of the newest answer; 0: there is none.
  std::string take(const trajectory_msgs::JointTrajectory& message, StampNs newest_ns);
  std::string take(const geometry_msgs::TwistStamped& message, StampNs newest_ns);

  /// The path from the step's end on, of all that it carries; none: there is no motion then. takeProblem(): why one
  /// that was in force is not any more, once.
  std::optional<IntendedPath> from(const Step& step, const std::vector<CarriedBody>& carried, const Lookup& lookup);
  std::string takeProblem() { return std::exchange(problem_, {}); }
  /// What from() would make of this one alone, if it began at the step's end and MOST_PROMISED_S were the horizon; an
  /// empty path where `problem` says why there is none.
  IntendedPath asked(trajectory_msgs::JointTrajectory message, const Step& step,
                     const std::vector<CarriedBody>& carried, const Lookup& lookup, std::string& problem) const;
  void forget() { motions_.clear(); }
  /// Problems of one kind differ in numbers and in what follows the first name: only the first of them is told.
  static std::string kindOf(const std::string& problem);

 private:
  static constexpr std::size_t MOST_WAITING = 1000;  // motions that begin later
  struct Segment {                                   // from point to point
    double begin_s = 0, end_s = 0;
    std::vector<std::array<double, 6>> joints;  // Bernstein's, by joint
  };
  struct Motion {
    StampNs begin_ns = 0;
    double duration_s = 0;
    std::vector<std::string> joints;  // of a trajectory
    std::vector<Segment> segments;    // empty: a twist
    std::string frame;
    Vec3 linear, angular;
    /// Of a trajectory: where the robot was.
    struct Passed {
      double at_s = 0;
      StampNs stamp_ns = 0;
    } last, before;  // the latter at a step before the last one
    bool isTwist() const { return segments.empty(); }
    StampNs endNs() const { return begin_ns + static_cast<StampNs>(1e9 * duration_s); }
  };

  IntentConfig limits_;
  const double bend_m_;
  std::optional<JointTree> tree_;
  std::string no_tree_;  // why there is none
  std::deque<Motion> motions_;
  std::string problem_, moved_by_others_;  // the latter: a frame, by other joints, too

  std::string add(Motion motion, std::string problem, StampNs newest_ns);
  std::string segmentsOf(const trajectory_msgs::JointTrajectory& message, Motion& motion) const;
  /// What its joints alone move, and what no joint does, which stands still; none: they move nothing alone.
  std::vector<CarriedBody> movedBy(const Motion& motion, const std::vector<CarriedBody>& carried);
  std::optional<IntendedPath> alongTrajectory(const Step& step, const std::vector<CarriedBody>& carried,
                                              const Lookup& lookup);
  std::optional<IntendedPath> byTwists(const Step& step, const std::vector<CarriedBody>& carried, const Lookup& lookup);
  IntendedPath emptyPath(const std::vector<CarriedBody>& on_it) const;
  void drop(const std::string& problem);
};

}  // namespace dccd
