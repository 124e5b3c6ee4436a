// Which faces, edges and corners of each occupied leaf a mesh from outside can touch first.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "obstacle/voxel_tree.h"

namespace dccd {

/// Features of one leaf: bits 0-5 faces (FACE_DIRECTIONS order), 6-17 edges, 18-25 corners.
using FeatureMask = std::uint32_t;

constexpr FeatureMask FACE_MASK = 0x3f;
constexpr FeatureMask EDGE_MASK = 0xfffu << 6;
constexpr FeatureMask CORNER_MASK = 0xffu << 18;

/// Edge along `axis` at the lower (0) or upper (1) side of the next two axes in cyclic order.
constexpr int edgeBit(int axis, int side_b, int side_c) { return 6 + 4 * axis + side_b + 2 * side_c; }
/// Corner at the lower (0) or upper (1) side of x, y and z.
constexpr int cornerBit(int side_x, int side_y, int side_z) { return 18 + side_x + 2 * side_y + 4 * side_z; }

/// One mask for each leaf, in the tree's order. Where the neighbours are smaller than the leaf, a face that is exposed
/// anywhere counts whole, and so does an edge or a corner that counts somewhere: a superset, never less.
/// Also tells the tree which cells hold edges and corners.
std::vector<FeatureMask> exposedFeatures(VoxelTree& tree);

}  // namespace dccd
