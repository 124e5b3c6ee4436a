// Mistakes in the parameters of the node: each is refused with its name, its value or line, and what to write.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>

#include "support/said.h"
#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

TEST(Parameters, UnknownNamesAreRefusedWithTheNearest) {
  XmlRpcValue tree;
  tree["max_stp_s"] = 0.5;
  EXPECT_TRUE(mentions(errorOf(tree), "~max_stp_s")) << errorOf(tree);
  EXPECT_TRUE(mentions(errorOf(tree), "~max_step_s")) << errorOf(tree);
  XmlRpcValue nested;
  nested["topology"]["rwos"] = 3;
  EXPECT_TRUE(mentions(errorOf(nested), "~topology/rwos")) << errorOf(nested);
  EXPECT_TRUE(mentions(errorOf(nested), "~topology/rows")) << errorOf(nested);
}

TEST(Parameters, WordsForTheMapAndTheBodyItselfAreNoNames) {
  for (const std::string name : {"octomap", "self"}) {
    XmlRpcValue tree;
    tree["bodies"]["cloth"]["topic"] = "/cloth";
    tree["bodies"][name]["topic"] = "/other";
    EXPECT_TRUE(mentions(errorOf(tree), "~bodies/" + name + " is no name for a body")) << errorOf(tree);
    EXPECT_TRUE(mentions(errorOf(tree), "octomap is the map, and self is the body itself; give it another one"));
  }
}

TEST(Parameters, WrongTypesAreRefused) {
  XmlRpcValue text;
  text["tolerance_m"] = "1e-6";
  EXPECT_TRUE(mentions(errorOf(text), "~tolerance_m is a string")) << errorOf(text);
  EXPECT_TRUE(mentions(errorOf(text), "1.0e-6")) << "the usual mistake is named";
  XmlRpcValue number;
  number["num_threads"] = 1.5;
  EXPECT_TRUE(mentions(errorOf(number), "integer")) << errorOf(number);
  XmlRpcValue section;
  section["topology"] = "grid";
  EXPECT_TRUE(mentions(errorOf(section), "section")) << errorOf(section);
}

TEST(Parameters, ContradictionsSayWhatToWrite) {
  struct Case {
    const char* expected;
    std::function<void(XmlRpcValue&)> set;
  };
  const Case cases[] = {
      {"~accuracy is 'exactly', it must be one of conservative, exact; nearest is 'exact'",
       [](XmlRpcValue& t) { t["accuracy"] = "exactly"; }},
      {"~record_stesp is not known; nearest is ~record_steps", [](XmlRpcValue& t) { t["record_stesp"] = 3; }},
      {"~record_directory is not known; nearest is ~record_folder",
       [](XmlRpcValue& t) { t["record_directory"] = "steps"; }},
      {"both or neither", [](XmlRpcValue& t) { t["topology"]["rows"] = 3; }},
      {"the map is to come both from the clouds on obstacle_cloud_topic '/points' and from octomap_topic '/map'; "
       "remove one of the two",
       [](XmlRpcValue& t) {
         t["obstacle_cloud_topic"] = "/points";
         t["octomap_topic"] = "/map";
       }},
      {"~obstacle_resolution_m is 0.0005, too fine for obstacle_max_range_m 5: a ray has 4096 voxels at most; write at "
       "least 0.0012207",
       [](XmlRpcValue& t) {
         t["obstacle_resolution_m"] = 0.0005;
         t["obstacle_max_range_m"] = 5.0;
       }},
      {"~obstacle_resolution_m is nan",
       [](XmlRpcValue& t) { t["obstacle_resolution_m"] = std::numeric_limits<double>::quiet_NaN(); }},
      {"~obstacle_max_range_m is -1", [](XmlRpcValue& t) { t["obstacle_max_range_m"] = -1.0; }},
      {"~sensor_model/hit is 0.3", [](XmlRpcValue& t) { t["sensor_model"]["hit"] = 0.3; }},
      {"~sensor_model/mis is not known; nearest is ~sensor_model/min",
       [](XmlRpcValue& t) { t["sensor_model"]["mis"] = 0.3; }},
      {"~accuracy is 'exact', which cannot hold a distance above 0; parameter ~minimum_separation_m asks for a minimum "
       "separation: write accuracy: conservative",
       [](XmlRpcValue& t) {
         t["accuracy"] = "exact";
         t["minimum_separation_m"] = 0.01;
       }},
      {"~bodies/cloth/minimum_separation_m asks for a minimum separation: write accuracy: conservative",
       [](XmlRpcValue& t) {
         t["accuracy"] = "exact";
         t["bodies"]["cloth"]["minimum_separation_m"] = 0.01;
       }},
      {"~minimum_separation_pairs asks for",
       [](XmlRpcValue& t) {
         t["accuracy"] = "exact";
         t["minimum_separation_pairs"][0] = separationPair("mesh", "octomap", 0.01);
       }},
      {"~uncertainty asks for an uncertainty radius: write accuracy: conservative",
       [](XmlRpcValue& t) {
         t["accuracy"] = "exact";
         t["uncertainty"]["radius_m"] = 0.01;
       }},
      {"~own_voxels_m is -1, it must be from 0", [](XmlRpcValue& t) { t["own_voxels_m"] = -1; }},
      {"~own_voxels_m is inf, it must be from 0", [](XmlRpcValue& t) { t["own_voxels_m"] = INFINITY; }},
      {"~own_voxels_m is 'automatic', it must be one of auto", [](XmlRpcValue& t) { t["own_voxels_m"] = "automatic"; }},
      {"~bodies/cloth/own_voxels_m is nan", [](XmlRpcValue& t) { t["bodies"]["cloth"]["own_voxels_m"] = NAN; }},
      {"~own_voxels_lag_s is 11, it must be from 0 to 10", [](XmlRpcValue& t) { t["own_voxels_lag_s"] = 11; }},
      {"~own_voxels_doubt is 'none', it must be one of unproved, trust",
       [](XmlRpcValue& t) { t["own_voxels_doubt"] = "none"; }},
      {"with unknown_space: occupied a body's own voxels cannot be told from what is unknown; write unknown_space: "
       "report",
       [](XmlRpcValue& t) {
         t["own_voxels_m"] = "auto";
         t["unknown_space"] = "occupied";
         for (int i = 0; i < 6; ++i) t["unknown_box"][i] = i < 3 ? 0.0 : 1.0;
       }},
      {"~minimum_separation_m is -0.1, it must be from 0", [](XmlRpcValue& t) { t["minimum_separation_m"] = -0.1; }},
      {"~minimum_separation_m is nan, it must be from 0", [](XmlRpcValue& t) { t["minimum_separation_m"] = NAN; }},
      {"~minimum_separation_m is inf, it must be from 0", [](XmlRpcValue& t) { t["minimum_separation_m"] = INFINITY; }},
      {"~bodies/cloth/minimum_separation_m is -1, it must be from 0",
       [](XmlRpcValue& t) { t["bodies"]["cloth"]["minimum_separation_m"] = -1; }},
      {"minimum_separation_pairs[0]/separation_m is nan",
       [](XmlRpcValue& t) { t["minimum_separation_pairs"][0] = separationPair("mesh", "mesh", NAN); }},
      {"names 'mush', which is no body and not octomap; nearest is 'mesh'",
       [](XmlRpcValue& t) { t["minimum_separation_pairs"][0] = separationPair("mush", "octomap", 0.01); }},
      {"names octomap twice",
       [](XmlRpcValue& t) { t["minimum_separation_pairs"][0] = separationPair("octomap", "octomap", 0.01); }},
      {"minimum_separation_pairs[1]/between names mesh and octomap, as minimum_separation_pairs[0] does",
       [](XmlRpcValue& t) {
         t["minimum_separation_pairs"][0] = separationPair("octomap", "mesh", 0.01);
         t["minimum_separation_pairs"][1] = separationPair("mesh", "octomap", 0.01);
       }},
      {"minimum_separation_pairs[2]/between names finger and felt, as minimum_separation_pairs[0] does",
       [](XmlRpcValue& t) {
         t["bodies"]["felt"]["topic"] = "felt";
         t["bodies"]["finger"]["topic"] = "finger";
         t["minimum_separation_pairs"][0] = separationPair("felt", "finger", 0.004);
         t["minimum_separation_pairs"][1] = separationPair("felt", "felt", 0.004);
         t["minimum_separation_pairs"][2] = separationPair("finger", "felt", 0.01);
       }},
      {"~clearance/tolerance_m is 0, it must be from 1e-09 to 1",
       [](XmlRpcValue& t) { t["clearance"]["tolerance_m"] = 0; }},
      {"~clearance/tolerance_m is nan", [](XmlRpcValue& t) { t["clearance"]["tolerance_m"] = NAN; }},
      {"~clearance/max_m is -1, it must be from", [](XmlRpcValue& t) { t["clearance"]["max_m"] = -1; }},
      {"~clearance/max_m is inf, it must be from", [](XmlRpcValue& t) { t["clearance"]["max_m"] = INFINITY; }},
      {"~clearance/self_m is -0.5, it must be from", [](XmlRpcValue& t) { t["clearance"]["self_m"] = -0.5; }},
      {"~clearance/max is not known; nearest is ~clearance/max_m", [](XmlRpcValue& t) { t["clearance"]["max"] = 1.0; }},
      {"~clearance is a boolean, a section is needed", [](XmlRpcValue& t) { t["clearance"] = true; }},
      {"~uncertainty/radius_m is -0.1", [](XmlRpcValue& t) { t["uncertainty"]["radius_m"] = -0.1; }},
      {"~uncertainty/scale has no meaning without field", [](XmlRpcValue& t) { t["uncertainty"]["scale"] = 3.0; }},
      {"nearest is 'exact'", [](XmlRpcValue& t) { t["accuracy"] = "exakt"; }},
      {"topology/file", [](XmlRpcValue& t) { t["topology"]["source"] = "file"; }},
      {"clock_body", [](XmlRpcValue& t) { t["clock_body"] = "sleeve"; }},
      {"unknown_box", [](XmlRpcValue& t) { t["unknown_space"] = "occupied"; }},
      {"rigid and cannot meet itself",
       [](XmlRpcValue& t) {
         t["bodies"]["cloth"]["topic"] = "cloth";
         t["bodies"]["finger"]["rigid"]["mesh"] = "finger.stl";
         t["bodies"]["finger"]["rigid"]["frame"] = "finger";
         t["bodies"]["finger"]["self_collision"] = true;
       }},
      {"~topology/stride has no meaning without source: depth_image",
       [](XmlRpcValue& t) { t["topology"]["stride"] = 2; }},
      {"~bodies/seen/motion must be static with topology/source depth_image",
       [](XmlRpcValue& t) { t["bodies"]["seen"]["topology"]["source"] = "depth_image"; }},
      {"~bodies/seen/topology/median must be odd",
       [](XmlRpcValue& t) {
         depthImage(t);
         t["bodies"]["seen"]["topology"]["median"] = 4;
       }},
      {"~bodies/seen/topology/rows has no meaning for a depth image",
       [](XmlRpcValue& t) {
         depthImage(t);
         t["bodies"]["seen"]["topology"]["rows"] = 480;
         t["bodies"]["seen"]["topology"]["cols"] = 640;
       }},
      {"~bodies/seen/topology/file has no meaning for a depth image",
       [](XmlRpcValue& t) {
         depthImage(t);
         t["bodies"]["seen"]["topology"]["file"] = "a.ply";
       }},
      {"~bodies/seen/vertex_mask has no meaning for a depth image",
       [](XmlRpcValue& t) {
         depthImage(t);
         t["bodies"]["seen"]["vertex_mask"][0] = 1;
       }},
      {"is one view of a surface and cannot meet itself",
       [](XmlRpcValue& t) {
         depthImage(t);
         t["bodies"]["seen"]["self_collision"] = true;
       }},
      {"cannot be chosen: no body is a stream of meshes", [](XmlRpcValue& t) { depthImage(t); }},
  };
  for (const Case& one : cases) {
    XmlRpcValue tree;
    one.set(tree);
    EXPECT_TRUE(mentions(errorOf(tree), one.expected)) << one.expected << ": " << errorOf(tree);
  }
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
