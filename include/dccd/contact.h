// Contacts as the detector returns them, and their geometry, computed on demand.
#pragma once

#include <cstdint>
#include <tuple>
#include <vector>

#include "dccd/elementary.h"
#include "dccd/export.h"
#include "dccd/types.h"

namespace dccd {

enum class Certainty : std::uint8_t { CERTAIN = 0, UNDECIDED = 1 };

constexpr std::uint16_t OBSTACLE_BODY = 0xffff;

/// Key of a voxel of the map's finest level: voxel k spans [plane(k), plane(k+1)] on each axis,
/// plane(k) = fl((k - 32768) * resolution).
struct VoxelKey {
  std::uint16_t x = 0, y = 0, z = 0;
  friend bool operator==(const VoxelKey& a, const VoxelKey& b) { return a.x == b.x && a.y == b.y && a.z == b.z; }
  friend bool operator<(const VoxelKey& a, const VoxelKey& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  }
};

/// One contact. VF: body[0] owns the vertex, body[1] the face. EE: the edge that sorts first is first
/// (body, then the edge's vertex indices); within an edge the smaller index is first.
struct Contact {
  double toc_lower = 0;                                                 ///< [0,1] of the step
  double toc_upper = 1;                                                 ///< [0,1] of the step
  std::array<Index, 4> vertex{NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX};  ///< body-local; unused ones NO_INDEX
  std::array<std::uint16_t, 2> body{0, 0};  ///< index into the bodies; OBSTACLE_BODY for the octomap
  VoxelKey voxel;                           ///< octomap pairs: the occupied voxel (its smallest key when a pruned leaf)
  std::uint32_t voxel_size = 0;             ///< octomap pairs: edge length of the occupied leaf in finest voxels
  PairKind kind = PairKind::VERTEX_FACE;
  Certainty certainty = Certainty::CERTAIN;
  bool initial = false;   ///< in contact or inside at t=0
  bool leaving = false;   ///< crossing outwards of what started inside an obstacle
  bool expected = false;  ///< by one of Options::expected: no alarm
  /// The body that vertex[i] is of.
  std::uint16_t bodyOf(std::size_t i) const { return body[factsOf(kind).sideOf(i)]; }
};

/// The canonical order of contacts: kind, bodies, vertex indices, voxel; independent of threads and targets.
inline bool canonicalLess(const Contact& a, const Contact& b) {
  return std::tie(a.kind, a.body, a.vertex, a.voxel, a.toc_lower) <
         std::tie(b.kind, b.body, b.vertex, b.voxel, b.toc_lower);
}

/// Where and how the features touch at toc_lower, in double (rounded; for display and control, not for decisions).
struct ContactGeometry {
  Vec3 point = Vec3::Zero();                  ///< [m] midpoint of the closest points
  Vec3 normal = Vec3::UnitZ();                ///< unit, from the second feature towards the first
  std::array<double, 4> weights{0, 0, 0, 0};  ///< VF: 1, then the face's barycentric; EE: along each edge
  double approach_speed = 0;                  ///< [m per step] > 0 when closing
};

/// Geometry of a mesh-mesh contact from its four vertices' motion (order of Contact::vertex).
DCCD_EXPORT ContactGeometry contactGeometry(PairKind kind, const PairMotion& pair, double toc);

}  // namespace dccd
