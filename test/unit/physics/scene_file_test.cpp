// Scene files: what is read, and what is refused with file, line, key and what to write instead.
#include "scenes/physics/scene_file.h"
#include "support/said.h"

#include <filesystem>
#include <string>

#include <gtest/gtest.h>

namespace dccd::scene {
namespace {

const char* const GOOD = R"(name: drop
description: A sheet falls
frames: 5
physics:
  gravity_m_s2: [0, 0, -9.81]
bodies:
  - name: sheet
    mass_kg: 0.1
    sheet: {rows: 3, cols: 4, size_m: [0.3, 0.2], center_m: [0, 0, 1]}
)";

std::string errorOf(std::string text, const std::string& from, const std::string& to) {
  const std::size_t at = text.find(from);
  EXPECT_NE(at, std::string::npos) << from;
  text.replace(at, from.size(), to);
  return test::said<ParameterError>([&] { parseScene(text, "s.yaml"); }, "accepted");
}

/// What is said of the text `good` with one part of it replaced.
void expectTold(const std::string& from, const std::string& to, const std::string& told,
                const std::string& good = GOOD) {
  const std::string error = errorOf(good, from, to);
  EXPECT_NE(error.find(told), std::string::npos) << to << ": " << error;
}

TEST(SceneFile, ReadsWhatItSays) {
  const SceneSpec spec = parseScene(GOOD, "s.yaml");
  EXPECT_EQ(spec.name, "drop");
  EXPECT_EQ(spec.frames, 5);
  ASSERT_EQ(spec.bodies.size(), 1u);
  EXPECT_EQ(spec.bodies[0].topic, "/sheet");
  EXPECT_EQ(spec.bodies[0].shape.rows, 3);
  EXPECT_EQ(spec.bodies[0].shape.cols, 4);
  EXPECT_TRUE(spec.gravity_m_s2.has_value());
  EXPECT_FALSE(spec.wind.has_value());
  EXPECT_FALSE(spec.obstacle.has_value());
  EXPECT_FALSE(spec.bodies[0].bending.has_value());
  EXPECT_FALSE(spec.bodies[0].self_collision.has_value());
  EXPECT_FALSE(spec.bodies[0].friction.has_value());
}

TEST(SceneFile, WhatIsWrongIsNamedWithItsLineAndWhatToWrite) {
  const std::string sheet = "sheet: {rows: 3, cols: 4, size_m: [0.3, 0.2], center_m: [0, 0, 1]}";
  expectTold("mass_kg", "mas_kg", "s.yaml:");
  expectTold("mass_kg", "mas_kg", "mass_kg is needed: a number from");
  expectTold("    mass_kg: 0.1\n", "    mass_kg: 0.1\n    colour: red\n",
             "s.yaml:9: bodies[0]/colour is not known; nearest is bodies[0]/");
  expectTold("mass_kg: 0.1", "mass_kg: -1", "s.yaml:8: bodies[0]/mass_kg is -1, it must be from");
  expectTold("mass_kg: 0.1", "mass_kg: .nan", "mass_kg is nan, it must be from");
  expectTold("mass_kg: 0.1", "mass_kg: heavy", "is a string, a number is needed");
  expectTold("frames: 5", "frames: 2.5", "an integer is needed");
  expectTold("rows: 3", "rows: 1", "rows");
  expectTold("[0, 0, -9.81]", "[0, -9.81]", "a list of 3 numbers");
  expectTold("[0, 0, -9.81]", "9.81", "a list of 3 numbers");
  expectTold(sheet, "grippers: [{vertices: [12]}]\n    " + sheet, "from 0 to 11");
  expectTold(sheet, "grippers: [{row: 0, col: 0}]\n    " + sheet, "needs just one of");
  expectTold(sheet, "rope: {points: 9, length_m: 1, center_m: [0, 0, 1]}", "a rope has no faces");
  expectTold("bodies:", "obstacle: {resolution_m: 0.1, solids: [{box: {min_m: [0, 0, 1], max_m: [1, 1, 1]}}]}\nbodies:",
             "max_m must be above min_m");
  expectTold("bodies:", "obstacle: {resolution_m: 0.1}\nbodies:", "at least one solid");
  expectTold(
      "bodies:", "rigid_bodies:\n  - {name: a, size_m: [1, 1, 1], start_m: [0, 0, 0], self_collision: true}\nbodies:",
      "s.yaml:7: rigid_bodies[0]/self_collision has no meaning: the body is rigid and cannot meet itself; remove "
      "this line");
}

TEST(SceneFile, ACameraIsReadStrictly) {
  const std::string text = std::string(GOOD) +
                           "rigid_bodies:\n  - {name: finger, size_m: [1, 1, 1], start_m: [0, 0, 0]}\n"
                           "obstacle: {resolution_m: 0.1, solids: [{box: {min_m: [0, 0, 0], max_m: [1, 1, 0.2]}}]}\n";
  const std::string size = ", width: 4, height: 3, field_of_view_rad: 1, rate_hz: 5";
  const auto with = [&](const std::string& camera) {
    return errorOf(text, "bodies:", "camera: {" + camera + "}\nbodies:");
  };
  const auto expectTold = [&](const std::string& camera, const std::string& part) {
    scene::expectTold("bodies:", "camera: {" + camera + "}\nbodies:", part, text);
  };
  const std::string at = "position_m: [0, 0, 2]", down = at + ", looks_at_m: [0, 0, 0]";
  EXPECT_EQ(with(down + size), "accepted");
  EXPECT_EQ(with(down + size + ", noise_m: 0.003, lost_share: 1, lag_s: 0.1, empty_clouds: 9, inset_m: 0.05, seed: 7"),
            "accepted");
  EXPECT_EQ(with(at + ", quaternion: [1, 0, 0, 0]" + size), "accepted");

  expectTold(down + size + ", lens: 2", "s.yaml:6: camera/lens is not known; nearest is camera/");
  expectTold(down + size + ", noise_m: .nan", "camera/noise_m is nan, it must be from 0 to 1");
  expectTold(down + size + ", noise_m: -0.001", "camera/noise_m is -0.001, it must be from 0 to 1");
  expectTold(down + size + ", lag_s: .inf", "camera/lag_s is inf, it must be from 0 to 60");
  expectTold(down + size + ", lost_share: 1.5", "camera/lost_share is 1.5, it must be from 0 to 1");
  expectTold(down + size + ", flying_share: -1", "camera/flying_share is -1, it must be from 0 to 1");
  expectTold(down + size + ", seed: -1", "camera/seed is -1, it must be from 0");
  expectTold(down + size + ", empty_clouds: -1", "camera/empty_clouds is -1, it must be from 0 to 1000");
  expectTold(down + ", width: 4, height: 3, field_of_view_rad: 1, rate_hz: 0.01, empty_clouds: 10",
             "camera/empty_clouds take more than 600 s at rate_hz");
  expectTold(down + size + ", inset_m: 0.1", "camera/inset_m leaves nothing of a solid of the obstacle; write less");
  expectTold(down + ", width: 0, height: 3, field_of_view_rad: 1, rate_hz: 5", "camera/width is 0, it must be from 1");
  expectTold(down + ", width: 4, height: 5000, field_of_view_rad: 1, rate_hz: 5", "camera/height is 5000");
  expectTold(down + ", width: 4, height: 3, field_of_view_rad: 4, rate_hz: 5", "field_of_view_rad is 4, it must be");
  expectTold(down + ", width: 4, height: 3, field_of_view_rad: 1, rate_hz: -5", "camera/rate_hz is -5, it must be");
  expectTold(down + ", width: 4, height: 3, field_of_view_rad: 1, rate_hz: 31",
             "camera/rate_hz is 31, it must be from 0.01 to 30");
  expectTold(at + size, "camera needs just one of looks_at_m, quaternion: where it looks");
  expectTold(down + ", quaternion: [1, 0, 0, 0]" + size, "camera needs just one of");
  expectTold(at + ", looks_at_m: [0, 0, 2]" + size, "camera/looks_at_m is where the camera is");
  expectTold(at + ", quaternion: [0, 0, 0, 0]" + size, "camera/quaternion is zero");
  expectTold(at + ", quaternion: [1, 0, 0]" + size, "camera/quaternion must be a list of 4 numbers");
  expectTold("position_m: [0.5, 0.5, 0.1], looks_at_m: [0, 0, 0]" + size, "camera/position_m lies in a solid");
  expectTold(down + size + ", topic: /sheet", "camera/topic is another's, too");
  expectTold(down + size + ", truth_topic: /octomap_binary", "camera/truth_topic is another's, too");
  expectTold(down + size + ", frame: finger", "camera/frame is another's, too");
  scene::expectTold("bodies:", "camera: {" + down + size + "}\nbodies:",
                    "s.yaml:6: camera needs an obstacle, whose topic and resolution its map has");
}

TEST(SceneFile, ACameraLooksUprightAtItsPlace) {
  const auto poseOf = [](const std::string& where) {
    return parseScene(std::string(GOOD) +
                          "obstacle: {resolution_m: 0.1, solids: [{box: {min_m: [0, 0, 0], max_m: [1, 1, 1]}}]}\n"
                          "camera: {width: 4, height: 3, field_of_view_rad: 1, rate_hz: 5, " +
                          where + "}\n",
                      "s.yaml")
        .camera->pose;
  };
  const Eigen::Isometry3d level = poseOf("position_m: [2, 0, 3], looks_at_m: [5, 0, 3]");
  EXPECT_LT((level.translation() - Vec3(2, 0, 3)).norm(), 1e-12);
  EXPECT_LT((level.linear() * Vec3::UnitZ() - Vec3::UnitX()).norm(), 1e-12) << "forward";
  EXPECT_LT((level.linear() * Vec3::UnitX() + Vec3::UnitY()).norm(), 1e-12) << "to the right of x forward lies -y";
  EXPECT_LT((level.linear() * Vec3::UnitY() + Vec3::UnitZ()).norm(), 1e-12) << "down";
  for (const char* where :
       {"position_m: [2, 0, 3], looks_at_m: [2, 0, 0]", "position_m: [2, 0, 3], looks_at_m: [1, 4, 0]",
        "position_m: [2, 0, 3], quaternion: [1, 2, 3, 4]"}) {
    const Eigen::Matrix3d turn = poseOf(where).linear();
    EXPECT_LT((turn * turn.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12) << where;
    EXPECT_NEAR(turn.determinant(), 1.0, 1e-12) << where;
  }
  const Eigen::Isometry3d turned = poseOf("position_m: [2, 0, 3], quaternion: [1, 0, 0, 0]");
  EXPECT_LT((turned.linear() * Vec3::UnitZ() + Vec3::UnitZ()).norm(), 1e-12) << "half a turn about x looks down";
}

TEST(SceneFile, ARobotsJointsAndWhatItsLinksHoldAreRead) {
  const std::string held = "[0, 0, 1]}\n    grippers: [{vertices: [1], link: hand, grasp_s: 0.05, release_s: 0.1}]\n";
  const std::string good = std::string(GOOD).replace(std::string(GOOD).find("[0, 0, 1]}"), 11, held) +
                           "robot:\n  description: arm.urdf\n  base_m: [1, 2, 3]\n"
                           "  joints: {lift: [{time_s: 0, position: 1}, {time_s: 0.1, position: -2}]}\n"
                           "expect: {body: {names: [sheet, thumb], first_contact_s: none}}\n";
  const SceneSpec spec = parseScene(good, "s.yaml");
  ASSERT_TRUE(spec.robot.has_value());
  EXPECT_EQ(spec.robot->description, "arm.urdf");
  EXPECT_EQ(spec.robot->base_m, Vec3(1, 2, 3));
  ASSERT_EQ(spec.robot->joints.at("lift").size(), 2u);
  EXPECT_EQ(spec.robot->joints.at("lift")[1].position, -2);
  EXPECT_EQ(spec.robot->named_links, std::vector<std::string>{"hand"});
  const Gripper& gripper = spec.bodies[0].grippers.at(0);
  EXPECT_EQ(gripper.link, "hand");
  EXPECT_EQ(gripper.grasp_s, 0.05);
  expectTold("time_s: 0.1, p", "time_s: 0, p", "joints/lift[1]/time_s must be later", good);
  expectTold("  description: arm.urdf\n", "", "robot/description is needed", good);
  expectTold("link: hand", "link: hand, motion: [{time_s: 0}]", "grippers[0]/motion contradicts link", good);
  expectTold("frames: 5", "frames: 6", "grippers[0]/link has no meaning without a robot",
             good.substr(0, good.find("robot:")));
}

TEST(SceneFile, WhatIsNoYamlOrNoFileSaysSo) {
  expectTold("frames: 5", "frames: [5", "not YAML");
  EXPECT_THROW(readSceneFile("no/such/scene.yaml"), ParameterError);
  EXPECT_THROW(parseScene("", "s.yaml"), ParameterError);
  EXPECT_THROW(parseScene("- a\n- b\n", "s.yaml"), ParameterError);
  EXPECT_THROW(parseScene("name: &a [*a]\n", "s.yaml"), ParameterError) << "an anchor within itself";
}

TEST(SceneFile, EverySceneOfTheProjectIsReadAndNamedAsItsFile) {
  int scenes = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/config/scenes")) {
    if (entry.path().extension() != ".yaml") continue;
    const SceneSpec spec = readSceneFile(entry.path().string());
    EXPECT_EQ(spec.name, entry.path().stem().string());
    EXPECT_FALSE(spec.monitor_yaml.empty()) << spec.name;
    ++scenes;
  }
  EXPECT_GE(scenes, 7);
}

}  // namespace
}  // namespace dccd::scene
