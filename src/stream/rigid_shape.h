// A rigid body in its own frame, where it is the same from frame to frame: which of its faces are near a point, and
// whether a point is inside of it.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <unordered_map>
#include <utility>
#include <vector>

#include "dccd/mesh_store.h"
#include "stream/box_grid.h"

namespace dccd {

/// Whether the point is inside of a closed surface, as the start state has it: a half-line crosses an odd number of
/// faces, exactly, whichever way they are turned. Vertices are finite.
bool isInside(const Positions& positions, const std::vector<Face>& faces, const Vec3& point);

/// Not thread-safe.
class RigidShape {
 public:
  /// Whether it is the shape of this frame, up to SLACK of a voxel; it becomes that if it was another one. False where
  /// the frame has a vertex that is not finite.
  bool isOf(const MeshFrame& frame, double resolution_m);

  static constexpr double SLACK = 1e-6;
  const Eigen::AlignedBox3d& bounds() const { return bounds_; }
  /// Whether test(number) is true of one of the faces within `near_m` of a point of the body's frame, and maybe of some
  /// more. It is asked of each once at the most, and not on once it was true.
  template <class Test>
  bool anyNear(const Vec3& point, double near_m, Test&& test) {
    ++question_;
    const auto isNear = [&](std::uint32_t f) {
      if (std::exchange(asked_[f], question_) == question_) return false;
      return boxes_[f].squaredExteriorDistance(point) <= near_m * near_m && test(f);
    };
    const Vec3 lo = point.array() - near_m, hi = point.array() + near_m;
    // The faces around the point itself come first: most points that are near are so by one of them.
    return faces_.any(point.data(), point.data(), isNear) || faces_.any(lo.data(), hi.data(), isNear);
  }
  std::array<Vec3, 3> face(std::uint32_t number) const {
    const Face& f = topology_->faces()[number];
    return {points_[f[0]], points_[f[1]], points_[f[2]]};
  }
  /// The same as isInside() for a point that is at least half a voxel from the surface of a closed body.
  bool holds(const Vec3& point);

 private:
  std::shared_ptr<const Topology> topology_;
  double resolution_m_ = 0;
  Positions points_;  // of its vertices
  Eigen::AlignedBox3d bounds_;
  std::vector<Eigen::AlignedBox3d> boxes_;  // of faces
  BoxGrid faces_;
  std::vector<std::uint64_t> asked_;  // per face, the last question that came to it
  std::uint64_t question_ = 0;
  std::unordered_map<std::uint64_t, bool> inside_;  // by cell of a grid, as far as anybody asked

  void build(const MeshFrame& frame, double resolution_m);
};

/// By number of body.
using RigidShapes = std::map<std::uint16_t, RigidShape>;

}  // namespace dccd
