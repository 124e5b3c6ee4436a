// Occupied space of a map as what a mesh can touch: exposed faces, convex edges, corners. No OctoMap here.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>
#include <vector>

#include "dccd/contact.h"
#include "dccd/export.h"
#include "dccd/topology.h"
#include "dccd/types.h"

namespace dccd {

/// An occupied leaf: a cube of `size` finest voxels a side, its smallest key `min`. Pruned leaves are not expanded.
struct OccupiedLeaf {
  VoxelKey min;
  std::uint32_t size = 1;
};

/// Coordinate of plane k in the map's frame, in metres; this double is the truth (doc/algorithm.md, "Obstacles").
inline double voxelPlane(std::int64_t k, double resolution_m) { return static_cast<double>(k - 32768) * resolution_m; }

/// The surface of the occupied space of one map, in the map's frame. Immutable once built.
class DCCD_EXPORT VoxelSurface {
 public:
  struct DCCD_HIDDEN Impl;
  /// Leaves in any order. Throws std::invalid_argument naming the value when resolution_m is not from 1e-290 to 1e290,
  /// or a leaf's size is no power of two up to 65536, its key no multiple of its size, or two leaves overlap.
  static std::shared_ptr<const VoxelSurface> build(double resolution_m, std::vector<OccupiedLeaf> leaves);
  explicit VoxelSurface(std::unique_ptr<Impl> impl);
  ~VoxelSurface();

  double resolution() const;  ///< [m]
  std::size_t leafCount() const;
  // These three are counted at each call.
  std::size_t memoryBytes() const;
  const Box& bounds() const;  ///< [m], map frame; empty when nothing is occupied
  /// Leaves in the order of the surface's index: fixed by the set of leaves, not sorted by key.
  const std::vector<OccupiedLeaf>& leaves() const;
  /// The leaf that contains the point (closed), or null. Ties on shared planes: the smallest key.
  const OccupiedLeaf* leafAt(const Vec3& point_map) const;

 private:
  std::unique_ptr<Impl> impl_;
};

struct ObstacleStats {
  std::uint64_t pairs_in = 0;  ///< candidates past the bounds
};

struct ObstacleOptions {
  AccuracyOptions accuracy;
  double minimum_separation_m = 0;  ///< contact when closer than this; conservative only when > 0
};

/// What ObstacleCheck is asked: one body's step in the map's frame. It names what must live until the answer.
struct ObstacleQuery {
  const VoxelSurface& surface;
  const Topology& topology;
  const Positions& map_t0;
  const Positions& map_t1;
  std::uint16_t body = 0;                       ///< for Contact::body[0]
  const std::uint8_t* vertex_active = nullptr;  ///< a byte a vertex, 0 leaves out it and its features; null: all count
  /// Uncertainty per vertex, 0 or more; null: none. The largest one of a feature adds to the separation, which only
  /// conservative can hold.
  const double* vertex_radius_m = nullptr;
  Deadline deadline{};  ///< features that have not been begun by then are left out
  /// So many contacts at most are appended; of more, those found first.
  std::size_t most_found = std::numeric_limits<std::size_t>::max();
};

/// Mesh vertices against exposed voxel faces, mesh edges against convex voxel edges, voxel corners against mesh faces,
/// over one body's step in the map's frame. For each face (of a polyline: edge) the earliest TOC over its own, its
/// edges' and its vertices' contacts is that of its first touch of the occupied voxels as closed, solid boxes. At most
/// one contact for each mesh feature, leaf and kind, the earliest.
/// - `initial` (TOC 0): the feature touches the leaf at t=0, interior leaves included. A vertex has one for each leaf
///   it touches; an edge none of whose ends is inside any leaf, one for each leaf that it pierces or touches; a face
///   none of whose sides touches a leaf, one for each leaf that pierces it. What an end or a side settles is not said
///   again.
/// - `leaving`: a feature that touched some leaf at t=0 meets another one's face, edge or corner from within.
/// Rungs: vertices are always decided exactly (the path of a point through a box is linear); edges and corners by the
/// elementary test.
/// Reusable scratch inside: after warm-up a run allocates nothing that grows with the number of steps. Not thread-safe;
/// one per thread or body.
class DCCD_EXPORT ObstacleCheck {
 public:
  explicit ObstacleCheck(const ObstacleOptions& options);
  ~ObstacleCheck();
  /// Appends contacts (OBSTACLE_BODY in Contact::body[1]) in canonical order. False: the deadline left features out.
  bool run(const ObstacleQuery& query, std::vector<Contact>& contacts, ObstacleStats& stats);
  /// Whether the last run had more to find than most_found.
  bool isFull() const;

 private:
  struct DCCD_HIDDEN Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd
