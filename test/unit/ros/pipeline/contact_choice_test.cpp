// Which contacts count, as parameters choose it: masked vertices, contacts that are expected in a phase, the first ones
// alone.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <set>

#include "dccd/assurance.h"
#include "support/said.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

TEST(VertexMask, BeyondTheMeshIsNoStepAtAll) {
  XmlRpcValue tree = scene();
  tree["vertex_mask"][0] = 4;
  Driven masked(tree);
  EXPECT_EQ(masked.feed(1, 0.35f).status, StepStatus::VERTEX_COUNT);
  EXPECT_EQ(masked.outcome.reason, "parameter vertex_mask of body 'mesh' names vertex 4, but the mesh has 4");
}

TEST(VertexMask, AMaskedVertexAndAnExcludedBoxMeetNothing) {
  XmlRpcValue tree = scene();
  tree["vertex_mask"][0] = 0;
  const double below_1[] = {0.2, 0.1, -0.2, 0.3, 0.2, 0};
  for (int i = 0; i < 6; ++i) tree["exclude_boxes"][0][i] = below_1[i];
  Driven driven(tree);
  driven.giveMap(1);
  driven.feed(1, 0.35f);
  std::set<Index> met;
  for (const Contact& contact : driven.feed(1.1, -0.05f).contacts) {
    if (contact.kind == PairKind::VERTEX_VOXEL_FACE) met.insert(contact.vertex[0]);
    EXPECT_EQ(std::count(contact.vertex.begin(), contact.vertex.end(), 0u), 0) << "no feature of a masked vertex";
  }
  EXPECT_EQ(met, (std::set<Index>{2, 3}));
}

XmlRpcValue expecting(const std::string& phase = "") {
  XmlRpcValue tree = scene();
  XmlRpcValue entry;
  entry["between"][0] = "mesh";
  entry["between"][1] = "octomap";
  if (!phase.empty()) entry["phase"] = phase;
  tree["expected_contacts"][0] = entry;
  return tree;
}

std::string refusalOf(const XmlRpcValue& tree) {
  return said<std::exception>([&] { Driven refused(tree); }, "nothing was refused");
}

TEST(ExpectedContacts, BeyondTheMeshAreNoStepAtAll) {
  XmlRpcValue tree = expecting("carry");  // also where the phase is another one
  tree["topology"]["sets"]["hem"][0] = 9;
  tree["expected_contacts"][0]["vertices"]["mesh"] = "hem";
  Driven driven(tree);
  EXPECT_EQ(driven.feed(1, 0.35f).status, StepStatus::VERTEX_COUNT);
  EXPECT_EQ(driven.outcome.reason,
            "parameter expected_contacts[0]/vertices (set 'hem') of body 'mesh' names vertex 9, but the mesh has 4");
  EXPECT_EQ(driven.feed(1.1, 0.35f).status, StepStatus::VERTEX_COUNT) << "and again";
  EXPECT_EQ(driven.pipeline.monitor().total().of(StepStatus::VERTEX_COUNT), 2u) << "counted";
}

TEST(ExpectedContacts, OfAFileAreCheckedAtTheStart) {
  const std::string file = ::testing::TempDir() + "expected.obj";
  std::ofstream(file) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\ng hem seam\nf 2 4 3\ng empty\n";
  XmlRpcValue tree = expecting();
  tree["topology"]["file"] = file;
  tree["expected_contacts"][0]["vertices"]["mesh"] = "hem";
  Driven driven(tree);
  EXPECT_EQ(driven.pipeline.monitor().options().detector.expected.at(0).partners[0].vertices,
            (std::vector<Index>{1, 2, 3}));
  tree["expected_contacts"][0]["vertices"]["mesh"] = "ham";
  EXPECT_EQ(refusalOf(tree),
            "parameter expected_contacts[0]/vertices names 'ham', which is no set of body 'mesh'; it has 'empty', "
            "'hem', 'seam'");
  tree["expected_contacts"][0]["vertices"]["mesh"] = "empty";
  EXPECT_NE(refusalOf(tree).find("a group without faces"), std::string::npos) << refusalOf(tree);
  tree["topology"]["sets"]["hem"][0] = 1;
  EXPECT_NE(refusalOf(tree).find("topology/sets/hem"), std::string::npos) << refusalOf(tree);
  XmlRpcValue beyond = expecting();
  beyond["topology"]["file"] = file;
  beyond["expected_contacts"][0]["vertices"]["mesh"][0] = 4;
  EXPECT_EQ(refusalOf(beyond),
            "parameter expected_contacts[0]/vertices of body 'mesh' names vertex 4, but the mesh has 4");
  std::remove(file.c_str());
}

TEST(ExpectedContacts, APhaseIsOnFromTheNextStepAndStaysOverAReset) {
  Driven driven(expecting("carry"));
  driven.giveMap(1);
  driven.feed(1, 0.35f);
  EXPECT_EQ(driven.feed(1.1, -0.05f).touching, Touching::NEW);
  EXPECT_EQ(driven.pipeline.phaseInWords(), "no phase, no contact is expected");
  const std::string text = said<ParameterError>([&] { driven.pipeline.setPhase("fold"); });
  EXPECT_EQ(text, "phase 'fold' is unknown; known phases are 'carry', and '' for none");
  driven.pipeline.setPhase("carry");
  EXPECT_EQ(driven.pipeline.phaseInWords(), "phase 'carry', expected: mesh with the map in phase 'carry'");
  EXPECT_EQ(driven.feed(1.2, -0.15f).touching, Touching::EXPECTED);
  EXPECT_EQ(driven.outcome.expected, std::vector<std::string>{"mesh with the map in phase 'carry'"});
  driven.pipeline.reconfigure([](MonitorOptions& options, MarkerConfig&) { options.detector.max_contacts = 1; });
  driven.pipeline.reset(StepStatus::RESET);
  driven.feed(2, 0.35f);
  EXPECT_EQ(driven.feed(2.1, -0.05f).touching, Touching::EXPECTED);
  driven.pipeline.setPhase("");
  EXPECT_EQ(driven.feed(2.2, -0.15f).touching, Touching::LASTING);
}

}  // namespace
}  // namespace test
}  // namespace dccd
