// doc/interface.md: its example of several bodies is accepted as it stands, and the defaults of the node and of a body
// are the code's.
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "input/mesh_resource.h"
#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

std::string interfacePage() {
  std::ifstream in(std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/doc/interface.md");
  return {std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
}

/// What lies between the first `from` and the next `to`; empty where either is missing.
std::string between(const std::string& text, const std::string& from, const std::string& to) {
  const std::size_t begin = text.find(from);
  if (begin == std::string::npos) return "";
  const std::size_t end = text.find(to, begin + from.size());
  return end == std::string::npos ? "" : text.substr(begin + from.size(), end - begin - from.size());
}

TEST(InterfacePage, TheExampleOfClothAndFingerIsAcceptedAsItStands) {
  const std::string block = between(interfacePage(), "```yaml\n", "```");
  ASSERT_FALSE(block.empty());
  const MonitorConfig config = readConfig(parseYaml(block, "doc/interface.md"), "");
  ASSERT_EQ(config.bodies.size(), 2u);
  const BodyConfig &cloth = config.bodies[0], &finger = config.bodies[1];
  EXPECT_EQ(cloth.body.name, "cloth");
  EXPECT_EQ(cloth.topic, "/tracker/cloth");
  EXPECT_EQ(cloth.input.source, TopologySource::GRID);
  EXPECT_EQ(cloth.input.rows * cloth.input.cols, 600u);
  for (const Index vertex : cloth.body.vertex_mask) EXPECT_LT(vertex, 600u);
  EXPECT_EQ(config.monitor.clock_body, 0u);
  EXPECT_EQ(finger.body.name, "finger");
  EXPECT_TRUE(finger.isRigid());
  EXPECT_FALSE(finger.body.against_obstacle);
  // The mesh is one that the package brings, in metres as the page says.
  const std::string package = "package://deformable_ccd/";
  ASSERT_EQ(finger.mesh_file.rfind(package, 0), 0u) << finger.mesh_file;
  const MeshResource mesh = loadMeshResource(
      std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/" + finger.mesh_file.substr(package.size()), finger.mesh_scale);
  for (const Vec3& position : mesh.positions) EXPECT_LT(position.norm(), 0.1);
  EXPECT_GE(mesh.topology->faces().size(), 12u);
}

using Defaults = std::map<std::string, std::string>;

/// A default as the page writes it: none for what is empty.
std::string shown(const std::string& text) { return text.empty() ? "none" : "`" + text + "`"; }
std::string shown(bool value) { return value ? "true" : "false"; }
std::string shown(double value) {
  std::ostringstream text;
  text << std::setprecision(15) << value;
  return text.str();
}
std::string shown(std::size_t value) { return std::to_string(value); }

/// The defaults that the code gives a body of a list with nothing set. Of rigid/mesh and rigid/frame there is none:
/// they are needed, as the test below sees.
Defaults defaultsInTheCode() {
  XmlRpcValue tree;
  tree["bodies"]["NAME"]["motion"] = "stream";  // XML-RPC has no empty section; the default is that of `single`
  tree["bodies"]["pad"]["rigid"]["mesh"] = "pad.stl";
  tree["bodies"]["pad"]["rigid"]["frame"] = "pad";
  const MonitorConfig config = readConfig(tree);
  const BodyConfig &body = config.bodies.at(0), &pad = config.bodies.at(1);
  EXPECT_FALSE(pad.body.self_collision) << "the page says so";
  const auto source = body.input.source == TopologySource::AUTO ? "auto" : "another";
  return {
      {"topic", body.topic},
      {"type", shown(body.input.type)},
      {"frame_id", shown(body.input.frame_id)},
      {"topology/source", shown(std::string(source))},
      {"topology/rows", shown(body.input.rows)},
      {"topology/cols", shown(body.input.cols)},
      {"topology/file", shown(body.topology_file)},
      {"topology/max_edge_m", shown(body.input.depth.max_edge_m)},
      {"topology/stride", shown(body.input.depth.stride)},
      {"topology/max_range_m", shown(body.input.depth.max_range_m)},
      {"topology/median", shown(body.input.depth.median)},
      {"marker/namespace", body.input.marker_namespace ? "set" : "none"},
      {"marker/id", body.input.marker_id ? "set" : "none"},
      {"motion", body.body.motion == BodyMotionKind::STREAM ? "`stream`" : "`static`"},
      {"topology/sets", body.sets.empty() ? "{}" : "set"},
      {"vertex_mask", body.body.vertex_mask.empty() ? "[]" : "set"},
      {"self_collision", shown(body.body.self_collision)},
      {"against_bodies", shown(body.body.against_bodies)},
      {"against_obstacle", shown(body.body.against_obstacle)},
      {"shell", shown(body.body.shell)},
      {"minimum_separation_m", shown(body.body.minimum_separation_m)},
      {"own_voxels_m", shown(body.body.own_voxels_m)},
      {"uncertainty/radius_m", shown(body.input.noise_radius_m)},
      {"max_speed_m_s", body.speed.max_m_s == SpeedBound::NONE ? "`none`" : shown(body.speed.max_m_s)},
      {"max_acceleration_m_s2", shown(body.max_acceleration_m_s2)},
      {"slows_down", shown(body.speed.slows_down)},
      {"carried_by", shown(body.carried_by)},
      {"max_relative_speed_m_s", body.speed.relative_m_s == SpeedBound::NONE ? "none" : "set"},
      {"uncertainty/field", shown(body.input.noise_field)},
      {"rigid/mesh", "none"},
      {"rigid/frame", "none"},
      {"rigid/scale", shown(pad.mesh_scale)},
  };
}

std::vector<std::string> split(const std::string& text, const std::string& separator) {
  std::vector<std::string> parts;
  std::size_t at = 0;
  for (std::size_t end; (end = text.find(separator, at)) != std::string::npos; at = end + separator.size()) {
    parts.push_back(text.substr(at, end - at));
  }
  parts.push_back(text.substr(at));
  return parts;
}

/// Of the table between two headings: name to default. In a row of several, the following have the section of the
/// first.
Defaults defaultsOnThePage(const std::string& from, const std::string& to) {
  Defaults defaults;
  for (const std::string& line : split(between(interfacePage(), from, to), "\n")) {
    if (line.rfind("| `", 0) != 0) continue;
    const std::vector<std::string> cells = split(line, " | ");
    const std::vector<std::string> names = split(cells.at(0).substr(2), ", "), values = split(cells.at(1), ", ");
    EXPECT_EQ(names.size(), values.size()) << line;
    std::string section;
    for (std::size_t i = 0; i < std::min(names.size(), values.size()); ++i) {
      std::string name = names[i].substr(1, names[i].size() - 2);
      const std::size_t slash = name.rfind('/');
      if (slash != std::string::npos)
        section = name.substr(0, slash + 1);
      else
        name = section + name;
      EXPECT_TRUE(defaults.emplace(name, values[i]).second) << name << " stands twice";
    }
  }
  return defaults;
}

TEST(InterfacePage, DefaultsOfABodyAreTheCodes) {
  EXPECT_EQ(defaultsOnThePage("\nPer body", "### Time and memory"), defaultsInTheCode());
  XmlRpcValue rigid;
  rigid["bodies"]["cloth"]["topic"] = "cloth";
  rigid["bodies"]["pad"]["rigid"]["frame"] = "pad";
  EXPECT_TRUE(mentions(errorOf(rigid), "rigid/mesh is needed")) << errorOf(rigid);
  rigid["bodies"]["pad"]["rigid"] = XmlRpcValue();
  rigid["bodies"]["pad"]["rigid"]["mesh"] = "pad.stl";
  EXPECT_TRUE(mentions(errorOf(rigid), "rigid/frame is needed")) << errorOf(rigid);
}

template <class T>
std::string plain(const T& value) {
  std::ostringstream text;
  text << std::boolalpha << value;
  return text.str();
}

/// The same number in two notations, or the same word.
bool same(const std::string& page, const std::string& code) {
  const std::regex number("[-+0-9.e]*[0-9]");
  if (!std::regex_match(page, number) || !std::regex_match(code, number)) return page == code;
  return std::stod(page) == std::stod(code);
}

Defaults inForceOfTheNode() {
  MonitorConfig config = readConfig(XmlRpcValue());
  limitLive(config);
  const MonitorOptions& monitor = config.monitor;
  const Options& detector = monitor.detector;
  const RobotConfig robot;
  constexpr std::size_t MB = std::size_t{1} << 20;
  return {{"accuracy", toString(detector.accuracy.rung)},
          {"num_threads", plain(detector.num_threads)},
          {"record_steps", plain(config.record_steps)},
          {"step_budget_ms", plain(detector.step_budget_ms)},
          {"minimum_separation_m", plain(config.minimum_separation_m)},
          {"max_step_s", plain(monitor.store.max_step_s)},
          {"max_vertex_step_m", plain(monitor.store.max_vertex_step_m)},
          {"look_ahead_s", plain(monitor.look_ahead_s)},
          {"clearance/max_m", plain(detector.clearance.max_m)},
          {"clearance/self_m", plain(detector.clearance.self_m)},
          {"max_contacts", plain(detector.max_contacts)},
          {"max_memory_mb", plain(config.max_memory_bytes / MB)},
          {"octomap_topic", config.octomap_topic},
          {"obstacle_cloud_topic", config.clouds.front().topic},
          {"obstacle_resolution_m", plain(config.cloud_map.resolution_m)},
          {"obstacle_min_range_m", plain(config.cloud_map.min_range_m)},
          {"obstacle_max_range_m", plain(config.cloud_map.max_range_m)},
          {"obstacle_no_return", config.cloud_map.no_return_clears ? "clears" : "stays"},
          {"own_voxels_m", plain(config.own_voxels_m)},
          {"own_voxels_lag_s", plain(monitor.own_voxels_lag_s)},
          {"own_voxels_doubt", monitor.own_voxels_trust ? "trust" : "unproved"},
          {"octomap_timeout_s", plain(monitor.octomap_timeout_s)},
          {"max_map_mb", plain(config.max_map_bytes / MB)},
          {"unknown_space", config.unknown_space == UnknownSpace::FREE ? "free" : "another"},
          {"answer_timeout_s", plain(config.answer_timeout_s)},
          {"transform_timeout_s", plain(config.transform_timeout_s)},
          {"sync_timeout_s", plain(monitor.sync_timeout_s)},
          {"queue_size", plain(config.queue_size)},
          {"queue_policy", config.queue_policy == QueuePolicy::NEWEST ? "newest" : "other"},
          {"rigid_tolerance_m", plain(detector.rigid_tolerance_m)},
          {"effects/NAME", toString(config.effects.at(Effect::SELF_COLLISION))},
          {"markers/point_size_m", plain(config.markers.point_size_m)},
          {"markers/mesh", plain(config.markers.mesh)},
          {"markers/obstacle_m", plain(config.markers.obstacle_m)},
          {"robot/padding_m", plain(robot.padding_m)},
          {"robot/max_own_voxels", plain(robot.max_own_voxels)},
          {"robot/own_voxels_m", robot.own_voxels_m == ONE_VOXEL ? "auto" : plain(robot.own_voxels_m)},
          {"max_speed_m_s", config.speed.max_m_s == SpeedBound::NONE ? "none" : plain(config.speed.max_m_s)},
          {"max_acceleration_m_s2", plain(config.max_acceleration_m_s2)},
          {"speed_scale/uncertainty_m", plain(SpeedLaw().uncertainty_m)},
          {"robot/against_links", plain(robot.against_links)},
          {"robot/against_map", plain(robot.against_map)},
          {"robot/visuals", plain(robot.visuals)},
          {"robot/holds", robot.holds.empty() ? "{}" : "set"},
          {"default_topic", config.bodies.at(0).topic}};
}

TEST(InterfacePage, DefaultsOfTheNodeAreThoseInForceWhereNoneIsGiven) {
  Defaults page;
  for (const auto& [name, value] : defaultsOnThePage("\n## Parameters", "\nPer body")) {
    page[name] = std::regex_replace(value, std::regex("`| \\(.*\\)"), "");
  }
  for (const auto& [name, value] : inForceOfTheNode()) {
    ASSERT_TRUE(page.count(name)) << name << " is not on the page";
    EXPECT_TRUE(same(page[name], value)) << name << ": the page says " << page[name] << ", in force is " << value;
    page.erase(name);
  }
  // These have a sentence or nothing in place of a value.
  std::set<std::string> others;
  for (const auto& row : page) others.insert(row.first);
  const std::set<std::string> without{"clock_body",
                                      "exclude_boxes",
                                      "expected_contacts",
                                      "fixed_frame",
                                      "intent/deviation_m",
                                      "intent/deviation_rate_m_s",
                                      "intent/horizon_s",
                                      "limits/horizon_s",
                                      "limits/max_m",
                                      "minimum_separation_pairs",
                                      "obstacle_box",
                                      "obstacle_cloud_topics",
                                      "octomap_file",
                                      "octomap_frame",
                                      "phase",
                                      "robot/description",
                                      "robot/leave_out",
                                      "robot/links",
                                      "robot/max_speed_m_s",
                                      "robot/semantic",
                                      "speed_scale/reaction_time_s",
                                      "speed_scale/stopping_time_s"};
  EXPECT_EQ(others, without);
}

}  // namespace
}  // namespace test
}  // namespace dccd
