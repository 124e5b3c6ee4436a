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

/// next_exposure.cpp: the same of a tree that followed another one, whose masks these are: only what the change reaches
/// is looked at.
std::vector<FeatureMask> exposedFeatures(VoxelTree& tree, const VoxelTree& before,
                                         const std::vector<FeatureMask>& masks_before, const VoxelTree::Change& change);

/// What both are made of.
namespace exposure {

using Cell = std::array<std::int32_t, 3>;

/// Of a leaf with these exposed faces.
FeatureMask featuresOf(FeatureMask faces);
/// Leaves of one and two voxels, a level 1 node (16 voxels a side) at a time; of its blocks those that are `wanted`
/// (null: all). Tells the tree of their cells, too.
void setSmallLeaves(VoxelTree& tree, std::uint32_t node, std::vector<FeatureMask>& masks,
                    const std::vector<std::uint8_t>* wanted);
/// Leaves of four voxels and more, whose neighbours may be of any size.
FeatureMask largeLeaf(const VoxelTree& tree, const OccupiedLeaf& leaf);
/// Tells the tree of all cells, once it knows those of small leaves.
void markFeatureCells(VoxelTree& tree, const std::vector<FeatureMask>& masks);

}  // namespace exposure

}  // namespace dccd
