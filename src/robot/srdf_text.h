// The text of an SRDF: groups of links, and links that never meet. No Debian package reads it.
#pragma once

#include <map>
#include <string>
#include <utility>
#include <vector>

#include <urdf_model/model.h>

namespace dccd {

struct SrdfText {
  /// Links by group, each once. An end effector's name is one for the links of its group, unless a group has that name.
  std::map<std::string, std::vector<std::string>> groups;
  /// By disable_collisions and disable_default_collisions, without those of enable_collisions; each once, in order.
  std::vector<std::pair<std::string, std::string>> never_meet;
  std::vector<std::string> hints;  ///< on what names a link or joint that the robot has not, and is left out
};

/// A group holds the links that it names, those of its chains as MoveIt has them (from the link after the base to the
/// tip, or over a link from which both hang), the child of each of its joints, and those of the groups that it names.
/// States, virtual and passive joints and what else there is are not read. Throws RobotTextError: no XML, an attribute
/// is missing, a group that is unknown, named twice, or holds itself.
SrdfText parseSrdf(const std::string& text, const urdf::ModelInterface& model);

}  // namespace dccd
