// doc/interface.md: its example of several bodies is accepted as it stands, and the defaults of a body are the code's.
// (Those of the node itself: page_defaults_test.cpp.)
#include <gtest/gtest.h>

#include <algorithm>
#include <fstream>
#include <iomanip>
#include <iterator>
#include <map>
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
std::map<std::string, std::string> defaultsInTheCode() {
  XmlRpcValue tree;
  tree["bodies"]["NAME"]["weld"] = "on";  // XML-RPC has no empty section; the default is that of `single`
  tree["bodies"]["pad"]["rigid"]["mesh"] = "pad.stl";
  tree["bodies"]["pad"]["rigid"]["frame"] = "pad";
  const MonitorConfig config = readConfig(tree);
  const BodyConfig &body = config.bodies.at(0), &pad = config.bodies.at(1);
  EXPECT_FALSE(pad.body.self_collision) << "the page says so";
  const BodyConfig single = readConfig(XmlRpcValue()).bodies.at(0);
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
      {"weld", single.input.weld ? "`on`" : "`off`"},
      {"max_vertices", shown(body.input.max_vertices)},
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
      {"uncertainty/field", shown(body.input.noise_field)},
      {"uncertainty/scale", shown(body.input.noise_scale)},
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

/// The table of per-body parameters: name to default. In a row of several the second has the first one's section.
std::map<std::string, std::string> defaultsOnThePage() {
  std::map<std::string, std::string> defaults;
  for (const std::string& line : split(between(interfacePage(), "\nPer body", "**A whole example"), "\n")) {
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
  EXPECT_EQ(defaultsOnThePage(), defaultsInTheCode());
  XmlRpcValue rigid;
  rigid["bodies"]["cloth"]["topic"] = "cloth";
  rigid["bodies"]["pad"]["rigid"]["frame"] = "pad";
  EXPECT_TRUE(mentions(errorOf(rigid), "rigid/mesh is needed")) << errorOf(rigid);
  rigid["bodies"]["pad"]["rigid"] = XmlRpcValue();
  rigid["bodies"]["pad"]["rigid"]["mesh"] = "pad.stl";
  EXPECT_TRUE(mentions(errorOf(rigid), "rigid/frame is needed")) << errorOf(rigid);
}

}  // namespace
}  // namespace test
}  // namespace dccd
