#include "robot/primitive_mesh.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

namespace dccd {
namespace {

// What a round primitive is larger than it should be, so that rounding does not take the mesh inside of it: of its
// corners here, below 2^-48 of their size, and of where they are placed, below 2^-48 of coordinates up to 25 km.
constexpr double GROWTH = 1 + 0x1p-40, GROWTH_M = 1e-10;

double grown(double size_m) { return size_m * GROWTH + GROWTH_M; }

/// How far from the centre the plane of the face is.
double distance(const PrimitiveMesh& mesh, const Face& face) {
  const Vec3 &a = mesh.positions[face[0]], &b = mesh.positions[face[1]], &c = mesh.positions[face[2]];
  return (b - a).cross(c - a).normalized().dot(a);
}

PrimitiveMesh icosahedron() {
  const double g = (1 + std::sqrt(5.0)) / 2;
  PrimitiveMesh mesh;
  mesh.positions = {{-1, g, 0},  {1, g, 0},  {-1, -g, 0}, {1, -g, 0}, {0, -1, g},  {0, 1, g},
                    {0, -1, -g}, {0, 1, -g}, {g, 0, -1},  {g, 0, 1},  {-g, 0, -1}, {-g, 0, 1}};
  for (Vec3& p : mesh.positions) p.normalize();
  mesh.faces = {{0, 11, 5},  {0, 5, 1},  {0, 1, 7},  {0, 7, 10}, {0, 10, 11}, {1, 5, 9}, {5, 11, 4},
                {11, 10, 2}, {10, 7, 6}, {7, 1, 8},  {3, 9, 4},  {3, 4, 2},   {3, 2, 6}, {3, 6, 8},
                {3, 8, 9},   {4, 9, 5},  {2, 4, 11}, {6, 2, 10}, {8, 6, 7},   {9, 8, 1}};
  return mesh;
}

/// Each triangle into four, the new vertices on the unit sphere.
PrimitiveMesh split(PrimitiveMesh mesh) {
  std::map<std::pair<Index, Index>, Index> middles;
  const auto middle = [&](Index a, Index b) {
    const auto [at, is_new] = middles.try_emplace(std::minmax(a, b), static_cast<Index>(mesh.positions.size()));
    if (is_new) mesh.positions.push_back((mesh.positions[a] + mesh.positions[b]).normalized());
    return at->second;
  };
  std::vector<Face> faces;
  for (const Face& f : mesh.faces) {
    const Index a = middle(f[0], f[1]), b = middle(f[1], f[2]), c = middle(f[2], f[0]);
    for (const Face& one : {Face{f[0], a, c}, Face{f[1], b, a}, Face{f[2], c, b}, Face{a, b, c}}) faces.push_back(one);
  }
  mesh.faces = std::move(faces);
  return mesh;
}

}  // namespace

PrimitiveMesh boxMesh(const Vec3& size) {
  PrimitiveMesh mesh;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 side((corner & 1) ? 1 : -1, (corner & 2) ? 1 : -1, (corner & 4) ? 1 : -1);
    mesh.positions.push_back(0.5 * side.cwiseProduct(size));
  }
  mesh.faces = {{0, 2, 3}, {0, 3, 1}, {4, 5, 7}, {4, 7, 6}, {0, 1, 5}, {0, 5, 4},
                {2, 6, 7}, {2, 7, 3}, {0, 4, 6}, {0, 6, 2}, {1, 3, 7}, {1, 7, 5}};
  return mesh;
}

PrimitiveMesh cylinderMesh(double radius_m, double length_m, double tolerance_m) {
  const double needed = std::ceil(M_PI / std::acos(radius_m / (radius_m + tolerance_m)));
  const int n = static_cast<int>(std::clamp(needed, 6.0, static_cast<double>(MOST_CORNERS)));
  const double corner_m = grown(radius_m) / std::cos(M_PI / n), half_m = 0.5 * grown(length_m);
  PrimitiveMesh mesh;
  mesh.outside_m = std::hypot(corner_m - radius_m, half_m - 0.5 * length_m);
  for (int i = 0; i < n; ++i) {
    const double angle = 2 * M_PI * i / n, x = corner_m * std::cos(angle), y = corner_m * std::sin(angle);
    mesh.positions.emplace_back(x, y, -half_m);
    mesh.positions.emplace_back(x, y, half_m);
  }
  const auto at = [n](int corner, int top) { return static_cast<Index>(2 * (corner % n) + top); };
  for (int i = 0; i < n; ++i) {
    mesh.faces.push_back({at(i, 0), at(i + 1, 0), at(i + 1, 1)});
    mesh.faces.push_back({at(i, 0), at(i + 1, 1), at(i, 1)});
    if (i == 0 || i + 1 == n) continue;
    mesh.faces.push_back({at(0, 0), at(i + 1, 0), at(i, 0)});
    mesh.faces.push_back({at(0, 1), at(i, 1), at(i + 1, 1)});
  }
  return mesh;
}

PrimitiveMesh sphereMesh(double radius_m, double tolerance_m) {
  PrimitiveMesh mesh = icosahedron();
  for (int splits = 0;; ++splits) {
    double nearest = 1;
    for (const Face& face : mesh.faces) nearest = std::min(nearest, distance(mesh, face));
    const double corner_m = grown(radius_m) / nearest;
    mesh.outside_m = corner_m - radius_m;
    if (mesh.outside_m <= tolerance_m || splits == MOST_SPLITS) {
      for (Vec3& p : mesh.positions) p *= corner_m;
      return mesh;
    }
    mesh = split(std::move(mesh));
  }
}

}  // namespace dccd
