#include "support/octomap_cases.h"

#include <random>

namespace dccd {
namespace benchmarks {

Case makeCase(const std::string& name, std::size_t rows, std::size_t cols, double side_m, double height_voxels,
              double fall_voxels, double required_ms, bool triangulated) {
  Case c;
  c.name = name;
  c.topology = rows > 1 ? Topology::grid(rows, cols) : Topology::polyline(cols);
  c.required_ms = required_ms;
  c.triangulated = triangulated;
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> unit(0, 1), sideways(-0.2, 0.2);
  const double top_m = voxelPlane(TOP, VOXEL_M);
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t k = 0; k < cols; ++k) {
      const double x = (static_cast<double>(k) / static_cast<double>(cols - 1) - 0.5) * side_m;
      const double y = rows > 1 ? (static_cast<double>(r) / static_cast<double>(rows - 1) - 0.5) * side_m : 0.0;
      const Vec3 p(x, y, top_m + VOXEL_M * (height_voxels + 0.1 * unit(random)));
      c.t0.push_back(p);
      c.t1.push_back(p + VOXEL_M * Vec3(sideways(random), sideways(random), -fall_voxels * unit(random)));
    }
  }
  return c;
}

std::vector<OccupiedLeaf> tableTop() {
  std::vector<OccupiedLeaf> leaves;
  for (int x = 0; x < SIDE; ++x) {
    for (int y = 0; y < SIDE; ++y) {
      for (int z = 0; z < LAYERS; ++z) {
        OccupiedLeaf leaf;
        leaf.min = {static_cast<std::uint16_t>(FIRST + x), static_cast<std::uint16_t>(FIRST + y),
                    static_cast<std::uint16_t>(TOP - 1 - z)};
        leaves.push_back(leaf);
      }
    }
  }
  return leaves;
}

Body bodyOf(const Case& c) {
  Body cloth;
  cloth.name = "cloth";
  cloth.topology = std::make_shared<const Topology>(c.topology);
  cloth.self_collision = false;
  return cloth;
}

}  // namespace benchmarks
}  // namespace dccd
