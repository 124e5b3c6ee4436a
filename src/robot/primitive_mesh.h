// Boxes, cylinders and spheres as closed meshes about their centre. A round one is meshed from outside: the solid lies
// within the mesh, so that nothing can touch it unseen.
#pragma once

#include <vector>

#include "dccd/types.h"

namespace dccd {

struct PrimitiveMesh {
  Positions positions;  ///< [m]
  std::vector<Face> faces;
  double outside_m = 0;  ///< no point of the mesh is further from the primitive
};

/// Exact: its corners are half of its sides away. size: its sides along x, y and z [m], above 0.
PrimitiveMesh boxMesh(const Vec3& size);
/// About the z axis, as URDF has it. Within the tolerance [m], as far as MOST_CORNERS and MOST_SPLITS allow.
PrimitiveMesh cylinderMesh(double radius_m, double length_m, double tolerance_m);
PrimitiveMesh sphereMesh(double radius_m, double tolerance_m);

constexpr int MOST_CORNERS = 4096;  ///< of a cylinder's circle: 1 m within 0.3 um
constexpr int MOST_SPLITS = 6;  ///< of a sphere's twenty triangles into four each: 1 m within 0.08 mm, 81,920 triangles

}  // namespace dccd
