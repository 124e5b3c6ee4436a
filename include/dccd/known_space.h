// What a map knows: which voxels it has seen, occupied or free. For scenes in which the unknown counts as an obstacle.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "dccd/export.h"
#include "dccd/tolerances.h"
#include "dccd/types.h"
#include "dccd/voxel_surface.h"

namespace dccd {

/// Immutable once built; safe from several threads.
class DCCD_EXPORT KnownSpace {
 public:
  /// The leaves of all known voxels, occupied and free, in any order. Throws std::invalid_argument as
  /// VoxelSurface::build does.
  static std::shared_ptr<const KnownSpace> build(double resolution_m, const std::vector<OccupiedLeaf>& known_leaves);
  /// The same of one of several maps. found: cubes in Morton order, within what is occupied, in which its sensor found
  /// something since the map before.
  static std::shared_ptr<const KnownSpace> build(double resolution_m, const std::vector<OccupiedLeaf>& known_leaves,
                                                 std::vector<OccupiedLeaf> found);
  ~KnownSpace();

  double resolution() const;  ///< [m]
  std::size_t memoryBytes() const;

  /// Is every voxel known whose closed box meets the closed region [m, map frame]? What lies outside of the map's range
  /// is not known; an empty region is.
  bool isKnown(const Box& region_m) const;

  /// Null where nobody told what was found.
  const std::vector<OccupiedLeaf>* found() const;

  /// The unknown voxels whose closed box meets the crop region, as few cubes: with a map's occupied leaves they make
  /// the surface for which the unknown is occupied. Throws std::length_error naming the limit when there are more, and
  /// std::invalid_argument for a crop box that is not finite.
  std::vector<OccupiedLeaf> unknownLeaves(const Box& crop_m,
                                          std::size_t max_leaves = tolerance::MAX_UNKNOWN_LEAVES) const;

  struct DCCD_HIDDEN Impl;

 private:
  explicit KnownSpace(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
