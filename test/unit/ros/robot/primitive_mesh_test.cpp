// Primitives as meshes: closed, and round ones from outside, in rational arithmetic.
#include "robot/primitive_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "dccd/topology.h"
#include "oracle/algebraic.h"

namespace dccd {
namespace test {
namespace {

using Exact = std::array<Rational, 3>;

Exact exact(const Vec3& v) { return {Rational(v[0]), Rational(v[1]), Rational(v[2])}; }
Exact operator-(const Exact& a, const Exact& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Rational dot(const Exact& a, const Exact& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Exact cross(const Exact& a, const Exact& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

/// The face's plane: what of a point times `normal` is below `offset` lies on the centre's side.
struct Plane {
  Exact normal;
  Rational offset;
};

Plane planeOf(const PrimitiveMesh& mesh, const Face& face) {
  const Exact a = exact(mesh.positions[face[0]]);
  Plane plane;
  plane.normal = cross(exact(mesh.positions[face[1]]) - a, exact(mesh.positions[face[2]]) - a);
  plane.offset = dot(plane.normal, a);
  return plane;
}

void expectClosed(const PrimitiveMesh& mesh) {
  const Topology topology = Topology::fromTriangles(mesh.positions.size(), mesh.faces);
  EXPECT_TRUE(topology.isClosed());
  EXPECT_EQ(topology.vertexCount() + topology.faces().size(), topology.edges().size() + 2) << "one piece, no hole";
}

TEST(PrimitiveMesh, ABoxHasItsCornersHalfItsSidesAway) {
  const PrimitiveMesh mesh = boxMesh({0.2, 0.4, 0.6});
  expectClosed(mesh);
  EXPECT_EQ(mesh.positions.front(), Vec3(-0.1, -0.2, -0.3));
  EXPECT_EQ(mesh.positions.back(), Vec3(0.1, 0.2, 0.3));
  for (const Face& face : mesh.faces) EXPECT_GT(planeOf(mesh, face).offset, 0) << "faces look outwards";
}

// Every plane lies outside of the solid: of all its points the furthest along the normal, r |n_xy| + h/2 |n_z|, is
// below the plane.
TEST(PrimitiveMesh, ACylinderLiesWithinItsMesh) {
  for (const double radius_m : {0.0007, 0.06, 1.1}) {
    for (const double tolerance_m : {1e-2, 1e-3, 1e-5}) {
      const double length_m = 3 * radius_m;
      const PrimitiveMesh mesh = cylinderMesh(radius_m, length_m, tolerance_m);
      expectClosed(mesh);
      EXPECT_LE(mesh.outside_m, 1.001 * tolerance_m);
      for (const Face& face : mesh.faces) {
        const Plane plane = planeOf(mesh, face);
        const Exact& n = plane.normal;
        const Rational rest = plane.offset - abs(n[2]) * Rational(length_m) / 2;
        ASSERT_GT(rest, 0);
        ASSERT_GT(rest * rest, Rational(radius_m) * Rational(radius_m) * (n[0] * n[0] + n[1] * n[1]));
      }
      double furthest = 0;
      for (const Vec3& p : mesh.positions) {
        furthest = std::max(furthest, std::hypot(p.head<2>().norm() - radius_m, std::abs(p.z()) - 0.5 * length_m));
      }
      EXPECT_LE(furthest, 1.001 * tolerance_m);
    }
  }
  EXPECT_EQ(cylinderMesh(0.06, 0.1, 1e-3).positions.size(), 36u) << "eighteen sides";
}

TEST(PrimitiveMesh, ASphereLiesWithinItsMesh) {
  for (const double radius_m : {0.0007, 0.06, 1.1}) {
    for (const double tolerance_m : {1e-2, 1e-3, 2e-4}) {
      const PrimitiveMesh mesh = sphereMesh(radius_m, tolerance_m);
      expectClosed(mesh);
      EXPECT_LE(mesh.outside_m, tolerance_m);
      for (const Face& face : mesh.faces) {
        const Plane plane = planeOf(mesh, face);
        ASSERT_GT(plane.offset, 0);
        ASSERT_GT(plane.offset * plane.offset,
                  Rational(radius_m) * Rational(radius_m) * dot(plane.normal, plane.normal));
      }
      for (const Vec3& p : mesh.positions) ASSERT_LE(p.norm() - radius_m, 1.001 * tolerance_m);
    }
  }
}

// What would take too many triangles is coarser, but still from outside, and says how far.
TEST(PrimitiveMesh, TooFineAToleranceIsSaid) {
  const PrimitiveMesh sphere = sphereMesh(1, 1e-9);
  EXPECT_EQ(sphere.faces.size(), 81920u);
  EXPECT_GT(sphere.outside_m, 1e-9);
  EXPECT_LT(sphere.outside_m, 8e-5);
  const PrimitiveMesh cylinder = cylinderMesh(1, 1, 1e-9);
  EXPECT_EQ(cylinder.positions.size(), 2u * MOST_CORNERS);
  EXPECT_LT(cylinder.outside_m, 3e-7);
}

}  // namespace
}  // namespace test
}  // namespace dccd
