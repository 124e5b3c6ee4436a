// What a map knows: which voxels it has seen, occupied or free. For scenes in which the unknown counts as an obstacle,
// or in which its share of the swept volume is reported.
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "dccd/deadline.h"
#include "dccd/export.h"
#include "dccd/tolerances.h"
#include "dccd/topology.h"
#include "dccd/types.h"
#include "dccd/voxel_surface.h"

namespace dccd {

/// How much of what a mesh sweeps a map does not know, in voxels of the finest level.
struct SweptSpace {
  std::uint64_t voxels = 0;   ///< voxels that the swept bounds of faces (of a polyline: edges) touch, each once
  std::uint64_t unknown = 0;  ///< of those, the ones that the map does not know
  bool complete = true;       ///< false: the sweep was larger than the limit, and only a part of it was counted
  /// Of what was counted, which is all only where it is complete.
  double unknownFraction() const {
    return voxels == 0 ? 0.0 : static_cast<double>(unknown) / static_cast<double>(voxels);
  }
};

/// Immutable once built; safe from several threads.
class DCCD_EXPORT KnownSpace {
 public:
  /// The leaves of all known voxels, occupied and free, in any order. Throws std::invalid_argument as
  /// VoxelSurface::build does.
  static std::shared_ptr<const KnownSpace> build(double resolution_m, const std::vector<OccupiedLeaf>& known_leaves);
  ~KnownSpace();

  double resolution() const;  ///< [m]
  std::size_t memoryBytes() const;

  /// Is every voxel known whose closed box meets the closed region [m, map frame]? What lies outside of the map's range
  /// is not known; an empty region is.
  bool isKnown(const Box& region_m) const;

  /// The unknown voxels whose closed box meets the crop region, as few cubes: with a map's occupied leaves they make
  /// the surface for which the unknown is occupied. Throws std::length_error naming the limit when there are more, and
  /// std::invalid_argument for a crop box that is not finite.
  std::vector<OccupiedLeaf> unknownLeaves(const Box& crop_m,
                                          std::size_t max_leaves = tolerance::MAX_UNKNOWN_LEAVES) const;

  static constexpr std::size_t MOST_BLOCKS = 1'000'000;
  /// Counts what the mesh's swept bounds touch. vertex_active as for ObstacleCheck::run. limit: blocks of 4^3
  /// voxels, each once however many faces touch it. Not complete, too, when it would not be done by the deadline.
  SweptSpace sweptSpace(const Topology& topology, const Positions& map_t0, const Positions& map_t1,
                        const std::uint8_t* vertex_active, std::size_t limit = MOST_BLOCKS,
                        const Deadline& deadline = {}) const;

 private:
  struct DCCD_HIDDEN Impl;
  explicit KnownSpace(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
