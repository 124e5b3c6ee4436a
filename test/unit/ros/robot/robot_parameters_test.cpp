// The parameters under `robot`, and where links and groups may stand for bodies.
#include <fstream>

#include "node/robot_source.h"
#include "robot_texts.h"
#include "support/folder_test.h"
#include "support/said.h"
#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

std::string armAndHand() {
  const std::string box = collision("<box size='1 1 1'/>");
  return robotOf(link("arm", box) + link("palm", box + box) + link("cable", "") + joint("arm", "palm") +
                 joint("palm", "cable"));
}

const char SRDF[] =
    "<robot name='r'><group name='hand'><link name='palm'/><link name='cable'/></group>"
    "<group name='both'><link name='arm'/><link name='palm'/></group>"
    "<disable_collisions link1='palm' link2='arm'/></robot>";

MonitorConfig read(const std::string& yaml, const std::string& urdf = armAndHand(), const std::string& srdf = SRDF) {
  return readConfig(parseYaml(yaml, "p.yaml"), "", loads(urdf, srdf));
}

std::string errorOf(const std::string& yaml) {
  return said<ParameterError>([&] { read(yaml); });
}

using Numbers = std::vector<std::uint16_t>;

TEST(RobotParameters, ANameIsAllThatIsNeeded) {
  for (const char* yaml : {"robot: robot_description\n", "robot: {description: robot_description}\n"}) {
    const MonitorConfig config = read(yaml);
    ASSERT_EQ(config.bodies.size(), 4u);
    EXPECT_EQ(config.bodies[0].body.name, "mesh");
    EXPECT_EQ(config.bodies[1].body.name, "arm");
    EXPECT_EQ(config.bodies[2].body.name, "palm");
    EXPECT_EQ(config.bodies[3].body.name, "palm/2");
    EXPECT_EQ(config.bodies[3].tf_frame, "palm");
    EXPECT_TRUE(config.bodies[0].body.not_against.empty());
    EXPECT_EQ(config.bodies[1].body.not_against, (Numbers{2, 3}));
    EXPECT_EQ(config.bodies[2].body.not_against, (Numbers{1, 3}));
    EXPECT_FALSE(config.bodies[1].body.against_obstacle);
    EXPECT_TRUE(config.bodies[1].isRigid());
    EXPECT_EQ(config.monitor.detector.accuracy.rung, Accuracy::EXACT);
    EXPECT_EQ(config.monitor.detector.excluded, std::vector<std::string>{"links of the robot against each other"});
  }
}

TEST(RobotParameters, LinksHaveASpeedBoundOfTheirOwn) {
  const MonitorConfig one = read("max_speed_m_s: 0.5\nrobot: {description: d, max_speed_m_s: 0.3}\n");
  EXPECT_EQ(one.bodies[0].speed.max_m_s, 0.5);
  EXPECT_EQ(one.bodies[1].speed.max_m_s, 0.3);
  EXPECT_EQ(one.speedBounds(6)[5].max_m_s, 0.3) << "of what is attached, too";
  EXPECT_EQ(read("max_speed_m_s: 0.5\nrobot: d\n").bodies[1].speed.max_m_s, 0.5);
}

TEST(RobotParameters, LinksMeetEachOtherAndTheMapWhereThatIsAskedFor) {
  const std::string yaml = "robot: {description: d, against_links: true, against_map: true}\n";
  const MonitorConfig config = read(yaml, armAndHand(), "");
  EXPECT_TRUE(config.bodies[1].body.not_against.empty());
  EXPECT_EQ(config.bodies[2].body.not_against, Numbers{3}) << "elements of one link";
  EXPECT_TRUE(config.bodies[1].body.against_obstacle);
  EXPECT_TRUE(config.monitor.detector.excluded.empty());
  const MonitorConfig disabled = read("robot: {description: d, semantic: s, against_links: true}\n");
  EXPECT_EQ(disabled.bodies[1].body.not_against, (Numbers{2, 3}));
  EXPECT_EQ(disabled.monitor.detector.excluded,
            std::vector<std::string>{"1 pairs of the robot's links by disable_collisions"});
}

TEST(RobotParameters, PaddingIsAMinimumSeparation) {
  const MonitorConfig config = read("robot: {description: d, padding_m: 0.01, links: {palm: {padding_m: 0.02}}}\n");
  EXPECT_EQ(config.bodies[0].body.minimum_separation_m, 0);
  EXPECT_EQ(config.bodies[1].body.minimum_separation_m, 0.01);
  EXPECT_EQ(config.bodies[2].body.minimum_separation_m, 0.02);
  EXPECT_EQ(config.bodies[3].body.minimum_separation_m, 0.02);
  EXPECT_EQ(config.monitor.detector.accuracy.rung, Accuracy::CONSERVATIVE);
  EXPECT_TRUE(mentions(errorOf("accuracy: exact\nrobot: {description: d, padding_m: 0.01}\n"),
                       "parameter robot/padding_m asks for a minimum separation"));
}

TEST(RobotParameters, LinksOwnTheVoxelsInWhichTheyAreSeen) {
  const auto reach = [](const std::string& yaml) { return read(yaml).bodies[1].body.own_voxels_m; };
  EXPECT_EQ(reach("robot: {description: d}\n"), ONE_VOXEL);
  EXPECT_EQ(reach("robot: {description: d, own_voxels_m: 0.03}\n"), 0.03);
  EXPECT_EQ(reach("own_voxels_m: 0.01\nrobot: {description: d, own_voxels_m: 0}\n"), 0);
  EXPECT_EQ(reach("effects: {own_voxels: \"off\"}\nrobot: {description: d}\n"), 0);
  EXPECT_EQ(reach("unknown_space: occupied\nunknown_box: [0, 0, 0, 1, 1, 1]\nrobot: {description: d}\n"), 0);
}

TEST(RobotParameters, GroupsAndLinksStandForTheirBodies) {
  const MonitorConfig config = read(
      "robot: {description: d, semantic: s}\n"
      "topology: {sets: {hem: [1]}}\n"
      "expected_contacts:\n"
      "  - {between: [mesh, group hand], vertices: {mesh: hem}, phase: carry}\n"
      "  - {between: [mesh, cable], phase: never}\n"
      "  - {between: [link palm, octomap]}\n"
      "  - {between: [group both, group both]}\n"
      "  - {between: [palm/2, mesh]}\n"
      "minimum_separation_pairs:\n"
      "  - {between: [mesh, group hand], separation_m: 0.01}\n"
      "phase: never\n");
  std::vector<std::string> pairs;
  for (std::size_t e = 0; e < config.expected_contacts.size(); ++e) {
    const auto& partners = config.expected_contacts[e].partners;
    std::string text = std::to_string(config.expected_entry[e]) + ":";
    for (const ExpectedPartner& partner : partners) {
      text += " " + (partner.body == OBSTACLE_BODY ? "octomap" : config.bodies[partner.body].body.name);
    }
    pairs.push_back(text);
  }
  EXPECT_EQ(pairs, (std::vector<std::string>{"0: mesh palm", "0: mesh palm/2", "2: palm octomap", "2: palm/2 octomap",
                                             "3: arm arm", "3: arm palm", "3: arm palm/2", "3: palm palm",
                                             "3: palm palm/2", "3: palm/2 palm/2", "4: palm/2 mesh"}));
  EXPECT_EQ(config.expected_contacts[0].partners[0].set, "hem");
  EXPECT_EQ(config.phases(), (std::vector<std::string>{"carry", "never"})) << "also of whom nobody watches";
  ASSERT_EQ(config.bodies[0].body.separations.size(), 2u);
  EXPECT_EQ(config.bodies[0].body.separations[1].body, 3u);
}

// Its own body comes first; the link is "link NAME".
TEST(RobotParameters, ALinkOfABodysNameIsCalledALink) {
  const MonitorConfig config =
      read("robot: d\nbodies: {palm: {topic: a}}\nexpected_contacts:\n  - {between: [palm, link palm]}\n");
  EXPECT_EQ(config.bodies[0].body.name, "palm");
  EXPECT_EQ(config.bodies[2].body.name, "link palm");
  ASSERT_EQ(config.expected_contacts.size(), 2u);
  EXPECT_EQ(config.expected_contacts[0].partners[0].body, 0u);
  EXPECT_EQ(config.expected_contacts[0].partners[1].body, 2u);
}

TEST(RobotParameters, WhatHoldsABodyIsExpectedToTouchItUntilItIsOpen) {
  MonitorConfig config = read("robot: {description: d, semantic: s, holds: {mesh: [group hand, arm]}}\n");
  ASSERT_EQ(config.holds.size(), 2u);
  EXPECT_EQ(config.holds[0].by, "group hand");
  EXPECT_EQ(config.expectedIn("").size(), 3u) << "palm, palm/2 and arm";
  const std::uint64_t closed = config.hash();
  config.holds[0].closed = false;
  const std::vector<Expectation> expected = config.expectedIn("");
  ASSERT_EQ(expected.size(), 1u);
  EXPECT_EQ(expected[0].partners[0].body, 0);
  EXPECT_EQ(config.bodies[expected[0].partners[1].body].body.name, "arm");
  EXPECT_NE(config.hash(), closed);
  EXPECT_TRUE(read("robot: {description: d, holds: {mesh: palm}}\n", "no urdf").expectedIn("").empty());
}

TEST(RobotParameters, MistakesAreNamed) {
  const std::pair<const char*, const char*> cases[] = {
      {"robot: {padding_m: 1}\n", "robot/description is needed"},
      {"robot: {description: d, paddding_m: 1}\n", "robot/paddding_m is not known; nearest is robot/padding_m"},
      {"robot: {description: d, padding_m: -1}\n", "robot/padding_m is -1"},
      {"robot: {description: d, max_own_voxels: -1}\n", "robot/max_own_voxels is -1"},
      {"robot: {description: d, links: {pall: {scale: 2}}}\n",
       "robot/links/pall is no link of the robot; nearest is 'palm'"},
      {"robot: {description: d, leave_out: [group hands]}\n", "robot/leave_out names 'group hands'"},
      {"robot: {description: d, leave_out: [pal]}\n", "nearest is 'palm'"},
      {"robot: {description: d, leave_out: [1]}\n", "must list links and groups by name"},
      {"robot: {description: d, holds: {mash: palm}}\n", "robot/holds/mash is no body; nearest is 'mesh'"},
      {"robot: {description: d, holds: {arm: palm}}\n", "robot/holds/arm is no body"},
      {"robot: {description: d, semantic: s, holds: {mesh: group hnd}}\n", "nearest is 'group hand'"},
      {"robot: {description: d, holds: {mesh: [palm, 1]}}\n", "robot/holds/mesh must name links and groups"},
      {"robot: d\nexpected_contacts:\n  - {between: [mesh, group hnd]}\n", "nearest is 'group hand'"},
      {"robot: d\nexpected_contacts:\n  - {between: [mesh, plam]}\n", "nearest is 'palm'"},
      {"robot: d\nminimum_separation_pairs:\n  - {between: [mesh, palm], separation_m: 0}\n"
       "  - {between: [group hand, mesh], separation_m: 0}\n",
       "names palm and mesh, as minimum_separation_pairs[0] does"},
  };
  for (const auto& [yaml, expected] : cases) {
    EXPECT_TRUE(mentions(errorOf(yaml), expected)) << yaml << errorOf(yaml);
  }
  XmlRpcValue tree;
  tree["robot"] = "robot_description";
  EXPECT_TRUE(mentions(test::errorOf(tree), "~robot has no meaning here"));
}

// What names something of it may be right.
TEST(RobotParameters, OfARobotThatCouldNotBeReadNothingIsRefused) {
  const char yaml[] =
      "robot: {description: d, semantic: s, leave_out: [x, group y], links: {z: {scale: 2}}}\nphase: carry\n"
      "expected_contacts:\n  - {between: [mesh, group hand], vertices: {palm: [1]}, phase: carry}\n"
      "  - {between: [mesh, palm]}\n";
  for (const char* off : {"", "effects: {rigid_bodies: off}\n"}) {
    const MonitorConfig config = read(yaml + std::string(off), "no urdf");
    EXPECT_EQ(config.bodies.size(), 1u);
    EXPECT_TRUE(config.expected_contacts.empty());
    EXPECT_EQ(config.robot.missing.size(), *off ? 0u : 1u);
    EXPECT_EQ(says(config.monitor.detector.excluded, "the robot by effects/rigid_bodies: off"), *off != 0);
  }
  const MonitorConfig no_groups = read(
      "robot: {description: d, semantic: s, leave_out: [group y]}\n"
      "expected_contacts:\n  - {between: [mesh, group hand]}\n",
      armAndHand(), "<no_srdf");
  EXPECT_EQ(no_groups.bodies.size(), 4u);
  EXPECT_TRUE(says(no_groups.robot.missing, "no group of the robot is known: test.srdf is no XML"));
}

TEST(RobotParameters, AnotherRobotIsAnotherConfiguration) {
  EXPECT_EQ(read("robot: d\n").hash(), read("robot: d\n").hash());
  EXPECT_NE(read("robot: d\n").hash(), read("robot: d\n", robotOf(link("a", ""))).hash());
}

class RobotFiles : public FolderTest {};

TEST_F(RobotFiles, AreReadWhereThereIsNoParameterServer) {
  const std::string urdf = (folder_ / "r.urdf").string(), srdf = "file://" + (folder_ / "r.srdf").string();
  std::ofstream(folder_ / "r.urdf") << armAndHand();
  std::ofstream(folder_ / "r.srdf") << SRDF;
  const auto with = [](const std::string& yaml) { return readConfig(parseYaml(yaml, "p.yaml"), "", robotOfFiles()); };
  const MonitorConfig config = with("robot: {description: " + urdf + ", semantic: '" + srdf + "'}\n");
  EXPECT_EQ(config.bodies.size(), 4u);
  EXPECT_EQ(config.robot.groups.size(), 2u);
  EXPECT_TRUE(says(with("robot: " + (folder_ / "no.urdf").string() + "\n").robot.missing, "cannot be read"));
  const std::string text = said<ParameterError>([&] { with("robot: robot_description\n"); });
  EXPECT_TRUE(mentions(text, "there is no parameter server: write the path of a file")) << text;
}

}  // namespace
}  // namespace test
}  // namespace dccd
