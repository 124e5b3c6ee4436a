// What VoxelSurface holds: the tree of leaves and one mask of exposed features for each.
#pragma once

#include <vector>

#include "dccd/tolerances.h"
#include "dccd/voxel_surface.h"
#include "obstacle/voxel_exposure.h"
#include "obstacle/voxel_tree.h"

namespace dccd {

struct VoxelSurface::Impl {
  static const Impl& of(const VoxelSurface& surface) { return *surface.impl_; }

  Impl(double resolution, VoxelTree of, std::vector<FeatureMask> exposed);

  /// Keys of all voxels that a closed range of coordinates [m] may touch, closed voxels: at least these.
  KeyBox keysOf(const double* lo, const double* hi) const;

  double resolution_m;
  double inverse_resolution;
  VoxelTree tree;
  std::vector<FeatureMask> features;  ///< one per leaf
  Box bounds;
};

/// A leaf as a closed box [m].
struct LeafBox {
  double lo[3];
  double hi[3];
};

inline LeafBox leafBox(const OccupiedLeaf& leaf, double resolution_m) {
  LeafBox box;
  const std::int64_t key[3] = {leaf.min.x, leaf.min.y, leaf.min.z};
  for (int axis = 0; axis < 3; ++axis) {
    box.lo[axis] = voxelPlane(key[axis], resolution_m);
    box.hi[axis] = voxelPlane(key[axis] + leaf.size, resolution_m);
  }
  return box;
}

// Cell coordinates are rounded outward by VOXEL_KEY cells. |x / resolution| <= 2^15, made by a rounded inverse and a
// product, errs by 2^-37 cells, a plane by 2^-38; two sums of at most 2^16 round by 2^-38 and 2^-37, and x itself,
// where it is a bound that was moved by a separation, by 2^-38: below 2^-35 in all.

/// The key of the voxel below x (side -1) or above it (side +1), rounded outward and clamped to the map's range.
inline std::int32_t outwardKey(double x, double inverse_resolution, double side) {
  const double cell = x * inverse_resolution + (32768.0 + side * tolerance::VOXEL_KEY);
  return static_cast<std::int32_t>(cell < 0 ? 0.0 : cell > 65535.0 ? 65535.0 : cell);
}

}  // namespace dccd
