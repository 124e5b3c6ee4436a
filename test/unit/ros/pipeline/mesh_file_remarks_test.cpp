// What of a mesh file was skipped is a hint to the user; the lines of an OBJ are ropes over the points that a tracker
// sends.
#include <gtest/gtest.h>

#include <fstream>

#include "support/said.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

std::string written(const std::string& name, const std::string& text) {
  const std::string path = ::testing::TempDir() + name;
  std::ofstream(path) << text;
  return path;
}

const char* const POINTS = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0.1 0.1 0\n";

TEST(MeshFileRemarks, RopesOfATopologyFile) {
  XmlRpcValue tree = scene();
  tree["effects"]["octomap"] = "off";
  tree["topology"]["file"] = written("ropes.obj", std::string(POINTS) + "l 1 2\nl 3 4\nrope 1 2\n");
  Driven ropes(tree);
  ropes.feed(1, 0.3f);
  const Outcome& outcome = ropes.feed(1.1, 0.2f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_EQ(outcome.step->bodies[0].topology->edges(), (std::vector<Edge>{{0, 1}, {2, 3}}));
  EXPECT_TRUE(mentions(ropes.pipeline.hint(0),
                       "ropes.obj: 1 lines with unknown keywords are skipped, the first is 'rope' in line 7"))
      << ropes.pipeline.hint(0);
}

TEST(MeshFileRemarks, OfARigidBody) {
  XmlRpcValue tree;
  tree["bodies"]["cloth"]["topic"] = "cloth";
  XmlRpcValue& rigid = tree["bodies"]["finger"]["rigid"];
  rigid["frame"] = "finger";
  rigid["mesh"] = written("finger.obj", std::string(POINTS) + "f 1 2 3\nface 2 3 4\n");
  const std::string hint = Driven(tree).pipeline.hint(1);
  EXPECT_TRUE(mentions(hint, "finger.obj: 1 lines with unknown keywords are skipped")) << hint;
  rigid["mesh"] = written("finger.obj", std::string(POINTS) + "f 1 2 3\n");
  EXPECT_EQ(Driven(tree).pipeline.hint(1), "");
  rigid["mesh"] = written("finger.obj", std::string(POINTS) + "l 1 2 3\n");
  const std::string text = said<ParameterError>([&] { Driven refused(tree); });
  EXPECT_TRUE(mentions(text, "there are no triangles")) << text;
}

}  // namespace
}  // namespace test
}  // namespace dccd
