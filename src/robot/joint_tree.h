// How a robot's joints carry its links: what a trajectory of joints means for what is watched.
#pragma once

#include <Eigen/Geometry>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace urdf {
class Joint;
class ModelInterface;
}  // namespace urdf

namespace dccd {

/// Of one joint that moves, in a stretch of time: how fast, and how much faster, it gets at most [1/s, 1/s^2 of rad or
/// m].
struct JointPace {
  double speed = 0, acceleration = 0;
};

class JointTree {
 public:
  /// Throws RobotTextError for a text that is no URDF.
  explicit JointTree(const std::string& urdf);

  const std::string& root() const;
  bool hasLink(const std::string& name) const;
  /// One that turns or slides, and follows no other one.
  bool moves(const std::string& joint) const;
  /// The joints that move on the way from the root to the link, those that others follow in their place.
  std::set<std::string> jointsTo(const std::string& link) const;
  /// The joint beyond which nothing moves until the link: what has the same one is fixed to it. Empty: the root's.
  std::string lastJointTo(const std::string& link) const;
  /// root_from_link at these positions of joints that move.
  Eigen::Isometry3d pose(const std::string& link, const std::map<std::string, double>& positions) const;
  /// No vertex that is so far from the link's origin at most has more acceleration [m/s^2], in the root's frame, while
  /// the joints go no faster. `most`: how far any that slides is out [m].
  double accelerationBound(const std::string& link, double reach_m, const std::map<std::string, JointPace>& paces,
                           double most_m) const;

 private:
  std::shared_ptr<urdf::ModelInterface> model_;
  /// From the root to the link.
  std::vector<std::shared_ptr<urdf::Joint>> chainTo(const std::string& link) const;
};

}  // namespace dccd
