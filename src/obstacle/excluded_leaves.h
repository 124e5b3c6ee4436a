// What of a map is left when the voxels in some boxes are taken out of it.
#pragma once

#include <cstdint>
#include <vector>

#include "base/map_limits.h"
#include "dccd/voxel_surface.h"

namespace dccd {

struct RemainingLeaves {
  std::vector<OccupiedLeaf> leaves;
  std::uint64_t excluded_voxels = 0;  ///< finest ones
};

/// Leaves without the finest voxels whose centre lies in one of the boxes (closed, in the fixed frame [m]). A leaf that
/// a box cuts is split. Taken out of the map, not of its contacts: what lies behind an excluded voxel is exposed by
/// that. Bounded: when MAX_ADDED_LEAVES parts have been looked at, leaves are kept whole, so that nothing is hidden
/// that should not be.
RemainingLeaves leavesOutside(const std::vector<OccupiedLeaf>& leaves, double resolution_m,
                              const Eigen::Isometry3d& fixed_from_map, const std::vector<Box>& boxes);

}  // namespace dccd
