// What many tests begin with: a body of a mesh, grids of points and where they go, voxels by their place in the map.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "support/step_support.h"

namespace dccd {
namespace test {

inline Body bodyOf(const std::string& name, const Topology& topology) {
  Body body;
  body.name = name;
  body.topology = share(topology);
  return body;
}

inline Positions movedBy(Positions positions, const Vec3& by) {
  for (Vec3& p : positions) p += by;
  return positions;
}

/// The whole way of the body.
inline void moveBy(StepBody& body, const Vec3& by) {
  body.t0 = movedBy(body.t0, by);
  body.t1 = movedBy(body.t1, by);
}

/// The points of Topology::grid(rows, cols), parallel to the xy plane, the first one in the corner.
inline Positions gridAt(std::size_t rows, std::size_t cols, double cell_m, const Vec3& corner = Vec3::Zero()) {
  Positions positions;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t col = 0; col < cols; ++col) {
      positions.push_back(corner + cell_m * Vec3(static_cast<double>(col), static_cast<double>(row), 0));
    }
  }
  return positions;
}

/// From the map's origin, in voxels.
inline OccupiedLeaf voxelAt(int x, int y, int z, std::uint32_t size = 1) {
  const auto key = [](int i) { return static_cast<std::uint16_t>(32768 + i); };
  return {{key(x), key(y), key(z)}, size};
}

/// All voxels of a box; `to` is the first one beyond it.
inline std::vector<OccupiedLeaf> voxelsOfBox(const std::array<int, 3>& from, const std::array<int, 3>& to) {
  std::vector<OccupiedLeaf> leaves;
  for (int x = from[0]; x < to[0]; ++x) {
    for (int y = from[1]; y < to[1]; ++y) {
      for (int z = from[2]; z < to[2]; ++z) leaves.push_back(voxelAt(x, y, z));
    }
  }
  return leaves;
}

inline bool same(const std::vector<StartIntersection>& x, const std::vector<StartIntersection>& y) {
  return std::equal(x.begin(), x.end(), y.begin(), y.end(), [](const auto& a, const auto& b) { return a == b; });
}

}  // namespace test
}  // namespace dccd
