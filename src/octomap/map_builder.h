// Builds octomaps of known shapes for recorded scenes and tests, and makes bytes of octrees.
#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "dccd/types.h"

namespace octomap {
class OcTree;
}

namespace dccd {

/// The bytes of a message: OctoMap's binary stream, pruned or not as the tree is, or the full one with log-odds.
std::vector<std::int8_t> serialized(const octomap::OcTree& tree, bool binary);

/// Serializes an OcTree whose voxels are occupied where `occupied(center)` says so, and unknown elsewhere.
/// @param resolution_m edge of a voxel
/// @param bounds what is asked about, in the map's frame [m]
/// @param binary true: OctoMap's binary stream (a .bt file's body), pruned; false: the full stream with log-odds
std::vector<std::int8_t> buildOctomap(double resolution_m, const Box& bounds,
                                      const std::function<bool(const Vec3& center_m)>& occupied, bool binary);

}  // namespace dccd
