// A robot's links beside a cloth: placed by tf, against independent kinematics, with links that are missing or lost.
#include <tf2_msgs/TFMessage.h>

#include <fstream>
#include <iterator>
#include <kdl/frames_io.hpp>
#include <kdl_parser/kdl_parser.hpp>
#include <random>

#include "robot_texts.h"
#include "support/data.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

/// Two plates of 1 m x 1 m x 2 mm, in the planes of their frames.
std::string plates() {
  const std::string plate = collision("<box size='1 1 0.002'/>");
  return robotOf(link("palm", plate) + link("thumb", plate) + joint("palm", "thumb"));
}

RobotLoader loads(const std::string& urdf, const std::string& srdf = "") {
  return [=](const RobotConfig& config, double tolerance_m) { return robotFrom(urdf, srdf, config, tolerance_m); };
}

XmlRpcValue robotScene() {
  XmlRpcValue tree = scene();
  tree["effects"]["octomap"] = "off";
  tree["transform_timeout_s"] = 0.0;
  tree["robot"]["description"] = "robot_description";
  return tree;
}

class RobotPipeline : public ::testing::Test {
 protected:
  void start(const XmlRpcValue& tree, const std::string& urdf = plates(), const std::string& srdf = "") {
    driven_ = std::make_unique<Driven>(tree, loads(urdf, srdf));
  }
  void put(const std::string& child, double stamp_s, double z) {
    tf2_msgs::TFMessage message;
    geometry_msgs::TransformStamped& one = message.transforms.emplace_back();
    one.header.frame_id = "world";
    one.header.stamp = ros::Time(stamp_s);
    one.child_frame_id = child;
    one.transform.translation.z = z;
    one.transform.rotation.w = 1;
    driven_->feed_tf.add(message, false);
  }
  /// The outcome of a cloth's frame.
  const Outcome& feed(double stamp_s, float z) { return driven_->feed(stamp_s, z); }
  bool unproved(const std::string& part) { return says(driven_->outcome.unproved, part); }

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

TEST_F(RobotPipeline, WhatAGroupMayTouchIsExpected) {
  XmlRpcValue tree = robotScene();
  tree["robot"]["semantic"] = "robot_description_semantic";
  tree["expected_contacts"][0]["between"][0] = "mesh";
  tree["expected_contacts"][0]["between"][1] = "group hand";
  start(tree, plates(), robotOf("<group name='hand'><chain base_link='palm' tip_link='thumb'/></group>"));
  for (const double at : {1.0, 1.1}) {
    put("palm", at, 0.1);
    put("thumb", at, -1);
  }
  feed(1, 0.3f);
  feed(1.1, 0.05f);
  EXPECT_EQ(assuranceOf(driven_->outcome).touching, Touching::EXPECTED);
  EXPECT_TRUE(assuranceOf(driven_->outcome).proved);
}

// As long as the hand is closed; once it is open, what touches is news, though it touched before.
TEST_F(RobotPipeline, WhatTheHandHoldsIsExpectedUntilItOpens) {
  XmlRpcValue tree = robotScene();
  tree["robot"]["holds"]["mesh"] = "palm";
  start(tree);
  for (const double at : {1.0, 1.1, 1.2, 1.3}) {
    put("palm", at, 0.1);
    put("thumb", at, -1);
  }
  feed(1, 0.3f);
  feed(1.1, 0.05f);
  EXPECT_EQ(assuranceOf(driven_->outcome).touching, Touching::EXPECTED);
  EXPECT_TRUE(says(driven_->outcome.expected, "mesh with palm"));
  MonitorPipeline& pipeline = driven_->pipeline;
  EXPECT_THROW(pipeline.setHold("mesh", "thumb", false), ParameterError);
  EXPECT_THROW(pipeline.setHold("cloth", "", false), ParameterError);
  pipeline.setPhase("");  // leaves it as it is
  pipeline.setHold("mesh", "palm", false);
  feed(1.2, 0.0995f);  // within the plate: it crosses all the time
  EXPECT_EQ(assuranceOf(driven_->outcome).touching, Touching::NEW);
  EXPECT_TRUE(driven_->outcome.expected.empty());
  pipeline.setHold("", "", true);
  feed(1.3, 0.05f);
  EXPECT_EQ(assuranceOf(driven_->outcome).touching, Touching::EXPECTED);
  EXPECT_NE(pipeline.phaseInWords().find("mesh with palm"), std::string::npos);
}

// The state is unproved and names it; the other link's contacts are found all the same.
TEST_F(RobotPipeline, ALinkWithoutTransformIsNamedAndTheRestGoesOn) {
  start(robotScene());
  put("palm", 1.0, 0.1);
  put("palm", 1.1, 0.1);
  feed(1, 0.3f);
  feed(1.1, 0.05f);
  EXPECT_EQ(driven_->outcome.status, StepStatus::PARTIAL);
  EXPECT_TRUE(unproved("where body 'thumb' was is not known")) << joinedText(driven_->outcome.unproved);
  EXPECT_FALSE(unproved("'palm'"));
  ASSERT_FALSE(driven_->outcome.contacts.empty());
  EXPECT_EQ(driven_->outcome.contacts[0].body[1], 1) << "the palm's";
  const std::string complaint = driven_->pipeline.takeComplaint(2);
  EXPECT_NE(complaint.find("not watched meanwhile: no transform from 'thumb' to 'world'"), std::string::npos)
      << complaint;
  // It comes back: the step that began without it is not proved, the next one is.
  for (const double at : {1.2, 1.3}) {
    put("palm", at, 0.1);
    put("thumb", at, 0.4);
  }
  feed(1.2, 0.3f);
  EXPECT_TRUE(unproved("where body 'thumb' was is not known")) << joinedText(driven_->outcome.unproved);
  feed(1.3, 0.3f);
  EXPECT_TRUE(assuranceOf(driven_->outcome).clear()) << joinedText(driven_->outcome.unproved);
  EXPECT_EQ(driven_->pipeline.takeComplaint(2), "");
  // And is lost again.
  put("palm", 1.4, 0.1);
  feed(1.4, 0.3f);
  EXPECT_TRUE(unproved("where body 'thumb' was is not known"));
  EXPECT_NE(driven_->pipeline.takeComplaint(2), "");
}

// Until its time is up, a frame waits for the last link.
TEST_F(RobotPipeline, ALateTransformIsWaitedFor) {
  XmlRpcValue tree = robotScene();
  tree["transform_timeout_s"] = 0.2;
  start(tree);
  const auto take = [&](double stamp_s, std::int64_t now_ns) {
    driven_->pipeline.take(0, {"sensor_msgs/PointCloud2", cloud(stamp_s, 0.3f), now_ns, now_ns});
  };
  Outcome& outcome = driven_->outcome;
  for (const double at : {1.0, 1.1}) put("palm", at, 0.1);
  put("thumb", 1.0, 0.1);
  take(1, 0);
  ASSERT_TRUE(driven_->pipeline.nextOutcome(0, outcome));
  take(1.1, 0);
  ASSERT_FALSE(driven_->pipeline.nextOutcome(100000000, outcome));
  put("thumb", 1.1, 0.1);
  ASSERT_TRUE(driven_->pipeline.nextOutcome(150000000, outcome));
  EXPECT_TRUE(assuranceOf(outcome).clear()) << joinedText(outcome.unproved);
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
    EXPECT_TRUE(unproved(expected)) << joinedText(driven_->outcome.unproved);
    EXPECT_TRUE(says(driven_->pipeline.checkNow().unproved, expected));
  }
}

TEST_F(RobotPipeline, PaddingIsADistanceThatIsHeldExactly) {
  XmlRpcValue tree = robotScene();
  tree["robot"]["padding_m"] = 0.05;
  start(tree);
  for (const double at : {1.0, 1.1, 1.2}) {
    put("palm", at, 0.099);
    put("thumb", at, 0.099);
  }
  feed(1, 0.3f);
  EXPECT_TRUE(assuranceOf(feed(1.1, 0.151f)).clear()) << "0.051 m above";
  EXPECT_FALSE(feed(1.2, 0.149f).contacts.empty());
}

// KDL reads the URDF by itself and multiplies its own frames. Each joint goes to tf as robot_state_publisher would send
// it.
TEST_F(RobotPipeline, ThePandasLinksAreWhereKdlHasThem) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const std::string folder = dataDir() + "/robots/panda";
  std::ifstream file(folder + "/panda.urdf"), semantic(folder + "/panda.srdf");
  if (!file) GTEST_SKIP() << "no panda in " << folder;
  std::string urdf{std::istreambuf_iterator<char>(file), {}}, srdf{std::istreambuf_iterator<char>(semantic), {}};
  const std::string package = "package://moveit_resources_panda_description";
  for (std::size_t at = 0; (at = urdf.find(package, at)) != std::string::npos;) {
    urdf.replace(at, package.size(), "file://" + folder);
  }
  KDL::Tree tree;
  ASSERT_TRUE(kdl_parser::treeFromString(urdf, tree));
  XmlRpcValue parameters = robotScene();
  parameters["fixed_frame"] = "panda_link0";
  parameters["robot"]["semantic"] = "robot_description_semantic";
  parameters["rigid_tolerance_m"] = 0.01;
  start(parameters, urdf, srdf);
  const Robot& robot = driven_->config.robot;
  EXPECT_EQ(joinedText(robot.missing), "");
  EXPECT_EQ(robot.parts.size(), 11u);
  EXPECT_EQ(robot.groups.at("panda_arm").size(), 9u);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> angle(-2.5, 2.5);
  double furthest_m = 0;
  for (int frame = 0; frame < 20; ++frame) {
    const double stamp_s = 1 + 0.1 * frame;
    std::map<std::string, KDL::Frame> from_base{{"panda_link0", KDL::Frame::Identity()}};
    tf2_msgs::TFMessage message;
    const std::function<void(const KDL::TreeElement&)> go = [&](const KDL::TreeElement& parent) {
      for (const auto& child : parent.children) {
        const KDL::Segment& segment = child->second.segment;
        const KDL::Frame pose = segment.pose(angle(random));
        from_base[segment.getName()] = from_base[parent.segment.getName()] * pose;
        geometry_msgs::TransformStamped& one = message.transforms.emplace_back();
        one.header.frame_id = parent.segment.getName();
        one.header.stamp = ros::Time(stamp_s);
        one.child_frame_id = segment.getName();
        one.transform.translation.x = pose.p.x();
        one.transform.translation.y = pose.p.y();
        one.transform.translation.z = pose.p.z();
        auto& q = one.transform.rotation;
        pose.M.GetQuaternion(q.x, q.y, q.z, q.w);
        go(child->second);
      }
    };
    go(tree.getRootSegment()->second);
    driven_->feed_tf.add(message, false);
    const Outcome& outcome = driven_->feed(stamp_s, 5, {}, "panda_link0");
    if (frame == 0) continue;
    ASSERT_TRUE(outcome.answered) << outcome.reason;
    for (std::size_t p = 0; p < robot.parts.size(); ++p) {
      const KDL::Frame& at = from_base.at(robot.parts[p].link);
      const Positions &placed = *outcome.step->bodies[1 + p].t1, &own = robot.parts[p].mesh->positions;
      ASSERT_EQ(placed.size(), own.size());
      for (std::size_t v = 0; v < own.size(); ++v) {
        const KDL::Vector expected = at * KDL::Vector(own[v].x(), own[v].y(), own[v].z());
        furthest_m = std::max(furthest_m, (placed[v] - Vec3(expected.x(), expected.y(), expected.z())).norm());
      }
    }
  }
  EXPECT_LT(furthest_m, 1e-12);
  EXPECT_GT(furthest_m, 0) << "two computations";
}

}  // namespace
}  // namespace test
}  // namespace dccd
