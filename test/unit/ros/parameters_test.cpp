#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <set>

#include "config/monitor_config.h"

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

TEST(Parameters, NoneAtAllIsOneBodyWithDefaults) {
  const MonitorConfig config = readConfig(XmlRpcValue());
  ASSERT_EQ(config.bodies.size(), 1u);
  EXPECT_EQ(config.bodies[0].topic, "mesh");
  EXPECT_EQ(config.monitor.detector.accuracy.rung, Accuracy::EXACT);
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

TEST(Parameters, ContradictionsSayWhatToWrite) {
  struct Case {
    const char* expected;
    std::function<void(XmlRpcValue&)> set;
  };
  const Case cases[] = {
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
         t["accuracy"] = "fast";
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
  };
  for (const Case& one : cases) {
    XmlRpcValue tree;
    one.set(tree);
    EXPECT_TRUE(mentions(errorOf(tree), one.expected)) << one.expected << ": " << errorOf(tree);
  }
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
  EXPECT_EQ(off.monitor.detector.accuracy.rung, Accuracy::EXACT) << "what is off asks for nothing";
  EXPECT_FALSE(off.holdsDistance());
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

TEST(Parameters, YamlReadsAsTheParameterServerWould) {
  const std::string file = ::testing::TempDir() + "monitor_parameters.yaml";
  std::ofstream(file) << "fixed_frame: world\nmax_step_s: 1\nweld: off\ntopology: {source: grid, rows: 3, cols: 4}\n"
                         "exclude_boxes: [[0, 0, 0, 1, 1.5, 1]]\n";
  const MonitorConfig config = readConfig(readYaml(file), file + ": ");
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

}  // namespace
}  // namespace dccd
