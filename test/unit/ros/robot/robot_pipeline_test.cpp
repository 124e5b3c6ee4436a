// A robot's links beside a cloth: placed by tf, against independent kinematics, with links that are missing or lost.
#include <random>

#include "panda.h"
#include "robot_scene.h"
#include "robot_texts.h"

namespace dccd {
namespace test {
namespace {

/// Two plates of 1 m x 1 m x 2 mm, in the planes of their frames.
std::string plates() {
  const std::string plate = collision("<box size='1 1 0.002'/>");
  return robotOf(link("palm", plate) + link("thumb", plate) + joint("palm", "thumb"));
}

class RobotPipeline : public ::testing::Test {
 protected:
  void start(const XmlRpcValue& tree, const std::string& urdf = plates(), const std::string& srdf = "") {
    driven_ = std::make_unique<Driven>(tree, loads(urdf, srdf));
  }
  void put(const std::string& child, double stamp_s, double z) { driven_->tell({above(child, z, ros::Time(stamp_s))}); }
  /// The outcome of a cloth's frame.
  const Outcome& feed(double stamp_s, float z) { return driven_->feed(stamp_s, z); }
  bool unproved(const std::string& part) { return says(driven_->outcome.missing(), part); }

  std::unique_ptr<Driven> driven_;
};

TEST_F(RobotPipeline, ALinkIsABodyThatTfCarries) {
  start(robotScene());
  for (const double at : {1.0, 1.1}) {
    put("palm", at, 0.099);  // its upper side at 0.1
    put("thumb", at, 0.0985);
  }
  feed(1, 0.3f);
  const Outcome& outcome = feed(1.1, 0.05f);
  EXPECT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  const Assurance assurance = assuranceOf(outcome);
  EXPECT_TRUE(assurance.proved);
  EXPECT_EQ(assurance.touching, Touching::NEW);
  EXPECT_NEAR(outcome.earliest_toc, 0.8, 1e-6);
  for (const Contact& contact : outcome.contacts)
    EXPECT_EQ(contact.body[0], 0) << "the plates cross, and are one robot";
  EXPECT_TRUE(says(outcome.excluded, "'palm', 'thumb': not against the map"));
  EXPECT_TRUE(says(outcome.excluded, "links of the robot against each other"));
}

// A list of 41 names hides what else was left out.
TEST_F(RobotPipeline, ManyLinksAreCountedInASentence) {
  const std::string plate = collision("<box size='1 1 0.002'/>");
  const std::string urdf = robotOf(link("a", plate + plate) + link("b", plate) + link("c", plate) + link("d", plate) +
                                   joint("a", "b") + joint("b", "c") + joint("c", "d"));
  for (const bool with_map : {true, false}) {
    start(robotScene("", with_map ? "octomap_topic: /map" : "effects: {octomap: 'off'}"), urdf);
    if (with_map) driven_->giveMap(1);
    for (const double at : {1.0, 1.1}) {
      for (const char* name : {"a", "b", "c", "d"}) put(name, at, -1);
    }
    feed(1, 0.3f);
    const std::vector<std::string>& excluded = feed(1.1, 0.3f).excluded;
    EXPECT_TRUE(says(excluded, with_map ? "the robot's 4 links: not against the map"
                                        : "bodies 'mesh', the robot's 4 links: not against the map"))
        << joinedText(excluded);
    EXPECT_FALSE(says(excluded, "'b'")) << joinedText(excluded);
    EXPECT_FALSE(with_map && says(excluded, "bodies"));
  }
}

// As long as the hand is closed; once it is open, what touches is news, though it touched before.
TEST_F(RobotPipeline, WhatTheHandHoldsIsExpectedUntilItOpens) {
  start(robotScene("holds: {mesh: palm}"));
  for (const double at : {1.0, 1.1, 1.2, 1.3}) {
    put("palm", at, 0.1);
    put("thumb", at, -1);
  }
  feed(1, 0.3f);
  feed(1.1, 0.05f);
  EXPECT_EQ(assuranceOf(driven_->outcome).touching, Touching::EXPECTED);
  EXPECT_TRUE(says(driven_->outcome.expected, "mesh with palm"));
  MonitorPipeline& pipeline = driven_->pipeline;
  EXPECT_EQ(pipeline.monitor().options().held.size(), 1u) << "they share own voxels as long";
  EXPECT_THROW(pipeline.setHold("mesh", "thumb", false), ParameterError);
  EXPECT_THROW(pipeline.setHold("cloth", "", false), ParameterError);
  pipeline.setPhase("");  // leaves it as it is
  pipeline.setHold("mesh", "palm", false);
  feed(1.2, 0.0995f);  // within the plate: it crosses all the time
  EXPECT_EQ(assuranceOf(driven_->outcome).touching, Touching::NEW);
  EXPECT_TRUE(driven_->outcome.expected.empty());
  EXPECT_TRUE(pipeline.monitor().options().held.empty());
  pipeline.setHold("", "", true);
  feed(1.3, 0.05f);
  EXPECT_EQ(assuranceOf(driven_->outcome).touching, Touching::EXPECTED);
  EXPECT_NE(pipeline.phaseInWords().find("mesh with palm"), std::string::npos);
}

// As before joint states come: the reason once, and the name of each link.
TEST_F(RobotPipeline, LinksWithoutTransformsShareOneReason) {
  start(robotScene());
  for (const double at : {1.0, 1.1, 1.2}) feed(at, 0.3f);
  const std::string said = joinedText(driven_->outcome.missing()), known = " is not known for all of this step (";
  EXPECT_NE(said.find("(the first is 0 of 'palm', whose place is not known)"), std::string::npos) << said;
  EXPECT_NE(said.find("where body 'palm' was" + known + "no transform of its frame at "), std::string::npos) << said;
  EXPECT_EQ(said.find(known), said.rfind(known)) << said;
  const std::string nor = "), nor where body 'thumb' was";
  EXPECT_NE(said.find(nor), std::string::npos) << said;
  EXPECT_EQ(said.find(nor), said.rfind(nor)) << said;
}

// The state is unproved and names it; the other link's contacts are found all the same.
TEST_F(RobotPipeline, ALinkWithoutTransformIsNamedAndTheRestGoesOn) {
  start(robotScene());
  put("palm", 1.0, 0.1);
  put("palm", 1.1, 0.1);
  feed(1, 0.3f);
  feed(1.1, 0.05f);
  EXPECT_EQ(driven_->outcome.status, StepStatus::PARTIAL);
  EXPECT_TRUE(unproved("where body 'thumb' was is not known")) << joinedText(driven_->outcome.missing());
  EXPECT_FALSE(unproved("'palm'"));
  ASSERT_FALSE(driven_->outcome.contacts.empty());
  EXPECT_EQ(driven_->outcome.contacts[0].body[1], 1) << "the palm's";
  const std::string problem = driven_->pipeline.takeProblem(2);
  EXPECT_NE(problem.find("not watched meanwhile: no transform from 'thumb' to 'world'"), std::string::npos) << problem;
  // It comes back: the step that began without it is not proved, the next one is.
  for (const double at : {1.2, 1.3}) {
    put("palm", at, 0.1);
    put("thumb", at, 0.4);
  }
  feed(1.2, 0.3f);
  EXPECT_TRUE(unproved("where body 'thumb' was is not known")) << joinedText(driven_->outcome.missing());
  feed(1.3, 0.3f);
  EXPECT_TRUE(assuranceOf(driven_->outcome).clear()) << joinedText(driven_->outcome.missing());
  EXPECT_EQ(driven_->pipeline.takeProblem(2), "");
  // And is lost again.
  put("palm", 1.4, 0.1);
  feed(1.4, 0.3f);
  EXPECT_TRUE(unproved("where body 'thumb' was is not known"));
  EXPECT_NE(driven_->pipeline.takeProblem(2), "");
}

// Until its time is up, a frame waits for the last link.
TEST_F(RobotPipeline, ALateTransformIsWaitedFor) {
  XmlRpcValue tree = robotScene();
  tree["transform_timeout_s"] = 0.2;
  start(tree);
  const auto take = [&](double stamp_s, std::int64_t now_ns) { driven_->take(0, cloud(stamp_s, 0.3f), now_ns); };
  Outcome& outcome = driven_->outcome;
  for (const double at : {1.0, 1.1}) put("palm", at, 0.1);
  put("thumb", 1.0, 0.1);
  take(1, 0);
  ASSERT_TRUE(driven_->pipeline.nextOutcome(0, outcome));
  take(1.1, 0);
  ASSERT_FALSE(driven_->pipeline.nextOutcome(100000000, outcome));
  put("thumb", 1.1, 0.1);
  ASSERT_TRUE(driven_->pipeline.nextOutcome(150000000, outcome));
  EXPECT_TRUE(assuranceOf(outcome).clear()) << joinedText(outcome.missing());
}

TEST_F(RobotPipeline, WhatOfItCouldNotBeReadIsNotVouchedFor) {
  const std::string gone = link("gone", collision("<mesh filename='package://no_such_package/a.stl'/>"));
  const std::pair<std::string, const char*> cases[] = {
      {robotOf(gone + link("palm", collision("<box size='1 1 0.002'/>")) + joint("palm", "gone")),
       "link 'gone' is not watched: package://no_such_package/a.stl: there is no package 'no_such_package'"},
      {"<robot", "nothing of the robot is watched: test.urdf is no XML"},
  };
  for (const auto& [urdf, expected] : cases) {
    start(robotScene(), urdf);
    for (const double at : {1.0, 1.1}) put("palm", at, 0.1);
    feed(1, 0.3f);
    feed(1.1, 0.25f);
    EXPECT_EQ(driven_->outcome.status, StepStatus::OK) << "the rest is answered";
    EXPECT_FALSE(assuranceOf(driven_->outcome).proved);
    EXPECT_TRUE(unproved(expected)) << joinedText(driven_->outcome.missing());
    EXPECT_TRUE(says(driven_->pipeline.checkNow(0).missing(), expected));
  }
}

// KDL reads the URDF by itself and multiplies its own frames. Each joint goes to tf as robot_state_publisher would send
// it.
TEST_F(RobotPipeline, ThePandasLinksAreWhereKdlHasThem) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  if (!Panda::isThere()) GTEST_SKIP() << "no panda in " << dataDir();
  const Panda panda;
  XmlRpcValue parameters = robotScene();
  parameters["fixed_frame"] = "panda_link0";
  parameters["robot"]["semantic"] = "robot_description_semantic";
  parameters["rigid_tolerance_m"] = 0.01;
  start(parameters, panda.urdf(), panda.srdf());
  const Robot& robot = driven_->config.robot;
  EXPECT_EQ(joinedText(robot.missing), "");
  EXPECT_EQ(robot.parts.size(), 11u);
  EXPECT_EQ(robot.groups.at("panda_arm").size(), 8u);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-2.5, 2.5);
  std::map<std::string, KDL::Frame> before;
  double furthest_m = 0;
  for (int frame = 0; frame < 20; ++frame) {
    const double stamp_s = 1 + 0.1 * frame;
    std::vector<double> positions(panda.joints());
    for (double& position : positions) position = angle(random);
    const Panda::Placed placed = panda.place(positions, stamp_s);
    driven_->feed_tf.add(placed.tf, false);
    const Outcome& outcome = driven_->feed(stamp_s, 5, {}, "panda_link0");
    if (frame > 0) ASSERT_TRUE(outcome.answered) << outcome.reason;
    for (std::size_t p = 0; p < robot.parts.size() && frame > 0; ++p) {
      const Body& body = outcome.step->bodies[1 + p];
      const Positions& own = robot.parts[p].mesh->positions;
      for (const auto& [at, ends] : {std::pair(before, body.t0), std::pair(placed.from_base, body.t1)}) {
        ASSERT_EQ(ends->size(), own.size());
        for (std::size_t v = 0; v < own.size(); ++v) {
          const KDL::Vector expected = at.at(robot.parts[p].link) * KDL::Vector(own[v].x(), own[v].y(), own[v].z());
          furthest_m = std::max(furthest_m, ((*ends)[v] - Vec3(expected.x(), expected.y(), expected.z())).norm());
        }
      }
    }
    before = placed.from_base;
  }
  EXPECT_LT(furthest_m, 1e-12);
  EXPECT_GT(furthest_m, 0) << "two computations";
}

}  // namespace
}  // namespace test
}  // namespace dccd
