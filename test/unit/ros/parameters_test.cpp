// What the parameters of the node make of its configuration, defaults and switches of effects included.
#include <gtest/gtest.h>

#include <cstdio>
#include <fstream>

#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

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
  const auto with = [](const std::string& yaml) { return readConfig(parameters(yaml)); };
  EXPECT_TRUE(with("octomap_topic: octomap_binary").namesOctomap()) << "also the default";
  EXPECT_TRUE(with("octomap_file: /map.bt").namesOctomap());
  EXPECT_TRUE(with("effects: {octomap: \"on\"}").namesOctomap());
  EXPECT_FALSE(with("effects: {octomap: auto}").namesOctomap());
  EXPECT_TRUE(with("obstacle_cloud_topic: /points").takesClouds());
  EXPECT_TRUE(with("obstacle_resolution_m: 0.02").namesOctomap());
  const MonitorConfig two = with(
      "obstacle_cloud_topics: [/a, {topic: /b, camera_info: /info, sensor_frame: /lens}], obstacle_box: [0, 0, 0, "
      "1, 2, 3]");
  EXPECT_TRUE(two.takesClouds());
  EXPECT_EQ(two.mapName(), "/a, /b");
  EXPECT_EQ(two.clouds.at(1).camera_info + " " + two.clouds.at(1).sensor_frame, "/info lens");
  EXPECT_EQ(two.cloud_map.box->max, Vec3(1, 2, 3));
  EXPECT_FALSE(none.takesClouds()) << "a default names nothing";
  EXPECT_FALSE(with("octomap_topic: /map, effects: {octomap: \"off\"}").namesOctomap());
  EXPECT_TRUE(with("topic: mesh").bodies[0].topic_named);
  EXPECT_FALSE(with("default_topic: /cloth").bodies[0].topic_named);
  expectMistakes({{"octomap_topic: \"\"", "~octomap_topic (octomap:= of the launch files) is empty; remove it"}});
}

// A frame of tf2 has none, so that nothing ever had a place.
TEST(Parameters, OneSlashInFrontOfAFrameIsLeftOutAsInMessages) {
  const MonitorConfig config =
      readConfig(parameters("fixed_frame: /world, octomap_frame: /map, bodies: {cloth: {frame_id: /camera}, "
                            "finger: {rigid: {mesh: no_such_file.stl, frame: /tip}}}, effects: {rigid_bodies: auto}"));
  EXPECT_EQ(config.fixed_frame, "world");
  EXPECT_EQ(config.octomap_frame, "map");
  EXPECT_EQ(config.bodies.at(0).input.frame_id, "camera");
  EXPECT_EQ(config.bodies.at(1).tf_frame, "tip");
  expectMistakes({{"fixed_frame: /", "~fixed_frame is '/', which is no frame's name: it is empty"},
                  {"octomap_frame: //map", "which is no frame's name: it begins with a slash"}});
}

TEST(Parameters, ADefaultTopicIsThatOfASingleBodyWithoutOne) {
  const auto topic = [](const char* yaml) { return readConfig(parameters(yaml)).bodies[0].topic; };
  EXPECT_EQ(topic("default_topic: /cloth"), "/cloth");
  EXPECT_EQ(topic("default_topic: /cloth, topic: mesh"), "mesh");
  EXPECT_EQ(topic("default_topic: /cloth, bodies: {mesh: {motion: stream}}"), "mesh");
}

TEST(Parameters, ADepthImageIsHeldAgainstOtherBodiesOnly) {
  const MonitorConfig config = readConfig(
      parameters("bodies: {cloth: {topic: cloth}, seen: {motion: static, topology: {source: depth_image}}}"));
  const BodyConfig &cloth = config.bodies.at(0), &seen = config.bodies.at(1);
  EXPECT_TRUE(seen.isDepthImage());
  EXPECT_FALSE(seen.body.self_collision);
  EXPECT_FALSE(seen.body.against_obstacle) << "the map holds what the camera saw";
  EXPECT_TRUE(seen.body.against_bodies);
  EXPECT_TRUE(cloth.body.self_collision && cloth.body.against_obstacle);
}

TEST(Parameters, ADistanceMakesItConservativeWhereNothingElseIsChosen) {
  XmlRpcValue tree = parameters(
      "bodies: {felt: {topic: felt, minimum_separation_m: 0.01}, other: {uncertainty: {field: sigma}}}, "
      "minimum_separation_pairs: [{between: [octomap, felt], separation_m: 0.0}, "
      "{between: [felt, other], separation_m: 0.02}]");
  const MonitorConfig config = readConfig(tree);
  EXPECT_EQ(config.monitor.detector.accuracy.rung, Accuracy::CONSERVATIVE);
  EXPECT_TRUE(config.holdsDistance());
  ASSERT_EQ(config.bodies[0].body.separations.size(), 2u);
  EXPECT_EQ(config.bodies[0].body.separations[0].body, OBSTACLE_BODY);
  EXPECT_EQ(config.bodies[0].body.separations[1].body, 1u);
  EXPECT_EQ(config.bodies[1].input.noise_field, "sigma");
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

TEST(Parameters, WhatLimitsLeaveOutOfCloudsAndPicturesIsSaid) {
  const auto excludedBy = [](const std::string& text) {
    return readConfig(parameters(text)).monitor.detector.excluded;
  };
  EXPECT_EQ(excludedBy("obstacle_cloud_topic: /points, obstacle_min_range_m: 0.3, obstacle_max_range_m: 2.5, "
                       "obstacle_box: [0, 0, 0, 1, 1, 1]"),
            (std::vector<std::string>{"what clouds show farther than 2.5 m by obstacle_max_range_m",
                                      "what clouds show nearer than 0.3 m by obstacle_min_range_m",
                                      "what clouds show outside of obstacle_box"}));
  EXPECT_TRUE(excludedBy("obstacle_cloud_topic: /points, obstacle_max_range_m: 0.0").empty());
  const std::string picture = "bodies: {cloth: {topic: cloth}, seen: {motion: static, topology: {source: depth_image, ";
  EXPECT_EQ(excludedBy(picture + "max_range_m: 4.0}}}"),
            (std::vector<std::string>{
                "what the picture of body 'seen' shows farther than 4 m by topology/max_range_m",
                "what the picture of body 'seen' shows in points that have no neighbours within topology/max_edge_m, "
                "0.05 m, and between each pixel and the next one by topology/stride, 4",
            }));
  EXPECT_EQ(excludedBy(picture + "stride: 1, max_edge_m: 0.1}}}"),
            std::vector<std::string>{"what the picture of body 'seen' shows in points that have no neighbours within "
                                     "topology/max_edge_m, 0.1 m"});
}

TEST(Parameters, RigidBodiesThatAreOffAreNotThere) {
  const MonitorConfig config = readConfig(
      parameters("bodies: {a_finger: {rigid: {mesh: no_such_file.stl, frame: finger}}, cloth: {topic: cloth}}, "
                 "minimum_separation_pairs: [{between: [cloth, a_finger], separation_m: 0.01}, "
                 "{between: [cloth, cloth], separation_m: 0.02}], effects: {rigid_bodies: \"off\"}"));
  EXPECT_EQ(config.monitor.detector.excluded.size(), 1u) << "who reads ~state is told what is not there";
  EXPECT_NE(config.monitor.detector.excluded.at(0).find("by effects/rigid_bodies: off"), std::string::npos);
  ASSERT_EQ(config.bodies.size(), 1u);
  EXPECT_EQ(config.monitor.clock_body, 0u);
  ASSERT_EQ(config.bodies[0].body.separations.size(), 1u);
  EXPECT_EQ(config.bodies[0].body.separations[0].body, 0u);
}

TEST(Parameters, DistancesHaveLimitsThatMarkersShowThemBy) {
  const MonitorConfig defaults = readConfig(XmlRpcValue());
  EXPECT_FALSE(defaults.monitor.detector.clearance.wanted) << "the plan of effects says so, in each step";
  EXPECT_EQ(defaults.monitor.detector.clearance.max_m, 0.5);
  EXPECT_EQ(defaults.monitor.detector.clearance.self_m, 0);
  EXPECT_EQ(defaults.markers.clearance_max_m, 0.5);
  const MonitorConfig given = readConfig(parameters("clearance: {max_m: 2, self_m: 0.25}"));
  EXPECT_EQ(given.monitor.detector.clearance.max_m, 2);
  EXPECT_EQ(given.monitor.detector.clearance.self_m, 0.25);
  EXPECT_EQ(given.markers.clearance_max_m, 2);
}

TEST(Parameters, OnAndOffAreWordsThoughYamlTakesThemForBooleans) {
  XmlRpcValue tree;
  tree["effects"]["body_body"] = false;
  tree["effects"]["octomap"] = true;
  const MonitorConfig config = readConfig(tree);
  EXPECT_EQ(config.effects.at(Effect::BODY_BODY), EffectSetting::OFF);
  EXPECT_EQ(config.effects.at(Effect::OCTOMAP), EffectSetting::ON);
}

TEST(Parameters, YamlReadsAsTheParameterServerWould) {
  const std::string file = ::testing::TempDir() + "monitor_parameters.yaml";
  std::ofstream(file)
      << "fixed_frame: world\nmax_step_s: 1\neffects: {octomap: off}\ntopology: {source: grid, rows: 3, cols: 4}\n"
         "exclude_boxes: [[0, 0, 0, 1, 1.5, 1]]\n";
  const MonitorConfig config = readConfig(readYaml(file), "");
  EXPECT_EQ(config.fixed_frame, "world");
  EXPECT_EQ(config.monitor.store.max_step_s, 1);
  EXPECT_EQ(config.effects.at(Effect::OCTOMAP), EffectSetting::OFF);
  EXPECT_EQ(config.bodies[0].input.cols, 4u);
  EXPECT_EQ(config.monitor.detector.exclude_boxes.at(0).max.y(), 1.5);
  std::ofstream(file) << "max_step_s: [1\n";
  EXPECT_THROW(readYaml(file), ParameterError);
  std::remove(file.c_str());
  EXPECT_THROW(readYaml(file), ParameterError);
}

}  // namespace
}  // namespace test
}  // namespace dccd
