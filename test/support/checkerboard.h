// A map that has as many exposed faces as one of its size can have: every other voxel of a block is occupied.
#pragma once

#include "support/detector.h"

namespace dccd {
namespace test {

/// A triangle that slides through size^3 voxels of a metre, every other one occupied, from below to above.
inline Step throughACheckerboard(std::uint16_t size) {
  std::vector<OccupiedLeaf> leaves;
  for (std::uint16_t x = 0; x < size; ++x) {
    for (std::uint16_t y = 0; y < size; ++y) {
      for (std::uint16_t z = 0; z < size; ++z) {
        if ((x + y + z) % 2 != 0) continue;
        leaves.push_back({{static_cast<std::uint16_t>(32768 + x), static_cast<std::uint16_t>(32768 + y),
                           static_cast<std::uint16_t>(32768 + z)},
                          1});
      }
    }
  }
  Body triangle;
  triangle.name = "triangle";
  triangle.topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
  const double top = size, past = size + 1;
  Step step = stepOf(triangle, {{-1, -1, -1}, {past, -1, 0}, {0, past, 1}},
                     {{-1, -1, top}, {past, -1, past}, {0, past, past + 1}});
  step.map.surface = VoxelSurface::build(1.0, leaves);
  return step;
}

}  // namespace test
}  // namespace dccd
