// Bodies and topologies from files: what is missing or no mesh is refused, what is of the wrong size is noticed.
#include <gtest/gtest.h>

#include <array>
#include <fstream>

#include "dccd/assurance.h"
#include "support/said.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

/// A closed box of an STL, 20 x 20 x 40 units, around the origin of the frame `finger` of a rigid body; with a cloth.
XmlRpcValue clothAndFinger() {
  const std::string file = ::testing::TempDir() + "finger.stl";
  std::ofstream stl(file);
  const int faces[12][3] = {{0, 2, 1}, {1, 2, 3}, {4, 5, 6}, {5, 7, 6}, {0, 1, 4}, {1, 5, 4},
                            {2, 6, 3}, {3, 6, 7}, {0, 4, 2}, {2, 4, 6}, {1, 3, 5}, {3, 7, 5}};
  stl << "solid finger\n";
  for (const auto& face : faces) {
    stl << "facet normal 0 0 0\nouter loop\n";
    for (const int v : face) {
      stl << "vertex " << (v & 1 ? 10 : -10) << ' ' << (v & 2 ? 10 : -10) << ' ' << (v & 4 ? 40 : 0) << '\n';
    }
    stl << "endloop\nendfacet\n";
  }
  stl << "endsolid\n";
  XmlRpcValue tree = scene();
  tree["effects"]["octomap"] = "off";
  tree["bodies"]["cloth"]["topic"] = "cloth";
  tree["bodies"]["finger"]["rigid"]["mesh"] = file;
  tree["bodies"]["finger"]["rigid"]["frame"] = "finger";
  return tree;
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

// One rule for files and messages: what cannot be used is missing, and the step is PARTIAL.
TEST(Files, FacesThatCannotBeUsedAreUnchecked) {
  const std::string file = ::testing::TempDir() + "with_a_line.obj";
  for (const std::string face : {"", "f 1 4 4\n", "f 1 4 2 3\nf 1 1 4\n", "f 1 2 2\n"}) {
    const bool usable = face.empty() || face == "f 1 2 2\n";
    std::ofstream(file) << "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 1 1 0\nf 1 2 3\nf 2 4 3\n" << face;
    XmlRpcValue rigid = clothAndFinger();
    rigid["bodies"]["finger"]["rigid"]["mesh"] = file;
    XmlRpcValue topology = scene();
    topology["effects"]["octomap"] = "off";
    topology["topology"]["file"] = file;
    for (const XmlRpcValue& tree : {rigid, topology}) {
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
  tree["bodies"]["finger"]["rigid"]["scale"] = 2.0;
  const std::string hint = Driven(tree).pipeline.hint(1);
  EXPECT_NE(hint.find("finger.stl is 80 m across"), std::string::npos) << hint;
  EXPECT_NE(hint.find("are these millimetres? Then set rigid/scale: 0.002"), std::string::npos) << hint;
}

std::string errorOf(const XmlRpcValue& tree) {
  tf2::BufferCore transforms;
  const TransformFeed feed(transforms);
  return said<ParameterError>([&] { MonitorPipeline pipeline(readConfig(tree), feed); });
}

TEST(Files, WhatIsMissingOrNoMeshIsRefusedAtStart) {
  const std::string text_file = ::testing::TempDir() + "no_mesh.stl", ply = ::testing::TempDir() + "square.ply";
  std::ofstream(text_file) << "this is no mesh\n";
  std::ofstream(ply)
      << "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
         "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
         "0 0 0\n1 0 0\n0 1 0\n1 1 0\n3 0 1 2\n3 1 3 2\n";
  const auto rigid = [](const std::string& file) {
    XmlRpcValue tree;
    tree["bodies"]["cloth"]["topic"] = "cloth";
    tree["bodies"]["finger"]["rigid"]["mesh"] = file;
    tree["bodies"]["finger"]["rigid"]["frame"] = "finger";
    return tree;
  };
  const auto names = [](const std::string& error, const std::string& part) {
    EXPECT_NE(error.find(part), std::string::npos) << part << ": " << error;
  };
  for (const std::string& file :
       {std::string("missing.stl"), std::string("package://no_such_package/a.obj"), text_file}) {
    const std::string error = errorOf(rigid(file));
    names(error, "rigid/mesh of body 'finger'");
    names(error, file);
    names(error, "write the path of an STL, OBJ, PLY or DAE mesh");
  }
  EXPECT_EQ(errorOf(rigid(ply)), "");
  XmlRpcValue topology;
  topology["topology"]["file"] = "missing.ply";
  names(errorOf(topology), "topology/file of body 'mesh': missing.ply");
  topology["topology"]["file"] = ply;
  EXPECT_EQ(errorOf(topology), "");
  topology["topology"]["rows"] = 2;
  topology["topology"]["cols"] = 3;
  names(errorOf(topology), "topology/rows of body 'mesh': 2 x 3 = 6, but " + ply + " has 4 points");
}

}  // namespace
}  // namespace test
}  // namespace dccd
