// ~intended: a robot's joints against KDL, what is wrong with a message, and what a pipeline makes of one.
#include "node/intended_motion.h"

#include <random>

#include "output/safe_until_messages.h"
#include "panda.h"
#include "robot/joint_tree.h"
#include "robot/urdf_text.h"
#include "robot_scene.h"
#include "robot_texts.h"

namespace dccd {
namespace test {
namespace {

using geometry_msgs::TwistStamped;
using trajectory_msgs::JointTrajectory;

/// A lift that slides along z, a plate on it, and a hand that turns and that a finger follows.
std::string liftUrdf(const std::string& hand = "") {
  const std::string z = "<axis xyz='0 0 1'/>", limit = "<limit lower='-2' upper='2' effort='1' velocity='1'/>";
  return robotOf(
      link("base", "") + link("plate", collision("<box size='1 1 0.002'/>")) + link("hand", hand) + link("finger", "") +
      link("tray", "") + joint("base", "plate", "prismatic", z + limit) + joint("plate", "tray") +
      joint("plate", "hand", "revolute", "<origin xyz='0.3 0 0.1'/>" + z + limit) +
      joint("hand", "finger", "revolute",
            "<origin xyz='0.1 0 0'/>" + z + limit + "<mimic joint='plate_hand' multiplier='-2' offset='0.1'/>"));
}

TEST(JointTree, IsWhereOtherKinematicsHasTheLinks) {
  if (!Panda::isThere()) GTEST_SKIP() << "the panda of the shared data is not there";
  const Panda panda;
  const JointTree tree(panda.urdf());
  KDL::Tree judge;
  ASSERT_TRUE(kdl_parser::treeFromString(panda.urdf(), judge));
  std::mt19937_64 random(3);
  std::uniform_real_distribution<double> anywhere(-2, 2);
  for (int i = 0; i < 50; ++i) {
    std::map<std::string, double> positions;
    std::vector<double> of_segments(panda.joints(), 0);
    // KDL knows no joint that follows another one: each of the fingers has its own number there.
    const double finger = std::abs(anywhere(random)) * 0.01;
    for (int j = 1; j <= 7; ++j) positions["panda_joint" + std::to_string(j)] = anywhere(random);
    positions["panda_finger_joint1"] = finger;
    for (const char* name : {"panda_link5", "panda_hand", "panda_rightfinger", "panda_leftfinger"}) {
      KDL::Chain chain;
      ASSERT_TRUE(judge.getChain("panda_link0", name, chain));
      KDL::Frame expected = KDL::Frame::Identity();
      for (const KDL::Segment& segment : chain.segments) {
        const auto known = positions.find(segment.getJoint().getName());
        expected = expected * segment.pose(known != positions.end() ? known->second : finger);
      }
      const Eigen::Isometry3d pose = tree.pose(name, positions);
      for (unsigned r = 0; r < 3; ++r) {
        EXPECT_NEAR(pose.translation()[r], expected.p(static_cast<int>(r)), 1e-12) << name;
        for (unsigned c = 0; c < 3; ++c) EXPECT_NEAR(pose.linear()(r, c), expected.M(r, c), 1e-12) << name;
      }
    }
  }
  EXPECT_FALSE(tree.moves("panda_finger_joint2")) << "it follows the other finger";
  EXPECT_EQ(tree.jointsTo("panda_leftfinger"), tree.jointsTo("panda_rightfinger"));
}

// Whatever moves the first would move the last, and nobody could name that.
TEST(JointTree, ARobotOfWhichAJointFollowsAFollowerIsRefused) {
  const auto following = [](const std::string& leader) {
    const std::string limit = "<limit lower='-2' upper='2' effort='1' velocity='1'/>";
    return robotOf(link("a", "") + link("b", "") + link("c", "") + link("d", "") + joint("a", "b", "revolute", limit) +
                   joint("a", "c", "revolute", limit + "<mimic joint='a_b'/>") +
                   joint("a", "d", "revolute", limit + "<mimic joint='" + leader + "'/>"));
  };
  EXPECT_EQ(JointTree(following("a_b")).jointsTo("d"), std::set<std::string>{"a_b"});
  for (const char* leader : {"a_c", "a_d", "a_x"}) EXPECT_THROW(JointTree{following(leader)}, RobotTextError) << leader;
}

TEST(JointTree, NoVertexHasMoreAccelerationThanItsBound) {
  const JointTree tree(liftUrdf());
  EXPECT_TRUE(tree.moves("base_plate"));
  EXPECT_FALSE(tree.moves("hand_finger"));
  EXPECT_FALSE(tree.moves("plate_tray"));
  EXPECT_EQ(tree.lastJointTo("tray"), "base_plate");
  EXPECT_EQ(tree.jointsTo("finger"), (std::set<std::string>{"base_plate", "plate_hand"}));
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> anywhere(-1, 1);
  for (int i = 0; i < 200; ++i) {
    const double lift = anywhere(random), turn = 3 * anywhere(random), faster = 2 * anywhere(random),
                 at = anywhere(random);
    const Vec3 vertex = 0.2 * Vec3(anywhere(random), anywhere(random), anywhere(random));
    const auto place = [&](double t) {
      return Vec3(
          tree.pose("finger", {{"base_plate", at + lift * t + faster * t * t / 2}, {"plate_hand", at + turn * t}}) *
          vertex);
    };
    const double h = 1e-3, bound = tree.accelerationBound(
                               "finger", vertex.norm(),
                               {{"base_plate", {std::abs(lift) + h * std::abs(faster), std::abs(faster)}},
                                {"plate_hand", {std::abs(turn), 0}}},
                               1);
    EXPECT_LE((place(h) - 2 * place(0) + place(-h)).norm() / (h * h), bound * (1 + 1e-6) + 1e-6);
  }
}

JointTrajectory lifts(double begin_s, std::vector<std::pair<double, double>> points) {
  JointTrajectory message;
  message.header.stamp = ros::Time(begin_s);
  message.joint_names = {"base_plate"};
  for (const auto& [time_s, height_m] : points) {
    auto& point = message.points.emplace_back();
    point.time_from_start = ros::Duration(time_s);
    point.positions = {height_m};
  }
  return message;
}

TwistStamped twist(double begin_s, const std::string& frame, double z, double turn = 0) {
  TwistStamped message;
  message.header.stamp = ros::Time(begin_s);
  message.header.frame_id = frame;
  message.twist.linear.z = z;
  message.twist.angular.z = turn;
  return message;
}

/// A cloth that is held over the plate, and a monitor that listens.
struct Lift {
  explicit Lift(double deviation_m = 0.01, bool with_table = false, const std::string& hand = "")
      : driven(robotScene(with_table ? "max_speed_m_s: 1, against_map: true, own_voxels_m: 0" : "max_speed_m_s: 1",
                          std::string(with_table ? "" : "effects: {octomap: 'off'}, ") +
                              "intent: {horizon_s: 1, deviation_m: " + std::to_string(deviation_m) +
                              ", deviation_rate_m_s: 0.01}, speed_scale: {reaction_time_s: 0.1, stopping_time_s: 0.2}, "
                              "bodies: {cloth: {topic: cloth, topology: {rows: 2, cols: 2}, max_speed_m_s: 0.1}}"),
               loads(liftUrdf(hand))) {
    driven.raise("base", 0);
    if (with_table) driven.giveMap(1);
  }
  /// The answer to a frame of the cloth, 0.5 m high, with the plate at this height.
  const MonitorPipeline::Intended& step(double stamp_s, double plate_m) {
    for (const char* const link : {"plate", "tray", "hand"}) driven.tell({above(link, plate_m, ros::Time(stamp_s))});
    driven.feed(stamp_s, 0.5f);
    return driven.pipeline.intended();
  }
  double promised() const { return driven.pipeline.promises().promise().seconds(); }
  Driven driven;
};

// A robot that rests, or has fallen behind, goes by its motion until the next one begins, or its own was to end: by the
// clock.
TEST(IntendedMotion, TheOneBeforeCountsUntilTheNewestBegins) {
  for (const double pace : {0.0, 0.5, 1.0}) {
    Lift lift;
    const auto at = [&](double stamp_s) { return 0.1 - 0.05 * pace * (stamp_s - 1.2); };
    lift.step(1.1, 0.1);
    ASSERT_EQ(lift.driven.pipeline.intend(lifts(1.2, {{0, 0.1}, {3, 0.1 - 0.15}})), "");
    ASSERT_EQ(lift.driven.pipeline.intend(lifts(2.1, {{0, at(2.1)}, {0.3, 0.6}})), "");
    for (const double stamp_s : {1.3, 1.5, 1.9, 2.05}) {
      // Off its place on the path by what it is behind, which is within the tube as long as it is near.
      const auto& intended = lift.step(stamp_s, at(stamp_s));
      ASSERT_EQ(intended.along.unused, "") << pace << ' ' << stamp_s;
      EXPECT_NEAR(intended.path.endsAt(), std::min(1.0, 2.1 - stamp_s), 1e-6) << pace << ' ' << stamp_s;
    }
  }
}

TEST(IntendedMotion, AwayFromTheClothTheTubeAloneLimits) {
  Lift lift;
  lift.step(1, 0.1);
  EXPECT_EQ(lift.step(1.1, 0.1).along.unused, "no path is in force");
  const double without_s = lift.promised();
  EXPECT_NEAR(without_s, (0.4 - 0.001) / 1.1, 1e-3);
  EXPECT_EQ(lift.driven.pipeline.intend(lifts(1.2, {{0, 0.1}, {1, -0.1}, {2, -0.4}})), "");
  EXPECT_EQ(lift.step(1.15, 0.1).along.unused, "no path is in force") << "it has not begun";
  const MonitorPipeline::Intended& begun = lift.step(1.2, 0.1);
  EXPECT_EQ(begun.along.unused, "");
  ASSERT_EQ(begun.path.bodies.size(), 1u);
  EXPECT_EQ(lift.driven.outcome.step->bodies[begun.path.bodies[0].body].name, "plate");
  EXPECT_NEAR(lift.promised(), 1, 1e-6) << "as far as it is looked ahead";
  EXPECT_EQ(lift.driven.pipeline.speedScale(lift.driven.outcome).scale, 1);
  EXPECT_EQ(lift.driven.pipeline.promises().broken(), "");
  EXPECT_NE(assumedOf(lift.driven.outcome, begun.path).find("'plate' go along the intended path"), std::string::npos);
  // On the path, though slower than it: the controller obeys a scale.
  EXPECT_EQ(lift.step(1.3, 0.09).along.unused, "");
  EXPECT_EQ(lift.driven.pipeline.promises().broken(), "");
  EXPECT_EQ(lift.driven.pipeline.promises().counts().broken, 0u);
  // After its end all is as before.
  // The rest at its pace, 0.05 s late.
  for (const double at : {1.7, 2.15, 2.6, 3.05})
    EXPECT_EQ(lift.step(at, at < 2.2 ? 0.1 - 0.2 * (at - 1.25) : -0.1 - 0.3 * (at - 2.25)).along.unused, "") << at;
  EXPECT_EQ(lift.step(3.3, -0.4).along.unused, "no path is in force");
  EXPECT_EQ(lift.driven.pipeline.takeIntendedProblem(), "has ended");
  EXPECT_EQ(lift.driven.pipeline.takeIntendedProblem(), "") << "once";
}

TEST(IntendedMotion, OffTheTubeItIsVoidAndSaid) {
  Lift lift;
  lift.step(1, 0.1);
  ASSERT_EQ(lift.driven.pipeline.intend(lifts(1, {{0, 0.1}, {2, -0.3}})), "");
  EXPECT_EQ(lift.step(1.1, 0.08).along.unused, "");
  EXPECT_EQ(lift.step(1.2, 0.13).along.unused, "no path is in force");
  const std::string broken = lift.driven.pipeline.promises().broken();
  EXPECT_NE(broken.find("m off the intended path"), std::string::npos) << broken;
  const std::string problem = lift.driven.pipeline.takeIntendedProblem();
  EXPECT_NE(problem.find("does not hold: the robot is 0.05"), std::string::npos) << problem;
  EXPECT_EQ(lift.step(1.3, 0.04).along.unused, "no path is in force") << "back on it: nobody takes that for obedience";
}

TEST(IntendedMotion, TwistsFollowEachOther) {
  Lift lift;
  lift.step(1, 0.1);
  for (const double at : {1.05, 1.1, 1.15, 1.2}) ASSERT_EQ(lift.driven.pipeline.intend(twist(at, "tray", -0.2)), "");
  const MonitorPipeline::Intended& on_it = lift.step(1.12, 0.1);
  EXPECT_EQ(on_it.along.unused, "");
  EXPECT_NEAR(on_it.path.endsAt(), 1.08, 1e-6) << "1 s from the last one's stamp on";
  EXPECT_NEAR(on_it.path.bodies.at(0).pose.back().translation().z(), 0.1 - 0.2 * 1.08, 1e-6) << "fixed to the tray";
  EXPECT_EQ(lift.step(1.5, 0).along.unused, "");
  EXPECT_EQ(lift.step(1.9, -0.05).along.unused, "");
  EXPECT_EQ(lift.step(2.25, -0.1).along.unused, "no path is in force") << "held for 1 s";
  EXPECT_EQ(lift.driven.pipeline.takeIntendedProblem(), "has ended");
  ASSERT_EQ(lift.driven.pipeline.intend(twist(2.35, "base", 0.1)), "");
  EXPECT_EQ(lift.step(2.4, -0.1).along.unused, "no path is in force");
  EXPECT_EQ(lift.driven.pipeline.takeIntendedProblem(), "header/frame_id 'base' carries nothing that is watched");
}

TEST(IntendedMotion, AScrewIsOneAllTheWay) {
  IntendedMotion motion({1, 0.01, 0}, "", 1e-3);
  Step step;
  Body body;
  body.name = "tool";
  body.topology = share(Topology::grid(2, 2));
  body.t0 = body.t1 = share(Positions{{0, 0, 0}, {0.1, 0, 0}, {0, 0.1, 0}, {0.1, 0.1, 0}});
  step.bodies = {body};
  step.stamp_ns = 1000000000;
  TwistStamped message = twist(1, "tool", 0.1, 2);
  message.twist.linear.x = 0.4;
  ASSERT_EQ(motion.take(message, 0), "");
  const auto at_origin = [](const std::string&, StampNs) { return std::make_optional(Eigen::Isometry3d::Identity()); };
  const auto path = motion.from(step, {{0, "tool", Eigen::Isometry3d::Identity(), 0.15}}, at_origin);
  ASSERT_TRUE(path);
  // Small steps of the twist, which is told in the frame that moves.
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  for (int i = 0; i < 100000; ++i)
    pose = pose * Eigen::Translation3d(4e-6, 0, 1e-6) * Eigen::AngleAxisd(2e-5, Vec3::UnitZ());
  EXPECT_TRUE(path->bodies[0].pose.back().isApprox(pose, 1e-4));
  for (const double bend_m : path->bend_m) EXPECT_LE(bend_m, 1.01e-3);
}

TEST(IntendedMotion, WhatIsWrongIsNamedAndNothingIsInForceThen) {
  const auto wrong = [](const std::function<void(JointTrajectory&)>& change) {
    Lift lift;
    lift.step(1, 0.1);
    EXPECT_EQ(lift.driven.pipeline.intend(lifts(1, {{0, 0.1}, {2, -0.3}})), "");
    EXPECT_EQ(lift.step(1.1, 0.08).along.unused, "");
    JointTrajectory bad = lifts(1.1, {{0, 0.08}, {1, 0}, {2, -0.3}});
    change(bad);
    const std::string said = lift.driven.pipeline.intend(bad);
    EXPECT_EQ(lift.step(1.2, 0.06).along.unused, "no path is in force") << said;
    EXPECT_NEAR(lift.promised(), (0.44 - 0.001) / 1.1, 1e-3) << "by bounds alone";
    return said;
  };
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.joint_names[0] = "elbow"; }),
            "joint_names[0] 'elbow' is no joint of the robot that turns or slides by itself");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.joint_names[0] = "plate_tray"; }),
            "joint_names[0] 'plate_tray' is no joint of the robot that turns or slides by itself");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.joint_names.clear(); }), "joint_names is empty");
  EXPECT_EQ(wrong([](JointTrajectory& t) {
              t.joint_names = {"base_plate", "base_plate"};
            }),
            "joint_names has 'base_plate' twice");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.points[1].positions[0] = std::nan(""); }),
            "points[1]/positions[0] is nan");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.points[1].positions.push_back(1); }),
            "points[1]/positions has 2 values of 1 joints");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.points[1].velocities = {HUGE_VAL}; }), "points[1]/velocities[0] is inf");
  EXPECT_EQ(wrong([](JointTrajectory& t) {
              t.points[0].accelerations = {0, 0};
            }),
            "points[0]/accelerations has 2 values of 1 joints");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.points[2].time_from_start = ros::Duration(0.5); }),
            "points[2]/time_from_start is 0.5 s, after 1 s");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.points[0].time_from_start = ros::Duration(0.5); }),
            "points[0]/time_from_start is 0.5 s; it must be 0");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.points.resize(1); }), "points has 1 of the two or more that it needs");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.header.stamp = ros::Time(); }),
            "header/stamp is 0: it says when the motion begins");
  EXPECT_EQ(wrong([](JointTrajectory& t) {
              t.header.stamp = ros::Time(0.9);
              t.points.resize(2);
              t.points[1].time_from_start = ros::Duration(0.1);
            }),
            "header/stamp is late: the motion ended 0.1 s before the newest frame");
  EXPECT_EQ(wrong([](JointTrajectory& t) { t.header.stamp = ros::Time(0.5); }), "header/stamp goes back by 0.5 s");
  Lift lift;
  lift.step(1, 0.1);
  TwistStamped bad = twist(1, "plate", std::nan(""));
  EXPECT_EQ(lift.driven.pipeline.intend(bad), "twist/linear is (0, 0, nan)");
  EXPECT_EQ(lift.driven.pipeline.intend(twist(1, "", 0)), "header/frame_id is empty");
  IntendedMotion no_robot({1, 0.01, 0}, "", 1e-3);
  EXPECT_EQ(no_robot.take(lifts(1, {{0, 0}, {1, 1}}), 0), "joint_names: there is no robot (robot/description)");
}

// Until the next frame, too, nobody goes by a motion that is not meant any more.
TEST(IntendedMotion, APromiseDoesNotOutliveItsMotionButNeverGetsLessThanByBounds) {
  Lift lift;
  MonitorPipeline& pipeline = lift.driven.pipeline;
  const double bounds_s = (0.4 - 0.001) / 1.1;
  const auto begin = [&](double stamp_s) {
    lift.step(stamp_s, 0.1);
    ASSERT_EQ(pipeline.intend(twist(stamp_s, "plate", -0.01)), "");
    ASSERT_NE(pipeline.reconsider(), nullptr);
    EXPECT_EQ(pipeline.reconsider(), nullptr) << "nothing new";
    EXPECT_EQ(pipeline.intended().along.unused, "") << "at once";
    EXPECT_EQ(pipeline.promises().broken(), "");
    EXPECT_NEAR(lift.promised(), 1, 1e-6);
    EXPECT_EQ(pipeline.speedScale(lift.driven.outcome).scale, 1);
  };
  lift.step(1, 0.1);
  begin(1.1);
  // What follows from there on, and is meant, too, as the one before until then: no less than before.
  ASSERT_EQ(pipeline.intend(twist(1.15, "plate", -0.02)), "");
  ASSERT_NE(pipeline.reconsider(), nullptr);
  EXPECT_NEAR(lift.promised(), 1.05, 1e-6);
  EXPECT_EQ(pipeline.promises().broken(), "");
  // Up: the cloth comes at 0.1 m/s, the plate at 0.5, and the tube.
  ASSERT_EQ(pipeline.intend(twist(1.15, "plate", 0.5)), "");
  ASSERT_NE(pipeline.reconsider(), nullptr);
  const double up_s = (0.399 - 0.01 + 0.05 * 0.51) / (0.5 + 0.1 + 0.01);
  EXPECT_LE(lift.promised(), up_s);
  EXPECT_GE(lift.promised(), 0.97 * up_s);
  EXPECT_EQ(pipeline.promises().broken(), "something else is intended now");
  // Refused: by bounds alone.
  EXPECT_NE(pipeline.intend(twist(1.15, "", 0)), "");
  ASSERT_NE(pipeline.reconsider(), nullptr);
  EXPECT_NEAR(lift.promised(), bounds_s, 1e-3);
  EXPECT_EQ(pipeline.promises().broken(), "something else is intended now");
  EXPECT_NE(pipeline.intended().along.unused, "");
  // The promise that is left is looked at, and that the plate went another way than was meant is nobody's fault.
  lift.step(1.2, 0.14);
  EXPECT_EQ(pipeline.promises().broken(), "");
  EXPECT_EQ(pipeline.promises().counts().broken, 0u);
  EXPECT_EQ(pipeline.promises().counts().kept, 1u);
  // What a reset took away no motion brings back.
  begin(1.3);
  pipeline.reset(StepStatus::RESET, "reset");
  ASSERT_EQ(pipeline.intend(twist(1.4, "plate", -0.01)), "");
  EXPECT_EQ(pipeline.reconsider(), nullptr);
  EXPECT_FALSE(pipeline.promises().promise().isPromise());
}

TEST(WouldTouch, TellsWhenAndWhereOrThatAllIsFree) {
  using Answer = deformable_ccd::WouldTouch::Response;
  Lift lift(0.01, true);
  MonitorPipeline& pipeline = lift.driven.pipeline;
  EXPECT_EQ(pipeline.wouldTouch(lifts(0, {{0, 0.1}, {1, 0.1}})).verdict, Answer::NOT_PROVED) << "no frame yet";
  lift.step(1, 0.1);
  lift.step(1.1, 0.1);
  // Onto the table, 0.099 m below, at 0.05 m/s, in a tube of 0.01 m that grows by 0.01 m/s.
  const Answer down = pipeline.wouldTouch(lifts(0, {{0, 0.1}, {4, -0.1}}));
  EXPECT_EQ(down.verdict, Answer::TOUCHES) << down.reason;
  EXPECT_LE(down.first, 0.089 / 0.06);
  EXPECT_GE(down.first, 0.97 * 0.089 / 0.06);
  EXPECT_EQ(down.bodies[0], "plate");
  EXPECT_EQ(down.bodies[1], "octomap");
  EXPECT_NEAR(down.point.z, (0.1 - 0.001 - 0.05 * down.first) / 2, 2e-3) << "between the two";
  EXPECT_FALSE(down.assumed.empty());
  // Up, the cloth, 0.399 m above, may come at 0.1 m/s.
  const Answer up = pipeline.wouldTouch(lifts(0, {{0, 0.1}, {4, 0.9}}));
  EXPECT_EQ(up.verdict, Answer::TOUCHES);
  EXPECT_LE(up.first, 0.389 / 0.31);
  EXPECT_GE(up.first, 0.97 * 0.389 / 0.31);
  EXPECT_EQ(up.bodies[0], "cloth");
  EXPECT_NEAR(up.point.x, 0.2, 0.06) << "in the cloth";
  const Answer some = pipeline.wouldTouch(lifts(0, {{0, 0.1}, {1, 0.08}, {2, 0.12}}));
  EXPECT_EQ(some.verdict, Answer::FREE) << some.reason;
  EXPECT_NEAR(some.first, 2, 1e-6) << "to its end, beyond intent/horizon_s";
  EXPECT_EQ(some.bodies[0], "");
  // Nothing of it is in force.
  EXPECT_EQ(lift.step(1.2, 0.1).along.unused, "no path is in force");
}

TEST(WouldTouch, FailsClosed) {
  using Answer = deformable_ccd::WouldTouch::Response;
  const std::vector<std::pair<double, double>> rest{{0, 0.1}, {1, 0.1}};
  Lift lift(0.01, true, collision("<box size='0.1 0.1 0.002'/>"));
  MonitorPipeline& pipeline = lift.driven.pipeline;
  const auto reason = [&](const JointTrajectory& asked, const std::string& unproved = "") {
    const Answer answer = pipeline.wouldTouch(asked, unproved);
    EXPECT_EQ(answer.verdict, Answer::NOT_PROVED) << answer.reason;
    return answer.reason;
  };
  lift.step(1, 0.1);
  lift.step(1.1, 0.1);
  EXPECT_EQ(reason(lifts(0, rest)), "joint_names: they move 'hand', but not alone");
  JointTrajectory both = lifts(0, rest);
  both.joint_names.push_back("plate_hand");
  for (auto& point : both.points) point.positions.push_back(0);
  lift.step(1.2, 0.1);
  EXPECT_EQ(reason(both, "a frame waits"), "a frame waits");
  JointTrajectory other = lifts(0, rest);
  other.joint_names = {"elbow"};
  EXPECT_EQ(reason(other), "joint_names[0] 'elbow' is no joint of the robot that turns or slides by itself");
  both.points[1].time_from_start = ros::Duration(11);
  EXPECT_EQ(reason(both), "it lasts longer than 10 s");
  Lift alone(0.01, true);
  alone.step(1, 0.1);
  alone.step(1.1, 0.1);
  const auto said = [&](const JointTrajectory& asked) { return alone.driven.pipeline.wouldTouch(asked); };
  EXPECT_EQ(said(lifts(0, {{0, 0.2}, {1, 0.2}})).reason.substr(0, 35), "does not hold: the robot is 0.1 m o");
  EXPECT_EQ(said(lifts(0, rest)).verdict, Answer::FREE);
  alone.driven.pipeline.setPhase("");
  EXPECT_EQ(said(lifts(0, rest)).verdict, Answer::FREE) << "it was none before";
  alone.driven.feed(1.2, std::nanf(""));
  EXPECT_EQ(said(lifts(0, rest)).verdict, Answer::NOT_PROVED);
  EXPECT_NE(said(lifts(0, rest)).reason, "");
}

TEST(IntendedMotion, ACubicIsFollowedWhereThePointsHaveSpeeds) {
  Lift lift(0.004);
  lift.step(1, 0.1);
  JointTrajectory smooth = lifts(1, {{0, 0.1}, {1, -0.1}});
  for (auto& point : smooth.points) point.velocities = {0};
  ASSERT_EQ(lift.driven.pipeline.intend(smooth), "");
  // 0.1 - 0.2 (3 u^2 - 2 u^3): straight it would be 0.08 at a tenth of the time.
  EXPECT_EQ(lift.step(1.1, 0.1 - 0.2 * (3 * 0.01 - 2 * 0.001)).along.unused, "");
  EXPECT_EQ(lift.step(1.5, 0).along.unused, "");
  EXPECT_EQ(lift.step(1.6, 0.02).along.unused, "no path is in force");
}

TEST(WouldTouch, AQuinticIsFollowedWhereThePointsHaveAccelerations) {
  using Answer = deformable_ccd::WouldTouch::Response;
  Lift lift(0.01, true);
  lift.step(1, 0.1);
  lift.step(1.1, 0.1);
  JointTrajectory dips = lifts(0, {{0, 0.1}, {1, 0.1}});
  for (auto& point : dips.points) point.velocities = {0};
  EXPECT_EQ(lift.driven.pipeline.wouldTouch(dips).verdict, Answer::FREE);
  for (auto& point : dips.points) point.accelerations = {-8};
  // 0.1 - 4 u^2 (1 - u)^2, onto the table, 0.099 m below.
  const Answer answer = lift.driven.pipeline.wouldTouch(dips);
  EXPECT_EQ(answer.verdict, Answer::TOUCHES) << answer.reason;
  EXPECT_LE(answer.first, 0.185);
  EXPECT_GE(answer.first, 0.17);
}

TEST(WouldTouch, AJumpInNoTimeIsNoMotion) {
  Lift lift(0.01, true);
  lift.step(1, 0.1);
  lift.step(1.1, 0.1);
  const auto answer = lift.driven.pipeline.wouldTouch(lifts(0, {{0, 0.1}, {1e-9, -0.5}}));
  EXPECT_EQ(answer.verdict, answer.NOT_PROVED);
  EXPECT_EQ(answer.reason, "points[1]/time_from_start is 1e-09 s, after 0 s");
}

}  // namespace
}  // namespace test
}  // namespace dccd
