// The physics that records scenes: only the named effects, and motion that can be checked by hand comes out as it
// should.
#include "scenes/physics/simulation.h"

#include <algorithm>
#include <string>
#include <vector>

#include <gtest/gtest.h>

#include "scenes/physics/scene_file.h"
#include "scenes/physics/shapes.h"

namespace dccd::scene {
namespace {

SceneSpec bareScene() {
  return parseScene(R"(name: bare
description: A sheet in empty space
frames: 30
frame_rate_hz: 30
physics: {substeps: 8}
bodies:
  - name: sheet
    mass_kg: 0.1
    sheet: {rows: 5, cols: 5, size_m: [0.4, 0.4], center_m: [0, 0, 1]}
)",
                    "bare");
}

Obstacle floorAt(double top_m) {
  Obstacle obstacle;
  obstacle.collides = true;
  Solid solid;
  solid.box.min = Vec3(-1, -1, top_m - 0.2);
  solid.box.max = Vec3(1, 1, top_m);
  obstacle.solids.push_back(solid);
  return obstacle;
}

double lowest(const Positions& positions) {
  double z = positions.front()[2];
  for (const Vec3& p : positions) z = std::min(z, p[2]);
  return z;
}

TEST(Simulation, ConstructsNoEffectThatTheSceneDoesNotName) {
  SceneSpec spec = bareScene();
  Simulation simulation(spec, 1);
  EXPECT_TRUE(simulation.effects().empty());
  const Positions start = simulation.positions(0);
  for (int i = 0; i < 30; ++i) simulation.step();
  const Positions end = simulation.positions(0);
  for (std::size_t i = 0; i < start.size(); ++i) EXPECT_LT((end[i] - start[i]).norm(), 1e-12) << "nothing moves it";
}

TEST(Simulation, ConstructsEachNamedEffect) {
  SceneSpec spec = bareScene();
  spec.gravity_m_s2 = Vec3(0, 0, -9.81);
  spec.wind = Wind{Vec3(1, 0, 0), 0.1, 0.0, 0.0, 1.0};
  spec.obstacle = floorAt(0.0);
  spec.rigid_bodies.push_back({"finger", "finger", Vec3(0.1, 0.1, 0.1), Vec3(3, 0, 0), {}});
  spec.bodies[0].bending = 0.5;
  spec.bodies[0].self_collision = 4;
  spec.bodies[0].friction = 0.5;
  spec.bodies[0].grippers.push_back({{0}, {}, {}});
  const std::vector<std::string> expected = {
      "gravity",         "wind",          "obstacle", "finger: rigid body", "sheet: bending", "sheet: self-collision",
      "sheet: friction", "sheet: gripper"};
  EXPECT_EQ(Simulation(spec, 1).effects(), expected);
}

TEST(Simulation, AnObstacleThatDoesNotCollideIsOnlyMapped) {
  SceneSpec spec = bareScene();
  spec.obstacle = floorAt(0.9);
  spec.obstacle->collides = false;
  EXPECT_TRUE(Simulation(spec, 1).effects().empty());
}

TEST(Simulation, FallsFreely) {
  SceneSpec spec = bareScene();
  spec.gravity_m_s2 = Vec3(0, 0, -9.81);
  Simulation simulation(spec, 1);
  for (int i = 0; i < 15; ++i) simulation.step();
  const double t = simulation.time_s();
  EXPECT_NEAR(t, 0.5, 1e-12);
  // The integrator is of first order: half a step of velocity at most.
  const double bound = 9.81 * t / (spec.frame_rate_hz * spec.substeps);
  for (const Vec3& p : simulation.positions(0)) EXPECT_NEAR(p[2], 1.0 - 0.5 * 9.81 * t * t, bound);
}

TEST(Simulation, RestsOnTheObstacleAtItsThickness) {
  SceneSpec spec = bareScene();
  spec.gravity_m_s2 = Vec3(0, 0, -9.81);
  spec.obstacle = floorAt(0.9);
  spec.bodies[0].damping = 0.05;
  spec.bodies[0].thickness_m = 0.005;
  Simulation simulation(spec, 1);
  for (int i = 0; i < 60; ++i) simulation.step();
  const Positions positions = simulation.positions(0);
  EXPECT_NEAR(lowest(positions), 0.905, 0.003);
}

TEST(Simulation, GrippedVerticesFollowTheirPathToTheLastBitAndAreLetGo) {
  SceneSpec spec = bareScene();
  spec.gravity_m_s2 = Vec3(0, 0, -9.81);
  spec.bodies[0].grippers.push_back(
      {{0, 4}, {{0.0, Vec3::Zero(), Vec3::Zero()}, {0.5, Vec3(0, 0, 0.2), Vec3::Zero()}}, 0.6});
  Simulation simulation(spec, 1);
  const Positions start = simulation.positions(0);
  for (int i = 0; i < 15; ++i) simulation.step();
  const Vec3 centroid = 0.5 * (start[0] + start[4]);
  const Eigen::Isometry3d pose = motionAt(spec.bodies[0].grippers[0].motion, centroid, simulation.time_s());
  EXPECT_EQ(simulation.positions(0)[0], pose * start[0]);
  EXPECT_NEAR(simulation.positions(0)[4][2], 1.2, 1e-9);
  for (int i = 0; i < 15; ++i) simulation.step();
  EXPECT_LT(simulation.positions(0)[0][2], 1.1) << "released at 0.6 s";
}

TEST(Simulation, RigidBodiesMoveAlongTheirKeys) {
  SceneSpec spec = bareScene();
  spec.rigid_bodies.push_back({"finger",
                               "finger",
                               Vec3(0.1, 0.1, 0.1),
                               Vec3(3, 0, 0),
                               {{0.0, Vec3::Zero(), Vec3::Zero()}, {1.0, Vec3(0, 0, 1), Vec3(0, 0, 0.5)}}});
  Simulation simulation(spec, 1);
  EXPECT_TRUE(simulation.rigidPose(0).translation().isApprox(Vec3(3, 0, 0)));
  for (int i = 0; i < 30; ++i) simulation.step();
  EXPECT_TRUE(simulation.rigidPose(0).translation().isApprox(Vec3(3, 0, 1), 1e-9));
  EXPECT_NEAR(Eigen::AngleAxisd(simulation.rigidPose(0).linear()).angle(), 0.5, 1e-9);
}

/// A slide along z at (2, 0, 1), and on it a joint that turns about y, 0.5 m to the side.
Robot armOf(const std::vector<JointKey>& slide, const std::vector<JointKey>& turn) {
  Robot robot;
  robot.base_m = Vec3(2, 0, 0);
  robot.links.resize(3);
  for (int i = 0; i < 3; ++i) {
    robot.links[i].name = std::string("abc").substr(i, 1);
    robot.links[i].parent = i - 1;
  }
  robot.links[1].joint = Link::Joint::SLIDES;
  robot.links[1].origin.translate(Vec3(0, 0, 1));
  robot.links[1].axis = Vec3::UnitZ();
  robot.links[1].keys = slide;
  robot.links[2].joint = Link::Joint::TURNS;
  robot.links[2].origin.translate(Vec3(0.5, 0, 0));
  robot.links[2].axis = Vec3::UnitY();
  robot.links[2].keys = turn;
  return robot;
}

TEST(Simulation, JointsMoveSmoothlyBetweenTheirKeysAndCarryTheirLinks) {
  const std::vector<JointKey> keys{{1, 0.25}, {2, 1.25}};
  EXPECT_EQ(jointAt({}, 5), 0);
  EXPECT_EQ(jointAt(keys, 0), 0.25);
  EXPECT_EQ(jointAt(keys, 1.25), 0.25 + 0.15625) << "a quarter of the time: u^2 (3 - 2 u)";
  EXPECT_EQ(jointAt(keys, 2), 1.25);
  EXPECT_EQ(jointAt(keys, 9), 1.25);
  const std::vector<Eigen::Isometry3d> poses = linkPoses(armOf(keys, {{0, 0}, {2, M_PI / 2}}), 2);
  EXPECT_TRUE(poses[0].translation().isApprox(Vec3(2, 0, 0)));
  EXPECT_TRUE(poses[1].translation().isApprox(Vec3(2, 0, 2.25)));
  EXPECT_TRUE((poses[2] * Vec3(0, 0, 0.1)).isApprox(Vec3(2.6, 0, 2.25)));
}

// Physics has the vertices until they are grasped where they are, and again when they are released.
TEST(Simulation, WhatALinkGraspsGoesWithIt) {
  SceneSpec spec = bareScene();
  spec.gravity_m_s2 = Vec3(0, 0, -9.81);
  spec.robot = armOf({{0.2, 0}, {0.6, 0.4}}, {{0.2, 0}, {0.6, 0.3}});
  spec.bodies[0].grippers.push_back({{0, 4}, {}, 0.8, "c", 0.1});
  Simulation simulation(spec, 1);
  EXPECT_EQ(simulation.effects(), (std::vector<std::string>{"gravity", "sheet: gripper"}));
  const Positions start = simulation.positions(0);
  for (int i = 0; i < 3; ++i) simulation.step();
  const Positions grasped = simulation.positions(0);
  EXPECT_LT(grasped[0][2], start[0][2] - 0.02) << "it fell for 0.1 s";
  const Eigen::Isometry3d before = linkPoses(*spec.robot, 0.1)[2];
  for (int i = 3; i < 21; ++i) simulation.step();
  const Positions carried = simulation.positions(0);
  const Eigen::Isometry3d moved = linkPoses(*spec.robot, simulation.time_s())[2] * before.inverse();
  for (const int v : {0, 4}) EXPECT_LT((carried[v] - moved * grasped[v]).norm(), 1e-9);
  EXPECT_GT(carried[0][2], grasped[0][2] + 0.3);
  for (int i = 21; i < 30; ++i) simulation.step();
  EXPECT_LT(simulation.positions(0)[0][2], carried[0][2] - 0.1) << "released at 0.8 s";
}

TEST(Shapes, FacesCoverTheGridOnce) {
  Shape sheet;
  sheet.rows = 4;
  sheet.cols = 5;
  EXPECT_EQ(shapeFaces(sheet).size(), 2u * 3 * 4);
  sheet.kind = Shape::Kind::TUBE;
  EXPECT_EQ(shapeFaces(sheet).size(), 2u * 3 * 5);
  for (const Face& face : shapeFaces(sheet)) {
    EXPECT_NE(face[0], face[1]);
    EXPECT_NE(face[1], face[2]);
    EXPECT_LT(*std::max_element(face.begin(), face.end()), 20u);
  }
}

TEST(Shapes, AMotionBeginsAndEndsAtRest) {
  MotionKey up;
  up.time_s = 2;
  up.offset_m = Vec3(0, 0, 1);
  const auto height = [&](double time_s) { return motionAt({up}, Vec3::Zero(), time_s).translation().z(); };
  EXPECT_EQ(height(0), 0);
  EXPECT_LT(height(0.02), 0.0004);
  EXPECT_EQ(height(1), 0.5);
  EXPECT_GT(height(1.98), 0.9996);
  EXPECT_EQ(height(3), 1);
}

TEST(Shapes, ATorusHasAHole) {
  Solid ring;
  ring.kind = Solid::Kind::RING;
  ring.radius_m = 1.0;
  ring.tube_radius_m = 0.2;
  EXPECT_FALSE(contains(ring, Vec3::Zero()));
  EXPECT_TRUE(contains(ring, Vec3(1, 0, 0)));
  EXPECT_TRUE(contains(ring, Vec3(0, 1.19, 0)));
  EXPECT_FALSE(contains(ring, Vec3(0, 1.21, 0)));
  EXPECT_FALSE(contains(ring, Vec3(1, 0, 0.21)));
}

}  // namespace
}  // namespace dccd::scene
