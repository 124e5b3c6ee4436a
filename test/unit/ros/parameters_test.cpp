#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <iomanip>
#include <iterator>
#include <map>
#include <set>
#include <sstream>

#include "config/monitor_config.h"
#include "input/mesh_resource.h"

namespace dccd {
namespace {

using XmlRpc::XmlRpcValue;

std::string errorOf(XmlRpcValue tree) {
  try {
    readConfig(tree);
  } catch (const ParameterError& error) {
    return error.what();
  }
  return "";
}

bool mentions(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

XmlRpcValue separationPair(const std::string& a, const std::string& b, double separation_m) {
  XmlRpcValue pair;
  pair["between"][0] = a;
  pair["between"][1] = b;
  pair["separation_m"] = separation_m;
  return pair;
}

/// A body `seen` that is a depth camera's cloud, and nothing else.
void depthImage(XmlRpcValue& tree) {
  tree["bodies"]["seen"]["motion"] = "static";
  tree["bodies"]["seen"]["topology"]["source"] = "depth_image";
}

TEST(Parameters, NoneAtAllIsOneBodyWithDefaults) {
  const MonitorConfig config = readConfig(XmlRpcValue());
  ASSERT_EQ(config.bodies.size(), 1u);
  EXPECT_EQ(config.bodies[0].topic, "mesh");
  EXPECT_EQ(config.monitor.detector.accuracy.rung, Accuracy::EXACT);
}

// Only what nobody named may be missing in silence.
TEST(Parameters, AMapIsNamedByItsTopicItsFileOrItsEffectButNotByADefault) {
  const MonitorConfig none = readConfig(XmlRpcValue());
  EXPECT_EQ(none.octomap_topic, "octomap_binary");
  EXPECT_FALSE(none.namesOctomap());
  EXPECT_FALSE(none.bodies[0].topic_named);
  const auto with = [](const std::function<void(XmlRpcValue&)>& set) {
    XmlRpcValue tree;
    set(tree);
    return readConfig(tree);
  };
  EXPECT_TRUE(with([](XmlRpcValue& t) { t["octomap_topic"] = "octomap_binary"; }).namesOctomap()) << "also the default";
  EXPECT_TRUE(with([](XmlRpcValue& t) { t["octomap_file"] = "/map.bt"; }).namesOctomap());
  EXPECT_TRUE(with([](XmlRpcValue& t) { t["effects"]["octomap"] = "on"; }).namesOctomap());
  EXPECT_FALSE(with([](XmlRpcValue& t) { t["effects"]["octomap"] = "auto"; }).namesOctomap());
  EXPECT_FALSE(with([](XmlRpcValue& t) {
                 t["octomap_topic"] = "/map";
                 t["effects"]["octomap"] = "off";
               }).namesOctomap());
  EXPECT_TRUE(with([](XmlRpcValue& t) { t["topic"] = "mesh"; }).bodies[0].topic_named);
  EXPECT_FALSE(with([](XmlRpcValue& t) { t["default_topic"] = "/cloth"; }).bodies[0].topic_named);
  XmlRpcValue empty;
  empty["octomap_topic"] = "";
  EXPECT_TRUE(mentions(errorOf(empty), "octomap_topic is empty; remove it")) << errorOf(empty);
}

TEST(Parameters, ADefaultTopicIsThatOfASingleBodyWithoutOne) {
  XmlRpcValue tree;
  tree["default_topic"] = "/cloth";
  EXPECT_EQ(readConfig(tree).bodies[0].topic, "/cloth");
  tree["topic"] = "mesh";
  EXPECT_EQ(readConfig(tree).bodies[0].topic, "mesh");
  XmlRpcValue listed;
  listed["default_topic"] = "/cloth";
  listed["bodies"]["mesh"]["motion"] = "stream";
  EXPECT_EQ(readConfig(listed).bodies[0].topic, "mesh");
}

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

XmlRpcValue expectation(const char* one, const char* other) {
  XmlRpcValue entry;
  entry["between"][0] = one;
  entry["between"][1] = other;
  return entry;
}

XmlRpcValue clothAndFinger() {
  XmlRpcValue tree;
  tree["bodies"]["cloth"]["topic"] = "cloth";
  tree["bodies"]["finger"]["topic"] = "finger";
  return tree;
}

TEST(ExpectedContacts, AreReadWithTheirSetsAndPhases) {
  XmlRpcValue tree = clothAndFinger();
  tree["bodies"]["cloth"]["topology"]["sets"]["hem"][0] = 3;
  tree["bodies"]["cloth"]["topology"]["sets"]["hem"][1] = 4;
  tree["expected_contacts"][0] = expectation("octomap", "cloth");
  tree["expected_contacts"][1] = expectation("cloth", "finger");
  tree["expected_contacts"][1]["vertices"]["finger"][0] = 7;
  tree["expected_contacts"][1]["vertices"]["cloth"] = "hem";
  tree["expected_contacts"][1]["phase"] = "carry";
  tree["expected_contacts"][2] = expectation("cloth", "self");
  tree["expected_contacts"][2]["vertices"]["cloth"] = "hem";
  tree["expected_contacts"][2]["phase"] = "fold";
  tree["expected_contacts"][3] = tree["expected_contacts"][2];
  tree["expected_contacts"][3]["vertices"]["self"][0] = 1;
  tree["phase"] = "carry";
  const MonitorConfig config = readConfig(tree);
  ASSERT_EQ(config.expected_contacts.size(), 4u);
  EXPECT_EQ(config.bodies[0].sets.at("hem"), (std::vector<Index>{3, 4}));
  const auto& map = config.expected_contacts[0].partners;
  EXPECT_EQ(map[0].body, 0u) << "the map comes second";
  EXPECT_EQ(map[1].body, OBSTACLE_BODY);
  EXPECT_TRUE(map[0].vertices.empty() && map[0].set.empty());
  const auto& finger = config.expected_contacts[1].partners;
  EXPECT_EQ(finger[0].set, "hem");
  EXPECT_EQ(finger[1].vertices, std::vector<Index>{7});
  const auto& both = config.expected_contacts[2].partners;
  EXPECT_EQ(both[0].body, both[1].body);
  EXPECT_EQ(both[0].set, "hem");
  EXPECT_EQ(both[1].set, "hem") << "of a body with itself the name stands for both sides";
  EXPECT_EQ(config.expected_contacts[3].partners[1].vertices, std::vector<Index>{1});
  EXPECT_EQ(config.phases(), (std::vector<std::string>{"carry", "fold"}));
  EXPECT_EQ(config.expectedIn("").size(), 1u);
  EXPECT_EQ(config.expectedIn("fold").size(), 3u);
  tree["effects"]["rigid_bodies"] = "off";
  EXPECT_EQ(readConfig(tree).expected_contacts.size(), 4u) << "none of them is rigid";
}

TEST(ExpectedContacts, OfABodyThatIsTakenAwayAreTakenAway) {
  XmlRpcValue tree;
  tree["bodies"]["arm"]["rigid"]["mesh"] = "arm.stl";
  tree["bodies"]["arm"]["rigid"]["frame"] = "arm";
  tree["bodies"]["cloth"]["topic"] = "cloth";
  tree["expected_contacts"][0] = expectation("cloth", "arm");
  tree["expected_contacts"][1] = expectation("cloth", "octomap");
  ASSERT_EQ(readConfig(tree).expected_contacts.size(), 2u);
  tree["effects"]["rigid_bodies"] = "off";
  const MonitorConfig config = readConfig(tree);
  ASSERT_EQ(config.expected_contacts.size(), 1u);
  EXPECT_EQ(config.expected_contacts[0].partners[0].body, 0u) << "the cloth is the first body now";
}

TEST(ExpectedContacts, MistakesAreNamed) {
  struct Case {
    const char* expected;
    std::function<void(XmlRpcValue&)> set;
  };
  const Case cases[] = {
      {"expected_contacts[0]/between names 'clot', which is no body and not octomap; nearest is 'cloth'",
       [](XmlRpcValue& t) { t["expected_contacts"][0] = expectation("clot", "finger"); }},
      {"expected_contacts[0]/between names self without a body",
       [](XmlRpcValue& t) { t["expected_contacts"][0] = expectation("self", "octomap"); }},
      {"expected_contacts[0]/vertices/sleeve",
       [](XmlRpcValue& t) { t["expected_contacts"][0]["vertices"]["sleeve"] = "hem"; }},
      {"expected_contacts[0]/vertices/self",
       [](XmlRpcValue& t) { t["expected_contacts"][0]["vertices"]["self"] = "hem"; }},
      {"expected_contacts[0]/vertices/cloth",
       [](XmlRpcValue& t) { t["expected_contacts"][0]["vertices"]["cloth"][0] = -1; }},
      {"expected_contacts[0]/fase", [](XmlRpcValue& t) { t["expected_contacts"][0]["fase"] = "carry"; }},
      {"~phase is 'cary', which expected_contacts does not name; known phases are 'carry', and '' for none",
       [](XmlRpcValue& t) {
         t["expected_contacts"][0]["phase"] = "carry";
         t["phase"] = "cary";
       }},
      {"~bodies/cloth/topology/sets/hem",
       [](XmlRpcValue& t) { t["bodies"]["cloth"]["topology"]["sets"]["hem"] = "1"; }},
  };
  for (const Case& one : cases) {
    XmlRpcValue tree = clothAndFinger();
    tree["expected_contacts"][0] = expectation("cloth", "finger");
    one.set(tree);
    EXPECT_TRUE(mentions(errorOf(tree), one.expected)) << errorOf(tree);
  }
}

TEST(Parameters, ContradictionsSayWhatToWrite) {
  struct Case {
    const char* expected;
    std::function<void(XmlRpcValue&)> set;
  };
  const Case cases[] = {
      {"~accuracy is 'fast', which proves nothing and is no setting of a monitor; write exact",
       [](XmlRpcValue& t) { t["accuracy"] = "fast"; }},
      {"~accuracy is 'screen', which proves nothing and is no setting of a monitor; write exact",
       [](XmlRpcValue& t) { t["accuracy"] = "screen"; }},
      {"~accuracy is 'exactly', it must be one of conservative, exact; nearest is 'exact'",
       [](XmlRpcValue& t) { t["accuracy"] = "exactly"; }},
      // Names that were once taken.
      {"~record_ring is not known; nearest is ~record_steps", [](XmlRpcValue& t) { t["record_ring"] = 3; }},
      {"~record_directory is not known; nearest is ~record_folder",
       [](XmlRpcValue& t) { t["record_directory"] = "steps"; }},
      {"both or neither", [](XmlRpcValue& t) { t["topology"]["rows"] = 3; }},
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

TEST(Parameters, ADepthImageIsHeldAgainstOtherBodiesOnly) {
  XmlRpcValue tree;
  depthImage(tree);
  tree["bodies"]["cloth"]["topic"] = "cloth";
  const MonitorConfig config = readConfig(tree);
  const BodyConfig &cloth = config.bodies.at(0), &seen = config.bodies.at(1);
  EXPECT_TRUE(seen.isDepthImage());
  EXPECT_FALSE(seen.body.self_collision);
  EXPECT_FALSE(seen.body.against_obstacle) << "the map holds what the camera saw";
  EXPECT_TRUE(seen.body.against_bodies);
  EXPECT_TRUE(cloth.body.self_collision && cloth.body.against_obstacle);
}

TEST(Parameters, ADistanceMakesItConservativeWhereNothingElseIsChosen) {
  XmlRpcValue tree;
  tree["bodies"]["felt"]["topic"] = "felt";
  tree["bodies"]["felt"]["minimum_separation_m"] = 0.01;
  tree["bodies"]["other"]["uncertainty"]["field"] = "sigma";
  tree["bodies"]["other"]["uncertainty"]["scale"] = 3.0;
  tree["minimum_separation_pairs"][0] = separationPair("octomap", "felt", 0.0);
  tree["minimum_separation_pairs"][1] = separationPair("felt", "other", 0.02);
  const MonitorConfig config = readConfig(tree);
  EXPECT_EQ(config.monitor.detector.accuracy.rung, Accuracy::CONSERVATIVE);
  EXPECT_TRUE(config.holdsDistance());
  ASSERT_EQ(config.bodies[0].body.separations.size(), 2u);
  EXPECT_EQ(config.bodies[0].body.separations[0].body, OBSTACLE_BODY);
  EXPECT_EQ(config.bodies[0].body.separations[1].body, 1u);
  EXPECT_EQ(config.bodies[1].input.noise_field, "sigma");
  EXPECT_EQ(config.bodies[1].input.noise_scale, 3.0);
  tree["effects"]["minimum_separation"] = "off";
  tree["effects"]["tracker_noise"] = "off";
  tree["accuracy"] = "exact";
  const MonitorConfig off = readConfig(tree);
  EXPECT_EQ(off.monitor.detector.excluded,
            (std::vector<std::string>{"the minimum separation by effects/minimum_separation: off",
                                      "the uncertainty of positions by effects/tracker_noise: off"}));
  EXPECT_EQ(off.monitor.detector.accuracy.rung, Accuracy::EXACT) << "what is off asks for nothing";
  EXPECT_FALSE(off.holdsDistance());
}

TEST(Parameters, TheFlowIsToldOfEachEffectThatIsOff) {
  for (int e = 0; e < static_cast<int>(Effect::COUNT); ++e) {
    const Effect effect = static_cast<Effect>(e);
    XmlRpcValue tree;
    tree["bodies"]["cloth"]["topic"] = "cloth";
    tree["effects"][toString(effect)] = "off";
    EffectSet only;
    only.add(effect);
    EXPECT_TRUE(readConfig(tree).monitor.detector.off == only) << toString(effect);
  }
}

TEST(Parameters, RigidBodiesThatAreOffAreNotThere) {
  XmlRpcValue tree;
  tree["bodies"]["a_finger"]["rigid"]["mesh"] = "no_such_file.stl";
  tree["bodies"]["a_finger"]["rigid"]["frame"] = "finger";
  tree["bodies"]["cloth"]["topic"] = "cloth";
  tree["minimum_separation_pairs"][0] = separationPair("cloth", "a_finger", 0.01);
  tree["minimum_separation_pairs"][1] = separationPair("cloth", "cloth", 0.02);
  tree["effects"]["rigid_bodies"] = "off";
  const MonitorConfig config = readConfig(tree);
  EXPECT_EQ(config.monitor.detector.excluded.size(), 1u) << "who reads ~state is told what is not there";
  EXPECT_NE(config.monitor.detector.excluded.at(0).find("by effects/rigid_bodies: off"), std::string::npos);
  ASSERT_EQ(config.bodies.size(), 1u);
  EXPECT_EQ(config.monitor.clock_body, 0u);
  ASSERT_EQ(config.bodies[0].body.separations.size(), 1u);
  EXPECT_EQ(config.bodies[0].body.separations[0].body, 0u);
}

TEST(Parameters, OnAndOffAreWordsThoughYamlTakesThemForBooleans) {
  XmlRpcValue tree;
  tree["weld"] = false;
  tree["effects"]["octomap"] = true;
  const MonitorConfig config = readConfig(tree);
  EXPECT_FALSE(config.bodies[0].input.weld);
  EXPECT_EQ(config.effects.at(Effect::OCTOMAP), EffectSetting::ON);
}

TEST(Parameters, TheHashTellsConfigurationsApart) {
  XmlRpcValue tree;
  tree["max_step_s"] = 0.25;
  const MonitorConfig config = readConfig(tree);
  EXPECT_NE(config.hash(), readConfig(XmlRpcValue()).hash());
  EXPECT_EQ(config.hash(), readConfig(tree).hash());
  tree["live"]["max_step_s"] = 0.3;
  EXPECT_EQ(readConfig(tree).hash(), config.hash()) << "what an earlier node wrote back is not in force";
}

TEST(Parameters, TheHashTellsLiveValuesApart) {
  const MonitorConfig given = readConfig(XmlRpcValue());
  const std::function<void(MonitorConfig&)> changes[] = {
      [](MonitorConfig& c) { c.monitor.detector.accuracy.rung = Accuracy::FAST; },
      [](MonitorConfig& c) { c.monitor.detector.step_budget_ms = 5; },
      [](MonitorConfig& c) { c.monitor.store.max_step_s = 0.25; },
      [](MonitorConfig& c) { c.monitor.store.max_vertex_step_m = 0.25; },
      [](MonitorConfig& c) { c.monitor.detector.max_contacts = 5; },
      [](MonitorConfig& c) { c.monitor.detector.suppress_initial = true; },
      [](MonitorConfig& c) { c.markers.point_size_m = 0.02; },
      [](MonitorConfig& c) { c.markers.normal_length_m = 0.02; },
      [](MonitorConfig& c) { c.markers.mesh = true; },
      [](MonitorConfig& c) { c.markers.obstacle_m = 0.02; },
  };
  std::set<std::uint64_t> seen{given.hash()};
  for (const auto& change : changes) {
    MonitorConfig live = given;
    change(live);
    seen.insert(live.hash());
  }
  EXPECT_EQ(seen.size(), std::size(changes) + 1);
}

TEST(Parameters, OfAFileTheLineIsNamed) {
  const auto errorIn = [](const std::string& text) -> std::string {
    try {
      readConfig(parseYaml(text, "p.yaml"), "");
    } catch (const ParameterError& error) {
      return error.what();
    }
    return "accepted";
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

TEST(Parameters, TheHashIsThatOfTheValuesWhereverTheyWereRead) {
  XmlRpcValue tree;
  tree["max_step_s"] = 0.25;
  tree["exclude_boxes"][0][0] = 0;
  for (int i = 1; i < 6; ++i) tree["exclude_boxes"][0][i] = 1.5;
  const std::string text = "exclude_boxes: [[0, 1.5, 1.5, 1.5, 1.5, 1.5]]\nmax_step_s: 0.25\n";
  EXPECT_EQ(readConfig(parseYaml(text, "p.yaml"), "").hash(), readConfig(tree).hash());
  EXPECT_NE(readConfig(parseYaml("max_step_s: 0.5\n", "p.yaml"), "").hash(), readConfig(tree).hash());
}

TEST(Parameters, YamlReadsAsTheParameterServerWould) {
  const std::string file = ::testing::TempDir() + "monitor_parameters.yaml";
  std::ofstream(file) << "fixed_frame: world\nmax_step_s: 1\nweld: off\ntopology: {source: grid, rows: 3, cols: 4}\n"
                         "exclude_boxes: [[0, 0, 0, 1, 1.5, 1]]\n";
  const MonitorConfig config = readConfig(readYaml(file), "");
  EXPECT_EQ(config.fixed_frame, "world");
  EXPECT_EQ(config.monitor.store.max_step_s, 1);
  EXPECT_FALSE(config.bodies[0].input.weld);
  EXPECT_EQ(config.bodies[0].input.cols, 4u);
  EXPECT_EQ(config.monitor.detector.exclude_boxes.at(0).max.y(), 1.5);
  std::ofstream(file) << "max_step_s: [1\n";
  EXPECT_THROW(readYaml(file), ParameterError);
  std::remove(file.c_str());
  EXPECT_THROW(readYaml(file), ParameterError);
}

// --- doc/interface.md ------------------------------------------------------------------------------------------------

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
}  // namespace dccd
