#include "config/robot_config.h"

#include <algorithm>
#include <set>

#include "config/body_config.h"

namespace dccd {
namespace {

constexpr char LINK[] = "link ", GROUP[] = "group ";

bool startsWith(const std::string& text, const std::string& start) { return text.compare(0, start.size(), start) == 0; }

bool contains(const std::vector<std::string>& names, const std::string& name) {
  return std::find(names.begin(), names.end(), name) != names.end();
}

std::string quoted(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "'" : ", '") + name + "'";
  return text;
}

/// One name or a list of them.
std::vector<std::string> readNames(ParameterReader& section, const std::string& name) {
  if (section.raw(name).kind == ParameterTree::Kind::TEXT) return {section.text(name)};
  std::vector<std::string> names;
  for (const ParameterTree& one : section.list(name)) {
    if (one.kind != ParameterTree::Kind::TEXT) section.fail(name, "must name links and groups");
    names.push_back(one.text);
  }
  return names;
}

LinkSettings readLink(ParameterReader section) {
  LinkSettings link;
  if (section.has("padding_m")) link.padding_m = section.number("padding_m", 0, LARGE);
  if (section.has("scale")) link.scale = section.number("scale", 1e-6, 1e6);
  section.finish();
  return link;
}

RobotConfig readRobotParameters(ParameterReader section) {
  RobotConfig robot;
  refuseGone(section, "robot/");
  robot.description = section.get("description", std::string());
  if (robot.description.empty())
    section.fail("description", "is needed: the parameter that holds the URDF, or its file");
  robot.semantic = section.get("semantic", std::string());
  robot.padding_m = section.number("padding_m", robot.padding_m, 0, LARGE);
  robot.own_voxels_m = ownVoxelsOf(section, robot.own_voxels_m);
  robot.max_own_voxels = section.integer("max_own_voxels", robot.max_own_voxels, 0, MANY);
  if (section.has("max_speed_m_s")) robot.speed = speedBoundOf(section, {});
  robot.visuals = section.get("visuals", robot.visuals);
  robot.against_links = section.get("against_links", robot.against_links);
  robot.against_map = section.get("against_map", robot.against_map);
  for (const ParameterTree& name : section.list("leave_out")) {
    if (name.kind != ParameterTree::Kind::TEXT) section.fail("leave_out", "must list links and groups by name");
    robot.leave_out.push_back(name.text);
  }
  ParameterReader holds = section.section("holds");
  for (const std::string& body : holds.names()) robot.holds[body] = readNames(holds, body);
  ParameterReader links = section.section("links");
  for (const std::string& name : links.names()) robot.links[name] = readLink(links.section(name));
  section.finish();
  return robot;
}

/// Refuses a name that is none of the robot's. One of a robot that could not be read may be right.
void requireNames(const ParameterReader& reader, const RobotConfig& asked, const Robot& robot) {
  if (!robot.known) return;
  for (const auto& link : asked.links) {
    if (contains(robot.links, link.first)) continue;
    reader.fail("robot/links/" + link.first,
                "is no link of the robot; nearest is '" + nearestName(link.first, robot.links) + "'");
  }
  const std::vector<std::string> known = namesOf(robot);
  for (const std::string& name : asked.leave_out) {
    if (contains(known, name) || (startsWith(name, GROUP) && !robot.semantic_known)) continue;
    reader.fail("robot/leave_out",
                "names '" + name + "', which is no link and no group; nearest is '" + nearestName(name, known) + "'");
  }
}

/// No two of a link's own, and of different links only those that are asked for.
bool mayMeet(const RobotPart& a, const RobotPart& b, bool against_links,
             const std::set<std::pair<std::string, std::string>>& never) {
  return against_links && a.link != b.link && never.count(std::minmax(a.link, b.link)) == 0;
}

void addBodies(const RobotConfig& asked, const Robot& robot, MonitorConfig& config) {
  const std::size_t first = config.bodies.size();
  std::set<std::string> taken{"octomap", "self"};
  for (const BodyConfig& body : config.bodies) taken.insert(body.body.name);
  std::set<std::pair<std::string, std::string>> never;
  for (const auto& pair : robot.never_meet) never.insert(std::minmax(pair.first, pair.second));
  for (std::size_t p = 0; p < robot.parts.size(); ++p) {
    const RobotPart& part = robot.parts[p];
    BodyConfig body;
    body.body.name = taken.count(part.name) > 0 ? LINK + part.name : part.name;
    body.body.rigid = true;
    body.body.self_collision = false;
    body.body.against_obstacle = asked.against_map;
    body.body.minimum_separation_m = std::max(asked.paddingOf(part.link), config.minimum_separation_m);
    // Where the unknown is occupied, own voxels cannot be told from it, and nobody asked for them by name.
    const bool owns = settingOf(config.effects, Effect::OWN_VOXELS) != EffectSetting::OFF &&
                      config.unknown_space != UnknownSpace::OCCUPIED;
    body.body.own_voxels_m = owns ? asked.own_voxels_m : 0;
    for (std::size_t other = 0; other < robot.parts.size(); ++other) {
      if (other == p || mayMeet(part, robot.parts[other], asked.against_links, never)) continue;
      body.body.not_against.push_back(static_cast<std::uint16_t>(first + other));
    }
    body.tf_frame = body.body.link = part.link;
    body.speed = asked.speed.value_or(config.speed);
    body.link_mesh = part.mesh;
    config.bodies.push_back(std::move(body));
  }
}

/// robot/holds, once all bodies are there.
void readHolds(const ParameterReader& reader, const RobotConfig& asked, MonitorConfig& config) {
  std::vector<std::string> bodies;
  for (const BodyConfig& body : config.bodies) {
    if (body.body.link.empty()) bodies.push_back(body.body.name);
  }
  for (const auto& [body, holders] : asked.holds) {
    const auto held = std::find(bodies.begin(), bodies.end(), body);
    if (held == bodies.end()) {
      reader.fail("robot/holds/" + body, "is no body; nearest is '" + nearestName(body, bodies) + "'");
    }
    for (const std::string& by : holders) {
      const auto found = bodiesNamed(by, config);
      if (!found) {
        reader.fail("robot/holds/" + body, "names '" + by + "', which is no link and no group; nearest is '" +
                                               nearestName(by, namesOf(config.robot)) + "'");
      }
      Hold hold{body, by, true, {}};
      for (const std::uint16_t other : *found) {
        Expectation& one = hold.contacts.emplace_back();
        one.partners[0].body = static_cast<std::uint16_t>(held - bodies.begin());
        one.partners[1].body = other;
      }
      config.holds.push_back(std::move(hold));
    }
  }
}

}  // namespace

double RobotConfig::scaleOf(const std::string& link) const {
  const auto own = links.find(link);
  return own == links.end() ? scale : own->second.scale.value_or(scale);
}

double RobotConfig::paddingOf(const std::string& link) const {
  const auto own = links.find(link);
  return own == links.end() ? padding_m : own->second.padding_m.value_or(padding_m);
}

std::vector<std::string> namesOf(const Robot& robot) {
  std::vector<std::string> all = robot.links;
  for (const auto& group : robot.groups) all.push_back(GROUP + group.first);
  return all;
}

void readRobot(ParameterReader& reader, const RobotLoader& load, MonitorConfig& config) {
  if (!reader.has("robot")) return;
  RobotConfig asked;
  if (reader.raw("robot").kind == ParameterTree::Kind::TEXT) {
    asked.description = reader.text("robot");
  } else {
    asked = readRobotParameters(reader.section("robot"));
  }
  config.robot.named = true;
  if (settingOf(config.effects, Effect::RIGID_BODIES) == EffectSetting::OFF) {
    config.robot_excluded.push_back("the robot by effects/rigid_bodies: off");
    return;
  }
  if (!load) reader.fail("robot", "has no meaning here; remove it");
  config.robot = load(asked, config.monitor.detector.rigid_tolerance_m);
  config.robot.named = true;
  config.robot_asked = asked;
  const Robot& robot = config.robot;
  requireNames(reader, asked, robot);
  addBodies(asked, robot, config);
  readHolds(reader, asked, config);
  if (!robot.left_out.empty()) {
    config.robot_excluded.push_back("of the robot " + quoted(robot.left_out) + " by robot/leave_out");
  }
  for (const std::string& clause : robot.excluded) config.robot_excluded.push_back("of the robot " + clause);
  if (robot.parts.size() < 2) return;
  if (!asked.against_links) {
    config.robot_excluded.push_back("links of the robot against each other");
  } else if (!robot.never_meet.empty()) {
    config.robot_excluded.push_back(std::to_string(robot.never_meet.size()) +
                                    " pairs of the robot's links by disable_collisions");
  }
}

std::optional<std::vector<std::uint16_t>> bodiesNamed(const std::string& name, const MonitorConfig& config) {
  const Robot& robot = config.robot;
  std::vector<std::uint16_t> found;
  if (contains(config.rigid_off, name)) return found;
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    const BodyConfig& body = config.bodies[b];
    const bool whole_link = !body.body.link.empty() && (name == body.body.link || name == LINK + body.body.link);
    if (body.body.name == name && !whole_link) return std::vector{static_cast<std::uint16_t>(b)};
  }
  std::vector<std::string> links;
  if (startsWith(name, GROUP)) {
    const auto group = robot.groups.find(name.substr(sizeof GROUP - 1));
    if (group != robot.groups.end()) {
      links = group->second;
    } else if (!robot.named || robot.semantic_known) {
      return std::nullopt;
    }
  } else {
    links.push_back(startsWith(name, LINK) ? name.substr(sizeof LINK - 1) : name);
    if (!robot.named || (robot.known && !contains(robot.links, links[0]))) return std::nullopt;
  }
  for (std::size_t b = 0; b < config.bodies.size(); ++b) {
    const std::string& link = config.bodies[b].body.link;
    if (!link.empty() && contains(links, link)) found.push_back(static_cast<std::uint16_t>(b));
  }
  return found;
}

}  // namespace dccd
