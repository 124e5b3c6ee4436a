// The parameters expected_contacts and phase: how they are read, and mistakes in them.
#include <gtest/gtest.h>

#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

const char CLOTH_AND_FINGER[] = "bodies: {cloth: {topic: cloth}, finger: {topic: finger}}, expected_contacts: ";

TEST(ExpectedContacts, AreReadWithTheirSetsAndPhases) {
  XmlRpcValue tree = parameters(
      std::string(CLOTH_AND_FINGER) +
      "[{between: [octomap, cloth]}, {between: [cloth, finger], vertices: {finger: [7], cloth: hem}, phase: carry}, "
      "{between: [cloth, self], vertices: {cloth: hem}, phase: fold}, "
      "{between: [cloth, self], vertices: {cloth: hem, self: [1]}, phase: fold}], phase: carry");
  tree["bodies"]["cloth"]["topology"] = parameters("sets: {hem: [3, 4]}");
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
  XmlRpcValue tree = parameters(
      "bodies: {arm: {rigid: {mesh: arm.stl, frame: arm}}, cloth: {topic: cloth}}, "
      "expected_contacts: [{between: [cloth, arm]}, {between: [cloth, octomap]}]");
  ASSERT_EQ(readConfig(tree).expected_contacts.size(), 2u);
  tree["effects"]["rigid_bodies"] = "off";
  const MonitorConfig config = readConfig(tree);
  ASSERT_EQ(config.expected_contacts.size(), 1u);
  EXPECT_EQ(config.expected_contacts[0].partners[0].body, 0u) << "the cloth is the first body now";
}

TEST(ExpectedContacts, MistakesAreNamed) {
  const std::pair<const char*, const char*> cases[] = {
      {"[{between: [clot, finger]}]",
       "expected_contacts[0]/between names 'clot', which is no body and not octomap; nearest is 'cloth'"},
      {"[{between: [self, octomap]}]", "expected_contacts[0]/between names self without a body"},
      {"[{between: [cloth, finger], vertices: {sleeve: hem}}]", "expected_contacts[0]/vertices/sleeve"},
      {"[{between: [cloth, finger], vertices: {self: hem}}]", "expected_contacts[0]/vertices/self"},
      {"[{between: [cloth, finger], vertices: {cloth: [-1]}}]", "expected_contacts[0]/vertices/cloth"},
      {"[{between: [cloth, finger], fase: carry}]", "expected_contacts[0]/fase"},
      {"[{between: [cloth, finger], phase: carry}], phase: cary",
       "~phase is 'cary', which expected_contacts does not name; known phases are 'carry', and '' for none"},
  };
  for (const auto& [contacts, said] : cases)
    expectMistakes({{(CLOTH_AND_FINGER + std::string(contacts)).c_str(), said}});
  expectMistakes(
      {{"bodies: {cloth: {topic: cloth, topology: {sets: {hem: \"1\"}}}}", "~bodies/cloth/topology/sets/hem"}});
}

}  // namespace
}  // namespace test
}  // namespace dccd
