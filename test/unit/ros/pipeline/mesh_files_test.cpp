// Bodies and topologies from files: what is missing or no mesh is refused, what is of the wrong size is noticed, what
// was skipped is a hint to the user; the lines of an OBJ are ropes over the points that a tracker sends.
#include <gtest/gtest.h>

#include <array>
#include <filesystem>
#include <fstream>

#include "dccd/assurance.h"
#include "support/closed_meshes.h"
#include "unit/ros/pipeline/driven_pipeline.h"
#include "unit/ros/stl_text.h"

namespace dccd {
namespace test {
namespace {

std::string written(const std::string& name, const std::string& text) {
  const std::string path = ::testing::TempDir() + name;
  std::ofstream(path) << text;
  return path;
}

/// A cloth and a rigid body of this file in the frame `finger`.
XmlRpcValue clothAndRigid(const std::string& file) {
  return scene("effects: {octomap: 'off'}, bodies: {cloth: {topic: cloth}, finger: {rigid: {frame: finger, mesh: '" +
               file + "'}}}");
}

/// A closed box of an STL, 20 x 20 x 40 units, around the origin of the frame; with a cloth.
XmlRpcValue clothAndFinger() { return clothAndRigid(written("finger.stl", stlText(box({-10, -10, 0}, {10, 10, 40})))); }

XmlRpcValue topologyOf(const std::string& file) {
  return scene("effects: {octomap: 'off'}, topology: {file: '" + file + "'}");
}

// A file in millimetres makes a finger of 40 m, and no edge of the cloth in it is near a face.
TEST(Inside, AClothInARigidBodyOfAnStlIsNoClearStart) {
  Driven wrong(clothAndFinger());
  wrong.raise("finger", -20);
  wrong.feed(1, 0.3f);
  const Outcome& inside = wrong.feed(1.1, 0.2f);
  ASSERT_EQ(inside.status, StepStatus::OK) << inside.reason;
  EXPECT_EQ(inside.start_state, StartState::INTERSECTING);
  ASSERT_EQ(inside.intersections.size(), 1u);
  EXPECT_EQ(inside.intersections[0].body, (std::array<std::uint16_t, 2>{0, 1}));
  EXPECT_EQ(inside.intersections[0].vertex, (std::array<Index, 5>{0, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX}));
  EXPECT_FALSE(assuranceOf(inside).clear());
  EXPECT_TRUE(mentions(wrong.pipeline.statement().touches,
                       "cloth lies inside of finger, which is 40 m across: rigid/scale: 0.001 if its file is in"))
      << wrong.pipeline.statement().touches;

  XmlRpcValue tree = clothAndFinger();
  tree["bodies"]["finger"]["rigid"]["scale"] = 0.001;
  Driven right(tree);
  right.raise("finger", -20);
  right.feed(1, 0.3f);
  EXPECT_TRUE(assuranceOf(right.feed(1.1, 0.2f)).clear());

  tree = clothAndFinger();
  tree["bodies"]["finger"]["shell"] = true;
  Driven container(tree);
  container.raise("finger", -20);
  container.feed(1, 0.3f);
  EXPECT_TRUE(assuranceOf(container.feed(1.1, 0.2f)).clear()) << "a container is meant to hold others";
}

const char* const POINTS = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0.1 0.1 0\n";

// One rule for files and messages: what cannot be used is missing, and the step is PARTIAL.
TEST(Files, FacesThatCannotBeUsedAreUnchecked) {
  for (const std::string face : {"", "f 1 4 4\n", "f 1 4 2 3\nf 1 1 4\n", "f 1 2 2\n"}) {
    const bool usable = face.empty() || face == "f 1 2 2\n";
    const std::string file = written("with_a_line.obj", std::string(POINTS) + "f 1 2 3\nf 2 4 3\n" + face);
    for (const XmlRpcValue& tree : {clothAndRigid(file), topologyOf(file)}) {
      Driven driven(tree);
      driven.raise("finger", -3);
      driven.feed(1, 0.3f);
      const Outcome& outcome = driven.feed(1.1, 0.2f);
      EXPECT_EQ(outcome.status, usable ? StepStatus::OK : StepStatus::PARTIAL) << face << outcome.reason;
      EXPECT_EQ(assuranceOf(outcome).clear(), usable) << face;
      EXPECT_EQ(outcome.reason.find(" sent that cannot be used") != std::string::npos, !usable) << outcome.reason;
    }
  }
}

TEST(Inside, AMeshFileInMillimetresIsHintedAt) {
  XmlRpcValue tree = clothAndFinger();
  EXPECT_EQ(Driven(tree).pipeline.hint(1), "") << "40 m are no millimetres for sure";
  EXPECT_TRUE(Driven(tree).pipeline.doubts().empty());
  tree["bodies"]["finger"]["rigid"]["scale"] = 2.0;
  const std::string hint = Driven(tree).pipeline.hint(1);
  EXPECT_NE(hint.find("finger.stl is 80 m across"), std::string::npos) << hint;
  EXPECT_NE(hint.find("are these millimetres? Then set rigid/scale: 0.002"), std::string::npos) << hint;
  EXPECT_EQ(Driven(tree).pipeline.doubts(), (std::vector<std::string>{"body 'finger': " + hint}));
}

std::string errorOf(const XmlRpcValue& tree) {
  TransformFeed feed;
  return said<ParameterError>([&] { MonitorPipeline pipeline(readConfig(tree), feed); });
}

TEST(Files, WhatIsMissingOrNoMeshIsRefusedAtStart) {
  const std::string text_file = written("no_mesh.stl", "this is no mesh\n");
  const std::string ply =
      written("square.ply",
              "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
              "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
              "0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n");
  const auto names = [](const std::string& error, const std::string& part) {
    EXPECT_NE(error.find(part), std::string::npos) << part << ": " << error;
  };
  for (const std::string& file :
       {std::string("missing.stl"), std::string("package://no_such_package/a.obj"), text_file}) {
    const std::string error = errorOf(clothAndRigid(file));
    names(error, "rigid/mesh of body 'finger'");
    names(error, file);
    names(error, "write the path of an STL, OBJ, PLY or DAE mesh");
  }
  EXPECT_EQ(errorOf(clothAndRigid(ply)), "");
  // In full: under roslaunch it counts from a folder that nobody thinks of.
  names(errorOf(topologyOf("missing.ply")),
        "topology/file of body 'mesh': " + std::filesystem::absolute("missing.ply").string() + ": cannot be opened");
  XmlRpcValue topology = topologyOf(ply);
  EXPECT_EQ(errorOf(topology), "");
  topology["topology"]["rows"] = 2;
  topology["topology"]["cols"] = 3;
  names(errorOf(topology), "topology/rows of body 'mesh': 2 x 3 = 6, but " + ply + " has 4 points");
}

TEST(MeshFileRemarks, RopesOfATopologyFile) {
  Driven ropes(topologyOf(written("ropes.obj", std::string(POINTS) + "l 1 2\nl 3 4\nrope 1 2\n")));
  ropes.feed(1, 0.3f);
  const Outcome& outcome = ropes.feed(1.1, 0.2f);
  EXPECT_EQ(outcome.status, StepStatus::PARTIAL) << "what 'rope' means nobody knows";
  EXPECT_EQ(outcome.step->bodies[0].topology->edges(), (std::vector<Edge>{{0, 1}, {2, 3}}));
  EXPECT_TRUE(mentions(ropes.pipeline.hint(0),
                       "ropes.obj: 1 lines with unknown keywords are unchecked, the first is 'rope' in line 7"))
      << ropes.pipeline.hint(0);
}

TEST(MeshFileRemarks, OfARigidBody) {
  const auto with = [](const std::string& lines) {
    return clothAndRigid(written("finger.obj", std::string(POINTS) + lines));
  };
  const std::string hint = Driven(with("f 1 2 3\nface 2 3 4\n")).pipeline.hint(1);
  EXPECT_TRUE(mentions(hint, "finger.obj: 1 lines with unknown keywords are unchecked")) << hint;
  EXPECT_EQ(Driven(with("f 1 2 3\n")).pipeline.hint(1), "");
  const std::string text = errorOf(with("l 1 2 3\n"));
  EXPECT_TRUE(mentions(text, "there are no triangles")) << text;
}

}  // namespace
}  // namespace test
}  // namespace dccd
