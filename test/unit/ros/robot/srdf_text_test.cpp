// Groups, end effectors and pairs that never meet, of an SRDF.
#include "robot_texts.h"
#include "support/data.h"

namespace dccd {
namespace test {
namespace {

using Names = std::vector<std::string>;

/// base - arm - wrist - palm, which carries thumb and finger.
std::string handSrdf() {
  return robotOf(link("base", "") + link("arm", "") + link("wrist", "") +
                 link("palm", collision("<box size='1 1 1'/>")) + link("thumb", "") + link("finger", "") +
                 joint("base", "arm") + joint("arm", "wrist") + joint("wrist", "palm") + joint("palm", "thumb") +
                 joint("palm", "finger"));
}

TEST(Srdf, GroupsAreLinksChainsJointsAndGroups) {
  const Robot robot = robotFrom(
      handSrdf(),
      robotOf("<group name='all'><group name='hand'/><group name='arm'/></group>"
              "<group name='arm'><chain base_link='base' tip_link='wrist'/></group>"
              "<group name='hand'><link name='palm'/><joint name='palm_finger'/><joint name='virtual'/></group>"
              "<end_effector name='gripper' parent_link='wrist' group='hand' parent_group='arm'/>"
              "<virtual_joint name='virtual' type='fixed' parent_frame='world' child_link='base'/>"
              "<group_state name='x' group='arm'/><passive_joint name='y'/><link_sphere_approximation link='z'/>"
              "<disable_collisions link1='base' link2='arm' reason='Adjacent'/>"));
  EXPECT_EQ(joinedText(robot.missing) + joinedText(robot.hints),
            "without geometry are links 'arm', 'base', 'finger', 'thumb', 'wrist'\n");
  EXPECT_EQ(robot.groups.at("arm"), (Names{"arm", "wrist"})) << "no joint of the chain moves its base";
  EXPECT_EQ(robot.groups.at("hand"), (Names{"palm", "finger"}));
  EXPECT_EQ(robot.groups.at("all"), (Names{"palm", "finger", "arm", "wrist"}));
  EXPECT_EQ(robot.groups.at("gripper"), robot.groups.at("hand"));
  ASSERT_EQ(robot.never_meet.size(), 1u);
  EXPECT_EQ(robot.never_meet[0], (std::pair<std::string, std::string>{"arm", "base"}));
}

// As MoveIt has it: from one tip to another, and from a tip to the base.
TEST(Srdf, AChainMayLeadOverALinkFromWhichBothEndsHang) {
  const Robot robot =
      robotFrom(handSrdf(), robotOf("<group name='a'><chain base_link='thumb' tip_link='finger'/></group>"
                                    "<group name='b'><chain base_link='palm' tip_link='arm'/></group>"
                                    "<group name='c'><chain base_link='arm' tip_link='arm'/></group>"));
  EXPECT_EQ(robot.groups.at("a"), (Names{"thumb", "palm", "finger"}));
  EXPECT_EQ(robot.groups.at("b"), (Names{"palm", "wrist", "arm"}));
  EXPECT_EQ(robot.groups.at("c"), Names{"arm"});
}

TEST(Srdf, DefaultsOfALinkGiveWayToPairs) {
  const Robot robot = robotFrom(handSrdf(), robotOf("<disable_collisions link1='thumb' link2='finger'/>"
                                                    "<enable_collisions link1='palm' link2='thumb'/>"
                                                    "<enable_collisions link1='arm' link2='palm'/>"
                                                    "<disable_collisions link1='palm' link2='arm'/>"
                                                    "<disable_default_collisions link='palm'/>"));
  using Pair = std::pair<std::string, std::string>;
  EXPECT_EQ(robot.never_meet,
            (std::vector<Pair>{
                {"arm", "palm"}, {"base", "palm"}, {"finger", "palm"}, {"finger", "thumb"}, {"palm", "wrist"}}));
}

// It is left out and named; the rest holds.
TEST(Srdf, UnknownLinksAndJointsAreNamed) {
  const Robot robot =
      robotFrom(handSrdf(), robotOf("<group name='hand'>\n<link name='pall'/><link name='palm'/></group>"
                                    "<group name='b'><joint name='turn'/></group>"
                                    "<group name='c'><chain base_link='base' tip_link='tip'/></group>"
                                    "<disable_collisions link1='palm' link2='cover'/>"));
  EXPECT_TRUE(robot.semantic_known);
  EXPECT_EQ(robot.groups.at("hand"), Names{"palm"});
  EXPECT_TRUE(robot.never_meet.empty());
  for (const char* expected :
       {"test.srdf: <link> of line 2 names the link 'pall', which the robot does not have", "names the joint 'turn'",
        "<chain> of line 2 names the link 'tip'", "<disable_collisions> of line 2 names the link 'cover'"}) {
    EXPECT_TRUE(says(robot.hints, expected)) << joinedText(robot.hints);
  }
}

TEST(Srdf, GroupsBesideEachOtherAreNotNested) {
  const auto groups = [](int count, bool nested) {
    std::string text;
    for (int i = 0; i < count; ++i) {
      const std::string next =
          nested && i > 0 ? "<group name='g" + std::to_string(i - 1) + "'/>" : "<link name='palm'/>";
      text = "<group name='g" + std::to_string(i) + "'>" + next + "</group>" + text;
    }
    return robotFrom(handSrdf(),
                     robotOf("<group name='all'><group name='g" + std::to_string(count - 1) + "'/></group>" + text));
  };
  EXPECT_EQ(groups(200, false).groups.size(), 201u);
  EXPECT_EQ(groups(60, true).groups.at("all"), Names{"palm"});
  EXPECT_TRUE(says(groups(200, true).missing, "nested too deeply"));
}

TEST(Srdf, WhatIsNoneIsRefusedWithItsPlace) {
  const std::pair<std::string, const char*> cases[] = {
      {"<robot>", "is no XML"},
      {"<robots/>", "begins with <robots> of line 1"},
      {robotOf("<group/>"), "<group> of line 1 needs the attribute name"},
      {robotOf("<group name='a'/><group name='a'/>"), "is named 'a', as one before it is"},
      {robotOf("<group name='a'><group name='b'/></group><group name='b'><group name='a'/></group>"), "holds itself"},
      {robotOf("<group name='a'><group name='b'/></group>"), "names the group 'b', which is none"},
      {robotOf("<end_effector name='a' group='b'/>"), "names the group 'b', which is none"},
      {robotOf("<disable_collisions link1='palm'/>"), "needs the attribute link2"},
  };
  for (const auto& [text, expected] : cases) {
    const Robot robot = robotFrom(handSrdf(), text);
    EXPECT_FALSE(robot.semantic_known);
    EXPECT_EQ(robot.parts.size(), 1u) << "the links are there";
    ASSERT_EQ(robot.missing.size(), 1u) << text;
    EXPECT_EQ(robot.missing[0].find("no group of the robot is known: test.srdf "), 0u) << robot.missing[0];
    EXPECT_TRUE(says(robot.missing, expected)) << robot.missing[0];
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
