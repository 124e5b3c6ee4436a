// The parameters expected_contacts and phase: how they are read, and mistakes in them.
#include <gtest/gtest.h>

#include <functional>

#include "unit/ros/parameter_support.h"

namespace dccd {
namespace test {
namespace {

XmlRpcValue expectation(const char* one, const char* other) {
  XmlRpcValue entry;
  entry["between"][0] = one;
  entry["between"][1] = other;
  return entry;
}

XmlRpcValue clothAndFinger() {
  XmlRpcValue tree;
  tree["bodies"]["cloth"]["topic"] = "cloth";
  tree["bodies"]["finger"]["topic"] = "finger";
  return tree;
}

TEST(ExpectedContacts, AreReadWithTheirSetsAndPhases) {
  XmlRpcValue tree = clothAndFinger();
  tree["bodies"]["cloth"]["topology"]["sets"]["hem"][0] = 3;
  tree["bodies"]["cloth"]["topology"]["sets"]["hem"][1] = 4;
  tree["expected_contacts"][0] = expectation("octomap", "cloth");
  tree["expected_contacts"][1] = expectation("cloth", "finger");
  tree["expected_contacts"][1]["vertices"]["finger"][0] = 7;
  tree["expected_contacts"][1]["vertices"]["cloth"] = "hem";
  tree["expected_contacts"][1]["phase"] = "carry";
  tree["expected_contacts"][2] = expectation("cloth", "self");
  tree["expected_contacts"][2]["vertices"]["cloth"] = "hem";
  tree["expected_contacts"][2]["phase"] = "fold";
  tree["expected_contacts"][3] = tree["expected_contacts"][2];
  tree["expected_contacts"][3]["vertices"]["self"][0] = 1;
  tree["phase"] = "carry";
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
  XmlRpcValue tree;
  tree["bodies"]["arm"]["rigid"]["mesh"] = "arm.stl";
  tree["bodies"]["arm"]["rigid"]["frame"] = "arm";
  tree["bodies"]["cloth"]["topic"] = "cloth";
  tree["expected_contacts"][0] = expectation("cloth", "arm");
  tree["expected_contacts"][1] = expectation("cloth", "octomap");
  ASSERT_EQ(readConfig(tree).expected_contacts.size(), 2u);
  tree["effects"]["rigid_bodies"] = "off";
  const MonitorConfig config = readConfig(tree);
  ASSERT_EQ(config.expected_contacts.size(), 1u);
  EXPECT_EQ(config.expected_contacts[0].partners[0].body, 0u) << "the cloth is the first body now";
}

TEST(ExpectedContacts, MistakesAreNamed) {
  struct Case {
    const char* expected;
    std::function<void(XmlRpcValue&)> set;
  };
  const Case cases[] = {
      {"expected_contacts[0]/between names 'clot', which is no body and not octomap; nearest is 'cloth'",
       [](XmlRpcValue& t) { t["expected_contacts"][0] = expectation("clot", "finger"); }},
      {"expected_contacts[0]/between names self without a body",
       [](XmlRpcValue& t) { t["expected_contacts"][0] = expectation("self", "octomap"); }},
      {"expected_contacts[0]/vertices/sleeve",
       [](XmlRpcValue& t) { t["expected_contacts"][0]["vertices"]["sleeve"] = "hem"; }},
      {"expected_contacts[0]/vertices/self",
       [](XmlRpcValue& t) { t["expected_contacts"][0]["vertices"]["self"] = "hem"; }},
      {"expected_contacts[0]/vertices/cloth",
       [](XmlRpcValue& t) { t["expected_contacts"][0]["vertices"]["cloth"][0] = -1; }},
      {"expected_contacts[0]/fase", [](XmlRpcValue& t) { t["expected_contacts"][0]["fase"] = "carry"; }},
      {"~phase is 'cary', which expected_contacts does not name; known phases are 'carry', and '' for none",
       [](XmlRpcValue& t) {
         t["expected_contacts"][0]["phase"] = "carry";
         t["phase"] = "cary";
       }},
      {"~bodies/cloth/topology/sets/hem",
       [](XmlRpcValue& t) { t["bodies"]["cloth"]["topology"]["sets"]["hem"] = "1"; }},
  };
  for (const Case& one : cases) {
    XmlRpcValue tree = clothAndFinger();
    tree["expected_contacts"][0] = expectation("cloth", "finger");
    one.set(tree);
    EXPECT_TRUE(mentions(errorOf(tree), one.expected)) << errorOf(tree);
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
