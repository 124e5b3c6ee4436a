// The part of the configuration that is about a robot: which one, and how its links are tested. What a URDF makes of it
// is the room robot's matter; here its links become bodies.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "dccd/body.h"
#include "dccd/monitor_extras.h"
#include "dccd/step.h"
#include "input/mesh_resource.h"

namespace dccd {

class ParameterReader;
struct MonitorConfig;

/// What `robot/links` says of one link.
struct LinkSettings {
  std::optional<double> padding_m, scale;
};

/// The parameters under `robot`.
struct RobotConfig {
  std::string description;          ///< a parameter's name or a file; empty: no robot
  std::string semantic;             ///< the same of the SRDF; empty: none
  double padding_m = 0;             ///< minimum separation of a link
  double scale = 1;                 ///< of each collision element about its middle
  double own_voxels_m = ONE_VOXEL;  ///< Body::own_voxels_m of each link
  std::optional<SpeedBound> speed;  ///< of each link
  std::size_t max_own_voxels = 0;   ///< of the links and of what they hold; with more nothing is proved; 0: no limit
  std::map<std::string, LinkSettings> links;
  bool against_links = false, against_map = false;
  bool visuals = false;                                   ///< of links without a collision element
  std::vector<std::string> leave_out;                     ///< links, or "group NAME"
  std::map<std::string, std::vector<std::string>> holds;  ///< by body: the links and groups that hold it

  double scaleOf(const std::string& link) const;
  double paddingOf(const std::string& link) const;
};

/// A collision element of a link.
struct RobotPart {
  std::string link;
  std::string name;                          ///< the link's; of its second element, LINK/2
  std::shared_ptr<const MeshResource> mesh;  ///< [m], in the link's frame
};

/// What became of the robot's description.
struct Robot {
  bool named = false;           ///< a parameter asks for one
  bool known = false;           ///< the description was read: `links` has every link's name
  bool semantic_known = false;  ///< the same of the SRDF, or none was named: `groups` has every group
  std::vector<std::string> links;
  std::map<std::string, std::vector<std::string>> groups;       ///< links by group; an end effector is one, too
  std::vector<RobotPart> parts;                                 ///< what is to be watched
  std::vector<std::string> left_out;                            ///< links, by robot/leave_out
  std::vector<std::pair<std::string, std::string>> never_meet;  ///< links, by disable_collisions
  std::vector<std::string> missing;                             ///< what should be watched and is not: a sentence each
  std::vector<std::string> excluded;                            ///< what has no surface to watch: a clause each
  std::vector<std::string> hints;                               ///< what its owner should see: a sentence each
  std::vector<std::string> doubts;                ///< of hints, why a link may not be what it is taken for
  std::string text;                               ///< of both files
  std::string description;                        ///< the URDF alone
  std::map<std::string, std::string> parameters;  ///< resolved names: what they held, or nothing
};

/// A body that a hand holds, by robot/holds: as long as it does, their contacts are expected.
struct Hold {
  std::string body, by;               ///< as the parameter has them
  bool closed = true;                 ///< the hand is
  std::vector<Expectation> contacts;  ///< one with each body that `by` stands for
};

/// Makes the robot of its parameters. Primitives are meshed to within the tolerance [m].
using RobotLoader = std::function<Robot(const RobotConfig&, double tolerance_m)>;

/// `robot`, whose links become bodies. After all other bodies and after effects. Without a loader a robot is refused.
void readRobot(ParameterReader& reader, const RobotLoader& load, MonitorConfig& config);

/// What a name in `between` stands for: numbers of bodies. "link NAME", "group NAME", or NAME alone, be it a body or a
/// link. None: a link or group without geometry that is watched, or of a robot that could not be read; a rigid body
/// that effects leave out. nullopt: nothing that is known.
std::optional<std::vector<std::uint16_t>> bodiesNamed(const std::string& name, const MonitorConfig& config);

}  // namespace dccd
