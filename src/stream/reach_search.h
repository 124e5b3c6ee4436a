// Which cubes of a map's space bodies came near to on their ways.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dccd/mesh_store.h"
#include "obstacle/voxel_surface_impl.h"
#include "stream/rigid_shape.h"

namespace dccd {

/// A body whose frames tell where it was, and how far from its surface a voxel may be its own.
struct TrackedBody {
  std::uint16_t body = 0;
  std::string name;
  double reach_m = 0;  ///< Body::own_voxels_m
  const MeshStore* frames = nullptr;
  bool holds_always = false;  ///< static: its newest frame, at all stamps
  bool shell = false;         ///< Body::shell: what is inside is not in it
};

using BodyWay = std::vector<MeshStore::Stretch>;

/// A cube, why it is asked for, and the body that reaches it.
struct ReachedCube {
  enum class Why : std::uint8_t { APPEARED, VANISHED, REMEMBERED, DOUBTED };
  OccupiedLeaf leaf;
  Why why;
  LeafBox box;
  int body = -1;  ///< -1: none
};

/// Sets the bodies. A cube counts as reached only where a point of a body's surface at some time of its way, and a
/// point of the cube, are seen to be within reach_m: the answer may miss a reach at the very rim, and invents none. So
/// does a cube whose middle is inside of a closed rigid body that is no shell. `shapes`: of rigid bodies, to be kept
/// from one map to the next; the answer is the same without them (null), and takes longer.
void searchReach(const std::vector<TrackedBody>& bodies, const std::vector<BodyWay>& ways,
                 const Eigen::Isometry3d& map_from_fixed, double resolution_m, std::vector<ReachedCube>& cubes,
                 RigidShapes* shapes);

}  // namespace dccd
