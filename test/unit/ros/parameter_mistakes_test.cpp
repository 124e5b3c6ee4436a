// Mistakes in the parameters of the node: each is refused with its name, its value or line, and what to write.
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <limits>
#include <regex>

#include "support/said.h"
#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

TEST(Parameters, UnknownNamesAreRefusedWithTheNearest) {
  expectMistakes({
      {"max_stp_s: 0.5", "~max_stp_s is not known; nearest is ~max_step_s"},
      {"topology: {rwos: 3}", "~topology/rwos is not known; nearest is ~topology/rows"},
      {"record_stesp: 3", "~record_stesp is not known; nearest is ~record_steps"},
      {"record_step: 1", "~record_step is not known; nearest is ~record_steps"},
      {"clearance: {max: 1.0}", "~clearance/max is not known; nearest is ~clearance/max_m"},
      {"rows: 20", "~rows is not known; nearest is ~topology/rows"},
      {"bodies: {cloth: {look_ahead_s: 1}}", "~bodies/cloth/look_ahead_s is not known; nearest is ~look_ahead_s"},
      {"bodies: {cloth: {topic: a, cols: 3}}",
       "~bodies/cloth/cols is not known; nearest is ~bodies/cloth/topology/cols"},
  });
}

TEST(Parameters, WordsForTheMapAndTheBodyItselfAreNoNames) {
  for (const std::string name : {"octomap", "self"}) {
    const std::string error = errorOf(parameters("bodies: {cloth: {topic: /cloth}, " + name + ": {topic: /other}}"));
    EXPECT_TRUE(mentions(error, "~bodies/" + name + " is no name for a body")) << error;
    EXPECT_TRUE(mentions(error, "octomap is the map, and self is the body itself; give it another one"));
  }
}

// A name without a value, and all but the first of several, were passed over.
TEST(Parameters, WhatAFileSaysInVainIsRefused) {
  const auto errorIn = [](const std::string& text) { return said<ParameterError>([&] { parseYaml(text, "FILE"); }); };
  EXPECT_EQ(errorIn("topic: /cloth\nminimum_separation_m:\n"),
            "FILE:2: minimum_separation_m has no value; write one, or remove the line");
  EXPECT_EQ(errorIn("bodies:\n  cloth: {topic: /a}\n  rope: {topic: /b}\n  cloth: {topic: /c}\n"),
            "FILE:4: cloth stands twice");
  EXPECT_EQ(errorIn("topic: /cloth\n---\nmax_step_s: 0.1\n"),
            "FILE: holds several documents; write one, without a line ---");
  EXPECT_EQ(errorIn("topic: /cloth\nmax_step_s: !degrees 90\n"),
            "FILE:2: the value has the tag !degrees, which is not read here; write the value without it");
  EXPECT_EQ(errorIn("topic: !!str cloth\n"),
            "FILE:1: the value has the tag tag:yaml.org,2002:str, which is not read here; write the value without it");
  EXPECT_FALSE(parseYaml("# nothing\n", "FILE").isSet());
  EXPECT_EQ(parseYaml("---\ntopic: /cloth\n", "FILE").members.at("topic").text, "/cloth");
}

TEST(Parameters, WrongTypesAreRefused) {
  expectMistakes({
      {"rigid_tolerance_m: 1e-6", "~rigid_tolerance_m is a string"},
      {"rigid_tolerance_m: 1e-6", "1.0e-6"},  // the usual mistake is named
      {"num_threads: 1.5", "integer"},
      {"topology: grid", "section"},
      {"clearance: true", "~clearance is a boolean, a section is needed"},
  });
}

// Who typed `topology:=polylin` never wrote `topology/source`.
TEST(Parameters, WhereTheArgumentHasAnotherNameTheSentenceHasBoth) {
  std::ifstream in(std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/launch/monitor.launch");
  const std::string launch{std::istreambuf_iterator<char>(in), {}};
  const std::regex row(R"re(<param if="\$\(eval arg\('(\w+)'\) not in \('', '-'\)\)" name="([^"]+)")re");
  std::size_t others = 0;
  for (std::sregex_iterator one(launch.begin(), launch.end(), row), end; one != end; ++one) {
    const std::string argument = (*one)[1], name = (*one)[2], section = name.substr(0, name.find('/'));
    XmlRpcValue tree = parameters("robot: {description: d}");
    (section == name ? tree[name] : tree[section][name.substr(section.size() + 1)]) = parameters("list: [1]")["list"];
    const std::string error = errorOf(tree);
    const std::string words = argument == name ? "" : " (" + argument + ":= of the launch files)";
    EXPECT_TRUE(mentions(error, "parameter ~" + name + words + " is a list, ")) << error;
    others += argument != name;
  }
  EXPECT_EQ(others, 8U);
  expectMistakes(
      {{"topology: {source: polylin}",
        "parameter ~topology/source (topology:= of the launch files) is 'polylin', it must be one of auto, "}});
  EXPECT_TRUE(mentions(said<ParameterError>([] { readConfig(parseYaml("topology: {source: a}", "p.yaml"), ""); }),
                       "p.yaml:1: topology/source is 'a', "))
      << "a file was typed";
}

TEST(Parameters, ValuesOutOfRangeAreRefused) {
  expectMistakes({
      {"accuracy: exactly", "~accuracy is 'exactly', it must be one of conservative, exact; nearest is 'exact'"},
      {"accuracy: exakt", "nearest is 'exact'"},
      {"obstacle_resolution_m: .nan", "~obstacle_resolution_m is nan"},
      {"obstacle_max_range_m: -1.0", "~obstacle_max_range_m is -1"},
      {"own_voxels_m: -1", "~own_voxels_m is -1, it must be from 0"},
      {"own_voxels_m: .inf", "~own_voxels_m is inf, it must be from 0"},
      {"own_voxels_m: automatic", "~own_voxels_m is 'automatic', it must be one of auto"},
      {"bodies: {cloth: {own_voxels_m: .nan}}", "~bodies/cloth/own_voxels_m is nan"},
      {"own_voxels_lag_s: 11", "~own_voxels_lag_s is 11, it must be from 0 to 10"},
      {"own_voxels_doubt: none", "~own_voxels_doubt is 'none', it must be one of unproved, trust"},
      {"minimum_separation_m: -0.1", "~minimum_separation_m is -0.1, it must be from 0"},
      {"minimum_separation_m: .nan", "~minimum_separation_m is nan, it must be from 0"},
      {"minimum_separation_m: .inf", "~minimum_separation_m is inf, it must be from 0"},
      {"bodies: {cloth: {minimum_separation_m: -1}}", "~bodies/cloth/minimum_separation_m is -1, it must be from 0"},
      {"minimum_separation_pairs: [{between: [mesh, mesh], separation_m: .nan}]",
       "minimum_separation_pairs[0]/separation_m is nan"},
      {"clearance: {tolerance_m: 0.01}", "~clearance/tolerance_m is gone: distances are known to 1e-4 m"},
      {"toc_bits: 20", "~toc_bits is gone: a time of contact is known to 2^-32 of a step; remove it"},
      {"bodies: {cloth: {weld: off}}", "~bodies/cloth/weld is gone: corners of triangles that coincide"},
      {"max_vertices: 4", "~max_vertices is gone: a mesh has at most 1000000 vertices"},
      {"sensor_model: {hit: 0.8}", "~sensor_model is gone: its numbers are octomap_server's defaults"},
      {"patch_gap_s: 0.5", "~patch_gap_s is gone: a patch that comes back within 0.25 s is the same"},
      {"robot: {description: d, timeout_s: 2}", "~robot/timeout_s is gone: the start waits"},
      {"robot: {description: d, speed_factor: 2}", "~robot/speed_factor is gone: a link's speed in the last step"},
      {"topology: {min_range_m: 0.2}", "~topology/min_range_m is gone: pixels within 0.01 m"},
      {"uncertainty: {field: sigma, scale: 3}", "~uncertainty/scale is gone: the field is a radius in metres"},
      {"robot: {description: d, scale: 2}", "~robot/scale is gone: scale single links by robot/links"},
      {"clearance: {max_m: -1}", "~clearance/max_m is -1, it must be from"},
      {"clearance: {max_m: .inf}", "~clearance/max_m is inf, it must be from"},
      {"clearance: {self_m: -0.5}", "~clearance/self_m is -0.5, it must be from"},
      {"uncertainty: {radius_m: -0.1}", "~uncertainty/radius_m is -0.1"},
  });
}

TEST(Parameters, ContradictionsSayWhatToWrite) {
  expectMistakes({
      {"topology: {rows: 3}", "both or neither"},
      {"topology: {rows: 1, cols: 4}", "~topology/rows (rows:= of the launch files) and cols must be 2 or more"},
      {"topology: {source: polyline, rows: 2, cols: 3}",
       "~topology/rows (rows:= of the launch files) has no meaning for a polyline"},
      {"topic: /a, bodies: {cloth: {topic: /b}}", "~topic (mesh:= of the launch files) has no place beside bodies"},
      {"topology: {rows: 3, cols: 4}, bodies: {cloth: {topic: /b}}",
       "~topology (topology:=, rows:= and cols:= of the launch files) has no place beside bodies; set "
       "bodies/NAME/topology instead"},
      {"exclude_boxes: [[1, 0, 0, 0, 1, 1]]", "~exclude_boxes holds a box whose min exceeds its max"},
      {"exclude_boxes: [[1, 0]]", "~exclude_boxes must hold lists of 6 numbers"},
      {"exclude_boxes: [[a, 0, 0, 1, 1, 1]]", "~exclude_boxes holds a string where a number is needed"},
      {"obstacle_cloud_topic: /points, octomap_topic: /map",
       "the map is to come both from the clouds on obstacle_cloud_topic '/points' and from octomap_topic '/map' "
       "(obstacle_cloud:= and octomap:= of the launch files); remove one of the two"},
      {"obstacle_resolution_m: 0.0005, obstacle_max_range_m: 5.0",
       "~obstacle_resolution_m is 0.0005, too fine for obstacle_max_range_m 5: a ray has 4096 voxels at most; write at "
       "least 0.0012207"},
      {"obstacle_cloud_topics: [/a, {topic: /a}]", "~obstacle_cloud_topics has '/a' twice"},
      {"obstacle_cloud_topics: [{frame: /a}]", "~obstacle_cloud_topics/0/"},
      {"obstacle_sensor_frame: b",
       "~obstacle_sensor_frame is gone: write obstacle_cloud_topics: [{topic: …, sensor_frame: …}]"},
      {"obstacle_min_range_m: 2.0, obstacle_max_range_m: 1.0",
       "~obstacle_min_range_m is 2, which leaves nothing of obstacle_max_range_m 1"},
      {"obstacle_no_return: clear", "~obstacle_no_return"},
      {"obstacle_box: [0, 0, 0, 1, -1, 1]", "~obstacle_box is empty"},
      {"accuracy: exact, minimum_separation_m: 0.01",
       "~accuracy is 'exact', which cannot hold a distance above 0; parameter ~minimum_separation_m asks for a minimum "
       "separation: write accuracy: conservative"},
      {"accuracy: exact, bodies: {cloth: {minimum_separation_m: 0.01}}",
       "~bodies/cloth/minimum_separation_m asks for a minimum separation: write accuracy: conservative"},
      {"accuracy: exact, minimum_separation_pairs: [{between: [mesh, octomap], separation_m: 0.01}]",
       "~minimum_separation_pairs asks for"},
      {"accuracy: exact, uncertainty: {radius_m: 0.01}",
       "~uncertainty asks for an uncertainty radius: write accuracy: conservative"},
      {"own_voxels_m: auto, unknown_space: occupied, unknown_box: [0.0, 0.0, 0.0, 1.0, 1.0, 1.0]",
       "with unknown_space: occupied a body's own voxels cannot be told from what is unknown; write unknown_space: "
       "free"},
      {"unknown_space: report", "unknown_space"},
      {"earliest_only: true", "~earliest_only is gone: a monitor looks for all contacts; remove it"},
      {"minimum_separation_pairs: [{between: [mush, octomap], separation_m: 0.01}]",
       "names 'mush', which is no body and not octomap; nearest is 'mesh'"},
      {"minimum_separation_pairs: [{between: [octomap, octomap], separation_m: 0.01}]", "names octomap twice"},
      {"minimum_separation_pairs: [{between: [octomap, mesh], separation_m: 0.01}, "
       "{between: [mesh, octomap], separation_m: 0.01}]",
       "minimum_separation_pairs[1]/between names mesh and octomap, as minimum_separation_pairs[0] does"},
      {"bodies: {felt: {topic: felt}, finger: {topic: finger}}, minimum_separation_pairs: "
       "[{between: [felt, finger], separation_m: 0.004}, {between: [felt, felt], separation_m: 0.004}, "
       "{between: [finger, felt], separation_m: 0.01}]",
       "minimum_separation_pairs[2]/between names finger and felt, as minimum_separation_pairs[0] does"},
      {"topology: {source: file}", "topology/file"},
      {"clock_body: sleeve", "clock_body"},
      {"unknown_space: occupied", "unknown_box"},
      {"bodies: {cloth: {topic: cloth}, finger: {rigid: {mesh: finger.stl, frame: finger}, self_collision: true}}",
       "rigid and cannot meet itself"},
      {"topology: {stride: 2}", "~topology/stride has no meaning without source: depth_image"},
      {"bodies: {seen: {topology: {source: depth_image}}}",
       "~bodies/seen/motion must be static with topology/source depth_image"},
      {"bodies: {seen: {motion: static, topology: {source: depth_image, median: 4}}}",
       "~bodies/seen/topology/median must be odd"},
      {"bodies: {seen: {motion: static, topology: {source: depth_image, rows: 480, cols: 640}}}",
       "~bodies/seen/topology/rows has no meaning for a depth image"},
      {"bodies: {seen: {motion: static, topology: {source: depth_image, file: a.ply}}}",
       "~bodies/seen/topology/file has no meaning for a depth image"},
      {"bodies: {seen: {motion: static, topology: {source: depth_image}, vertex_mask: [1]}}",
       "~bodies/seen/vertex_mask has no meaning for a depth image"},
      {"bodies: {seen: {motion: static, topology: {source: depth_image}, self_collision: true}}",
       "is one view of a surface and cannot meet itself"},
      {"bodies: {seen: {motion: static, topology: {source: depth_image}}}",
       "cannot be chosen: no body is a stream of meshes"},
  });
}

// It was told of the file's first line.
TEST(Parameters, WhatAnOptionPutsBesideAFileIsNotTheFiles) {
  ParameterTree tree = parseYaml("fixed_frame: world\nmax_step_s: 1\n", "p.yaml");
  tree.put("accuracy", "exat");
  EXPECT_EQ(said<ParameterError>([&] { readConfig(tree, ""); }),
            "parameter accuracy is 'exat', it must be one of conservative, exact; nearest is 'exact'");
}

TEST(Parameters, OfAFileTheLineIsNamed) {
  const auto errorIn = [](const std::string& text) -> std::string {
    return said<ParameterError>([&] { readConfig(parseYaml(text, "p.yaml"), ""); }, "accepted");
  };
  EXPECT_EQ(errorIn("fixed_frame: world\ntopology: {source: grid, rows: 3, cols: 4}\n"), "accepted");
  EXPECT_EQ(errorIn("fixed_frame: world\nmax_step_s: -1\n").find("p.yaml:2: max_step_s is -1, it must be from"), 0u);
  EXPECT_EQ(errorIn("topology:\n  source: grid\n  rwos: 3\n"),
            "p.yaml:3: topology/rwos is not known; nearest is topology/rows");
  EXPECT_EQ(errorIn("\ntopology: grid\n"), "p.yaml:2: topology is a string, a section is needed");
  EXPECT_EQ(errorIn("minimum_separation_pairs:\n  - {between: [mesh, mesh], separation_m: 1}\n  - {between: [mesh]}\n")
                .find("p.yaml:3: minimum_separation_pairs[1]/between must name two bodies"),
            0u);
  EXPECT_NE(errorIn("fixed_frame: &a [*a]\n").find("p.yaml:1: nests too deeply"), std::string::npos);
}

TEST(Parameters, ANumberOfAFileIsAWholeOne) {
  const auto kindOf = [](const std::string& word) { return parseYaml("a: " + word + "\n", "p.yaml").members["a"]; };
  for (const char* word : {"1.0-1", "1.0D-2", "0,5", "0x10", "0x1.8p3", "010", "-010", "1_000", "1.5f", "1:30",
                           "3000000000", "1.0e999", "."}) {
    EXPECT_EQ(kindOf(word).kind, ParameterTree::Kind::TEXT) << word;
    const std::string text =
        said<ParameterError>([&] { readConfig(parseYaml(std::string("\nmax_step_s: ") + word + "\n", "p.yaml"), ""); });
    EXPECT_TRUE(mentions(text, std::string("p.yaml:2: max_step_s is a string, a number is needed, not '") + word + "'"))
        << text;
  }
  EXPECT_EQ(kindOf("-12").integer, -12);
  EXPECT_EQ(kindOf("0").integer, 0);
  EXPECT_EQ(kindOf("00.5").number, 0.5);
  EXPECT_EQ(kindOf("-1.5e-3").number, -1.5e-3);
  EXPECT_EQ(kindOf("-.inf").number, -std::numeric_limits<double>::infinity());
  EXPECT_TRUE(std::isnan(kindOf(".nan").number));
}

}  // namespace
}  // namespace test
}  // namespace dccd
