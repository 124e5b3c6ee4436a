// Mesh files of rigid bodies: a robot's STLs, a DAE and an OBJ of ours, and files that are none.
#include "input/mesh_resource.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "support/data.h"
#include "support/folder_test.h"
#include "support/said.h"

namespace dccd {
namespace {

namespace fs = std::filesystem;

std::string ours(const std::string& name) {
  return std::string(DEFORMABLE_CCD_SOURCE_DIR) + "/test/unit/ros/meshes/" + name;
}

Eigen::AlignedBox3d boundsOf(const Positions& positions) {
  Eigen::AlignedBox3d box;
  for (const Vec3& p : positions) box.extend(p);
  return box;
}

using test::mentions;
std::string errorOf(const std::string& path) {
  return test::said<std::invalid_argument>([&] { loadMeshResource(path, 1); });
}

/// Counted by a script of a few lines that reads the 50 bytes of a triangle, and by geometric_shapes' reader, which
/// agrees.
struct PandaMesh {
  const char* name;
  std::size_t vertices, faces;
  double min_m[3], max_m[3];
};
constexpr PandaMesh PANDA[] = {
    {"finger", 18, 32, {-0.010479, -0.000133, 0.000132}, {0.010495, 0.026403, 0.053849}},
    {"hand", 102, 200, {-0.031636, -0.103990, -0.025925}, {0.031616, 0.100426, 0.065962}},
    {"link0", 102, 200, {-0.154079, -0.094614, -0.000032}, {0.071567, 0.094670, 0.140003}},
    {"link1", 152, 300, {-0.054987, -0.129373, -0.192004}, {0.055161, 0.055192, 0.054973}},
    {"link2", 152, 300, {-0.055153, -0.194010, -0.055097}, {0.054985, 0.055220, 0.129489}},
    {"link3", 152, 300, {-0.054646, -0.054917, -0.121018}, {0.137561, 0.111203, 0.055156}},
    {"link4", 152, 300, {-0.137607, -0.055150, -0.055207}, {0.055140, 0.124009, 0.111052}},
    {"link5", 152, 300, {-0.055017, -0.055128, -0.264554}, {0.055083, 0.129904, 0.052168}},
    {"link6", 102, 200, {-0.048005, -0.051388, -0.043985}, {0.132208, 0.081681, 0.056309}},
    {"link7", 102, 200, {-0.044035, -0.044030, 0.051991}, {0.081306, 0.081187, 0.106837}},
};

TEST(MeshResource, AllMeshesOfThePanda) {
  DEFORMABLE_CCD_REQUIRE_DATA();
  const fs::path folder = fs::path(test::dataDir()) / "robots/panda/meshes/collision";
  if (!fs::exists(folder)) GTEST_SKIP() << "no meshes of a robot in " << folder;
  for (const PandaMesh& known : PANDA) {
    SCOPED_TRACE(known.name);
    const MeshResource mesh = loadMeshResource("file://" + (folder / known.name).string() + ".stl", 1);
    EXPECT_EQ(mesh.positions.size(), known.vertices);
    EXPECT_EQ(mesh.topology->faces().size(), known.faces);
    // Closed without a hole: Euler's formula.
    EXPECT_EQ(known.vertices + known.faces, mesh.topology->edges().size() + 2);
    const Eigen::AlignedBox3d box = boundsOf(mesh.positions);
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_NEAR(box.min()[axis], known.min_m[axis], 1e-6);
      EXPECT_NEAR(box.max()[axis], known.max_m[axis], 1e-6);
    }
  }
}

/// A pyramid on a rectangle of 200 x 100 mm: 5 vertices, a quadrilateral and four triangles, 10 mm up, 50 mm high.
void expectPyramid(const MeshResource& mesh, double unit) {
  EXPECT_EQ(mesh.positions.size(), 5u);
  EXPECT_EQ(mesh.topology->faces().size(), 6u);
  EXPECT_EQ(mesh.topology->edges().size(), 9u) << "two a vertex of the rectangle, one diagonal";
  const Eigen::AlignedBox3d box = boundsOf(mesh.positions);
  EXPECT_NEAR((box.min() - unit * Vec3(0, 0, 0.01)).norm(), 0, 1e-7 * unit);
  EXPECT_NEAR((box.max() - unit * Vec3(0.2, 0.1, 0.06)).norm(), 0, 1e-7 * unit);
}

TEST(MeshResource, ADaeComesInItsUnitWithItsNodesTransform) {
  expectPyramid(loadMeshResource(ours("pyramid_mm.dae"), 1), 1);
  expectPyramid(loadMeshResource(ours("pyramid_mm.dae"), 2), 2);
}

TEST(MeshResource, AnObjWithNormalsMaterialsAndIndicesFromTheEnd) {
  const MeshResource mesh = loadMeshResource(ours("pyramid.obj"), 1);
  expectPyramid(mesh, 1);
  EXPECT_EQ(mesh.positions[1], Vec3(0.2, 0, 0.01)) << "in the file's order, every bit of the number";
}

class OddFiles : public test::FolderTest {
 protected:
  void SetUp() override {
    FolderTest::SetUp();
    std::ifstream file(ours("pyramid_mm.dae"));
    dae_.assign(std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>());
    ASSERT_FALSE(dae_.empty());
  }
  std::string write(const std::string& name, const std::string& bytes) {
    std::ofstream(folder_ / name, std::ios::binary) << bytes;
    return (folder_ / name).string();
  }
  std::string daeWith(const std::string& from, const std::string& to) {
    std::string text = dae_;
    const std::size_t at = text.find(from);
    EXPECT_NE(at, std::string::npos) << from;
    return write("a.dae", text.replace(at, from.size(), to));
  }
  std::string dae_;
};

TEST_F(OddFiles, DamagedDaesAreRefusedByName) {
  const std::string cut = write("cut.dae", dae_.substr(0, dae_.size() / 2));
  EXPECT_TRUE(mentions(errorOf(cut), "cut.dae: not a readable .dae mesh: ")) << errorOf(cut);
  const std::string empty = write("empty.dae", "");
  EXPECT_TRUE(mentions(errorOf(empty), empty)) << errorOf(empty);
  const std::string far = daeWith("<p>0 3 2 1", "<p>0 3 2 999");
  EXPECT_TRUE(mentions(errorOf(far), far)) << errorOf(far);
  const std::string letter = daeWith("<p>0 3 2 1", "<p>0 3 x 1");
  EXPECT_TRUE(mentions(errorOf(letter), "<p> has 'x', which is no integer")) << errorOf(letter);
  const std::string nan = daeWith("0 0 0 200", "nan 0 0 200");
  EXPECT_TRUE(mentions(errorOf(nan), nan + ": a coordinate is not finite")) << errorOf(nan);
}

TEST_F(OddFiles, ADaeIsNoTopologyOfATracker) {
  const auto load = [](const std::string& path) {
    return test::said<std::invalid_argument>([&] { loadTopologyFile(path); });
  };
  EXPECT_TRUE(mentions(load(ours("pyramid_mm.dae")), "does not number its vertices"));
  EXPECT_EQ(load(ours("pyramid.obj")), "");
}

TEST_F(OddFiles, NothingIsPrintedOfThem) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 9\nproperty float x\nproperty uchar red\nend_header\n";
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  EXPECT_NE(errorOf(write("broken.ply", head + "1 2\n1\n")), "");
  EXPECT_EQ(::testing::internal::GetCapturedStdout() + ::testing::internal::GetCapturedStderr(), "");
}

TEST_F(OddFiles, WhatIsNoFileOrTooLargeIsNotOpened) {
  for (const char* name : {"a.stl", "a.obj", "a.ply", "a.dae"}) {
    const std::string path = (folder_ / name).string();
    ASSERT_EQ(::mkfifo(path.c_str(), 0600), 0);  // whoever opens it to read waits for ever
    EXPECT_TRUE(mentions(errorOf(path), "is no regular file")) << errorOf(path);
    fs::remove(path);
    fs::create_directory(path);
    EXPECT_TRUE(mentions(errorOf(path), "is no regular file")) << errorOf(path);
    fs::remove(path);
    write(name, "solid");
    fs::resize_file(path, (std::uintmax_t{512} << 20) + 1);  // a file with a hole takes no disk
    EXPECT_TRUE(mentions(errorOf(path), "at most 536870912 are read")) << errorOf(path);
    fs::remove(path);
    EXPECT_TRUE(mentions(errorOf(path), "cannot be opened")) << errorOf(path);
  }
  EXPECT_TRUE(mentions(errorOf(write("a.step", "")), "STL, OBJ, PLY and DAE can be read"));
}

TEST_F(OddFiles, TheGroupOfAPolygonIsTheFacesThatItBecame) {
  const MeshResource mesh = loadMeshResource(
      write("a.obj",
            "v 0 0 0\nv 2 1 0\nv 0 2 0\nv 1.5 1 0\nv 5 0 0\nv 5 1 0\nv 6 0 0\ng a\nf 1 2 3 4\nf 1 2 2\n"
            "g b\nf 5 6 7\ng c\nf 2 5 5\n"),
      1);
  EXPECT_EQ(mesh.verticesOf("a"), (std::vector<Index>{0, 1, 2, 3}));
  EXPECT_EQ(mesh.verticesOf("b"), (std::vector<Index>{4, 5, 6}));
  EXPECT_EQ(mesh.verticesOf("c"), std::vector<Index>());
  EXPECT_EQ(mesh.dropped_faces, 1u);
}

TEST_F(OddFiles, CoordinatesThatAreNotFinite) {
  const std::string obj = write("a.obj", "v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n");
  EXPECT_TRUE(mentions(errorOf(obj), "a coordinate is not finite")) << errorOf(obj);
}

}  // namespace
}  // namespace dccd
