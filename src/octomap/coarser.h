// A map with larger voxels, as OctoMap gives it when its tree is read to a lesser depth.
#pragma once

#include <cstddef>
#include <memory>

#include "dccd/voxel_surface.h"

namespace dccd {

/// Occupied is every cube of `factor` voxels a side (a power of two) in which any voxel is; eight such cubes that make
/// the next larger one are that. The planes keep their coordinates. Throws std::invalid_argument for another factor.
std::shared_ptr<const VoxelSurface> coarser(const VoxelSurface& map, std::size_t factor);

}  // namespace dccd
