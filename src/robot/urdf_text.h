// The text of a URDF, reduced to what places a robot's surfaces and handed to urdfdom.
#pragma once

#include <map>
#include <set>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include <urdf_model/model.h>
#include <urdf_world/types.h>

namespace dccd {

/// One sentence: what of a URDF or SRDF is wrong, and in which line or element.
struct RobotTextError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct UrdfText {
  urdf::ModelInterfaceSharedPtr model;  ///< its links with their collision elements; its joints are all fixed
  /// By link: collision elements that are no geometry that is known, a clause each. They are not in the model.
  std::map<std::string, std::vector<std::string>> refused;
  /// Shapes that are of no link's elements: the link in which they stand, or none, and a clause.
  std::vector<std::pair<std::string, std::string>> unread;
  std::map<std::string, std::size_t> collisions;  ///< of each link, as the text has them
  std::set<std::string> visual_only;              ///< links that are seen, but have no collision element
};

/// Visuals, inertias, materials, transmissions, what is Gazebo's, and how joints move are left out before urdfdom reads
/// it: where these are wrong, surfaces are still where tf has them. visuals: of links without a collision element they
/// are taken for that. Throws RobotTextError.
UrdfText parseUrdf(const std::string& text, bool visuals = false);
/// How its joints move, and nothing of what its links look like. Throws RobotTextError.
urdf::ModelInterfaceSharedPtr parseJoints(const std::string& text);

}  // namespace dccd
