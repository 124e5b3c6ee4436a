// PLY as tools write it: text and both byte orders, float and double, lists of several types, more than a mesh needs.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <fstream>

#include "input/mesh_formats.h"

namespace dccd {
namespace {

template <class T>
void put(std::string& out, T value, bool big_endian) {
  char bytes[sizeof value];
  std::memcpy(bytes, &value, sizeof value);
  if (big_endian) std::reverse(bytes, bytes + sizeof value);
  out.append(bytes, sizeof value);
}

std::string written(const std::string& bytes) {
  const std::string path = ::testing::TempDir() + "a.ply";
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}
std::string errorOf(const std::string& bytes) {
  try {
    loadMeshFile(written(bytes));
  } catch (const MeshFileError& error) {
    return error.what();
  }
  return "";
}
bool mentions(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

const Positions CORNERS{{0.1, -2.5, 1e-9}, {1, 0, 0}, {1, 1, 0.25}, {0, 1.0 / 3.0, 7}};

/// A quadrangle and a triangle, with a colour and a confidence at each vertex.
template <class Real, class Count, class Item>
std::string binary(bool big_endian, const char* real, const char* list) {
  std::string out = std::string("ply\nformat binary_") + (big_endian ? "big" : "little") +
                    "_endian 1.0\ncomment by a scanner\nelement vertex 4\n";
  for (const char* axis : {"x", "y", "z"}) out += std::string("property ") + real + " " + axis + "\n";
  out += "property uchar red\nproperty double confidence\nelement face 2\nproperty list " + std::string(list) +
         " vertex_indices\nend_header\n";
  for (const Vec3& p : CORNERS) {
    for (int axis = 0; axis < 3; ++axis) put(out, static_cast<Real>(p[axis]), big_endian);
    put(out, std::uint8_t{200}, big_endian);
    put(out, 0.5, big_endian);
  }
  for (const std::vector<Index>& polygon : {std::vector<Index>{0, 1, 2, 3}, std::vector<Index>{3, 1, 0}}) {
    put(out, static_cast<Count>(polygon.size()), big_endian);
    for (const Index v : polygon) put(out, static_cast<Item>(v), big_endian);
  }
  return out;
}

template <class Real>
void expectMesh(const std::string& bytes, const std::string& what) {
  const MeshFile mesh = loadMeshFile(written(bytes));
  ASSERT_EQ(mesh.positions.size(), CORNERS.size()) << what;
  for (std::size_t v = 0; v < CORNERS.size(); ++v) {
    for (int axis = 0; axis < 3; ++axis) {
      EXPECT_EQ(mesh.positions[v][axis], static_cast<double>(static_cast<Real>(CORNERS[v][axis]))) << what;
    }
  }
  EXPECT_EQ(mesh.faces, (std::vector<Face>{{0, 1, 2}, {0, 2, 3}, {3, 1, 0}})) << what;
}

TEST(PlyFile, BinaryOfEitherByteOrder) {
  for (const bool big : {false, true}) {
    expectMesh<float>(binary<float, std::uint8_t, std::int32_t>(big, "float", "uchar int"), "float");
    expectMesh<double>(binary<double, std::uint8_t, std::uint32_t>(big, "float64", "uint8 uint32"), "double");
    expectMesh<double>(binary<double, std::uint32_t, std::uint32_t>(big, "double", "uint uint"), "long lists");
  }
}

TEST(PlyFile, TextWithElementsThatAreNoneOfAMesh) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement camera 1\nproperty float view_px\nelement vertex 3\nproperty double x\n"
      "property double y\nproperty double z\nproperty float nx\nelement face 1\n"
      "property list uchar int vertex_index\nend_header\n";
  const MeshFile mesh = loadMeshFile(written(head + "0.5\n0.1 0 0 1\n1 0 0 1\n0 0.3333333333333333 0 1\n3 0 1 2\n"));
  ASSERT_EQ(mesh.positions.size(), 3u);
  EXPECT_EQ(mesh.positions[0].x(), 0.1);
  EXPECT_EQ(mesh.positions[2].y(), 0.3333333333333333);
  EXPECT_EQ(mesh.faces, (std::vector<Face>{{0, 1, 2}}));
}

TEST(PlyFile, FacesMayBeMissing) {
  const std::string xyz = "property float x\nproperty float y\nproperty float z\n";
  const MeshFile cloud =
      loadMeshFile(written("ply\nformat ascii 1.0\nelement vertex 2\n" + xyz + "end_header\n1 2 3\n4 5 6\n"));
  EXPECT_EQ(cloud.positions.size(), 2u);
  EXPECT_TRUE(cloud.faces.empty());
}

TEST(PlyFile, WhatIsWrongIsNamed) {
  const std::string head = "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\n";
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const std::string points = "0 0 0\n1 0 0\n0 1 0\n", z = "property float z\n";
  EXPECT_EQ(errorOf(head + z + faces + points + "3 0 1 2\n"), "");
  EXPECT_TRUE(mentions(errorOf(head + faces + "0 0\n1 0\n0 1\n3 0 1 2\n"), "needs just one property 'z'"));
  EXPECT_EQ(errorOf(head + "property int z\n" + faces + points + "3 0 1 2\n"), "");
  EXPECT_TRUE(mentions(errorOf(head + z + faces + points + "3 0 1 3\n"), "polygon 0 names vertex 3 of 3"));
  EXPECT_TRUE(mentions(errorOf(head + z + faces + points + "3 0 1 -1\n"), "polygon 0 names vertex"));
  EXPECT_NE(errorOf(head + z + faces + points), "") << "the face is missing";
  EXPECT_NE(errorOf(head + z + faces + "0 0 0\n1 0 0\n"), "") << "a vertex is missing";
  EXPECT_NE(errorOf(head + z + faces + "0 0 0\n1 0\n0 1 0\n3 0 1 2\n"), "") << "a coordinate is missing";
  const std::string whole = binary<float, std::uint8_t, std::int32_t>(false, "float", "uchar int");
  for (const std::size_t cut : {1u, 20u, 60u}) {
    EXPECT_NE(errorOf(whole.substr(0, whole.size() - cut)), "") << "cut by " << cut;
  }
}

}  // namespace
}  // namespace dccd
