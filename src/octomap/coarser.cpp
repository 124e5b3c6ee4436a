#include "octomap/coarser.h"

#include <map>
#include <stdexcept>
#include <string>
#include <tuple>
#include <vector>

namespace dccd {
namespace {

/// By size, so that those which make larger ones come before these.
using Cube = std::tuple<std::uint32_t, std::uint16_t, std::uint16_t, std::uint16_t>;  // size, then the smallest key

/// The cube of that size which holds the other one.
Cube around(const Cube& cube, std::uint32_t size) {
  const auto aligned = [&](std::uint16_t key) { return static_cast<std::uint16_t>(key & ~(size - 1)); };
  return {size, aligned(std::get<1>(cube)), aligned(std::get<2>(cube)), aligned(std::get<3>(cube))};
}

}  // namespace

std::shared_ptr<const VoxelSurface> coarser(const VoxelSurface& map, std::size_t factor) {
  constexpr std::uint32_t ALL = 65536;
  if (factor == 0 || factor > ALL || (factor & (factor - 1)) != 0) {
    throw std::invalid_argument("voxels " + std::to_string(factor) + " times as large; a power of two is needed");
  }
  std::map<Cube, int> cubes;  // the number of cubes of half the size that have come together in each
  const auto least = static_cast<std::uint32_t>(factor);
  for (const OccupiedLeaf& leaf : map.leaves()) {
    const Cube cube{leaf.size, leaf.min.x, leaf.min.y, leaf.min.z};
    cubes[leaf.size < least ? around(cube, least) : cube] = 8;
  }
  std::vector<OccupiedLeaf> leaves;
  for (auto at = cubes.begin(); at != cubes.end();) {
    const auto [cube, count] = *at;
    const std::uint32_t size = std::get<0>(cube);
    if (count == 8 && size < ALL) ++cubes[around(cube, 2 * size)];  // comes later in the order
    at = cubes.upper_bound(cube);
  }
  for (const auto& [cube, count] : cubes) {
    const auto& [size, x, y, z] = cube;
    if (count < 8) continue;  // not all of it
    const auto larger = size < ALL ? cubes.find(around(cube, 2 * size)) : cubes.end();
    if (larger == cubes.end() || larger->second < 8) leaves.push_back({{x, y, z}, size});
  }
  return VoxelSurface::build(map.resolution(), std::move(leaves));
}

}  // namespace dccd
