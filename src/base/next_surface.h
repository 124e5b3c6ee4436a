// The surface of a map that came after another one.
#pragma once

#include <memory>
#include <vector>

#include "dccd/export.h"
#include "dccd/voxel_surface.h"

namespace dccd {

/// What VoxelSurface::build() makes of the same leaves, bit for bit; it takes the less, the less these differ from
/// those of the surface before. Fast where the leaves come in Morton order, as decodeOctomap() gives them. Throws as
/// build() does.
DCCD_EXPORT std::shared_ptr<const VoxelSurface> nextSurface(double resolution_m, std::vector<OccupiedLeaf> leaves,
                                                            const VoxelSurface& before);

}  // namespace dccd
