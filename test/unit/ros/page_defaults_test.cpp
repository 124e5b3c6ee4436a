// doc/interface.md gives the default of each parameter of the node: it is the one that is in force where none is given.
#include <gtest/gtest.h>

#include <fstream>
#include <iomanip>
#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "config/monitor_config.h"

namespace dccd {
namespace {

using Defaults = std::map<std::string, std::string>;

/// Of the table of the node's own parameters, by name; numbers as the code would write them. A row may name several,
/// of which the following have the section of the first.
Defaults onThePage() {
  std::ifstream page(std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/doc/interface.md");
  const std::regex row("\\| (`.*?`) \\| ([^|]+?) \\|.*"), separator(", "), dressing("`| \\(.*\\)");
  Defaults found;
  std::string line;
  while (std::getline(page, line) && line != "## Parameters") continue;
  while (std::getline(page, line) && line.rfind("Per body", 0) != 0) {
    std::smatch cells;
    if (!std::regex_match(line, cells, row)) continue;
    const auto list = [&](const std::string& text) {
      return std::vector<std::string>{std::sregex_token_iterator(text.begin(), text.end(), separator, -1), {}};
    };
    const std::vector<std::string> names = list(cells[1]), values = list(cells[2]);
    std::string section;
    for (std::size_t i = 0; i < names.size(); ++i) {
      std::string name = std::regex_replace(names[i], dressing, "");
      if (name.find('/') != std::string::npos) {
        section = name.substr(0, name.rfind('/') + 1);
      } else {
        name = section + name;
      }
      EXPECT_LT(i, values.size()) << line;
      if (i < values.size()) found[name] = std::regex_replace(values[i], dressing, "");
    }
  }
  return found;
}

template <class T>
std::string shown(const T& value) {
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

Defaults inForce() {
  MonitorConfig config = readConfig(XmlRpc::XmlRpcValue());
  limitLive(config);
  const MonitorOptions& monitor = config.monitor;
  const Options& detector = monitor.detector;
  const RobotConfig robot;
  constexpr std::size_t MB = std::size_t{1} << 20;
  return {{"accuracy", toString(detector.accuracy.rung)},
          {"tolerance_m", shown(detector.accuracy.tolerance_m)},
          {"toc_bits", shown(detector.accuracy.toc_bits)},
          {"max_subdivisions", shown(detector.accuracy.max_subdivisions)},
          {"num_threads", shown(detector.num_threads)},
          {"record_steps", shown(config.record_steps)},
          {"simd_target", config.simd_target},
          {"step_budget_ms", shown(detector.step_budget_ms)},
          {"minimum_separation_m", shown(config.minimum_separation_m)},
          {"max_step_s", shown(monitor.store.max_step_s)},
          {"max_vertex_step_m", shown(monitor.store.max_vertex_step_m)},
          {"look_ahead_s", shown(monitor.look_ahead_s)},
          {"max_contacts", shown(detector.max_contacts)},
          {"earliest_only", shown(detector.earliest_only)},
          {"max_memory_mb", shown(config.max_memory_bytes / MB)},
          {"max_compute_s", shown(detector.max_compute_ms / 1e3)},
          {"initial_contacts", detector.suppress_initial ? "suppress" : "report"},
          {"octomap_topic", config.octomap_topic},
          {"obstacle_cloud_topic", config.cloud_topic},
          {"obstacle_resolution_m", shown(config.cloud_map.resolution_m)},
          {"obstacle_max_range_m", shown(config.cloud_map.max_range_m)},
          {"sensor_model/hit", shown(config.cloud_map.hit)},
          {"sensor_model/miss", shown(config.cloud_map.miss)},
          {"sensor_model/min", shown(config.cloud_map.min)},
          {"sensor_model/max", shown(config.cloud_map.max)},
          {"own_voxels_m", shown(config.own_voxels_m)},
          {"own_voxels_lag_s", shown(monitor.own_voxels_lag_s)},
          {"own_voxels_doubt", monitor.own_voxels_trust ? "trust" : "unproved"},
          {"octomap_timeout_s", shown(monitor.octomap_timeout_s)},
          {"max_map_mb", shown(config.max_map_bytes / MB)},
          {"unknown_space", config.unknown_space == UnknownSpace::FREE ? "free" : "another"},
          {"answer_timeout_s", shown(config.answer_timeout_s)},
          {"transform_timeout_s", shown(config.transform_timeout_s)},
          {"patch_gap_s", shown(monitor.patch_gap_s)},
          {"sync_timeout_s", shown(monitor.sync_timeout_s)},
          {"queue_size", shown(config.queue_size)},
          {"queue_policy", config.queue_policy == QueuePolicy::NEWEST ? "newest" : "oldest"},
          {"rigid_tolerance_m", shown(detector.rigid_tolerance_m)},
          {"max_substeps", shown(detector.max_substeps)},
          {"effects/NAME", toString(config.effects.at(Effect::SELF_COLLISION))},
          {"markers/point_size_m", shown(config.markers.point_size_m)},
          {"markers/normal_length_m", shown(config.markers.normal_length_m)},
          {"markers/line_width_m", shown(config.markers.line_width_m)},
          {"markers/max_contacts", shown(config.markers.max_contacts)},
          {"markers/mesh", shown(config.markers.mesh)},
          {"markers/obstacle_m", shown(config.markers.obstacle_m)},
          {"robot/timeout_s", shown(robot.timeout_s)},
          {"robot/padding_m", shown(robot.padding_m)},
          {"robot/own_voxels_m", robot.own_voxels_m == ONE_VOXEL ? "auto" : shown(robot.own_voxels_m)},
          {"robot/scale", shown(robot.scale)},
          {"robot/against_links", shown(robot.against_links)},
          {"robot/against_map", shown(robot.against_map)},
          {"default_topic", config.bodies.at(0).topic}};
}

TEST(PageDefaults, AreThoseInForceWhereNoneIsGiven) {
  Defaults page = onThePage();
  for (const auto& [name, value] : inForce()) {
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
                                      "minimum_separation_pairs",
                                      "octomap_file",
                                      "octomap_frame",
                                      "phase",
                                      "record_folder",
                                      "robot/description",
                                      "robot/leave_out",
                                      "robot/links",
                                      "robot/semantic"};
  EXPECT_EQ(others, without);
}

}  // namespace
}  // namespace dccd
