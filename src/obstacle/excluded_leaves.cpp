#include "obstacle/excluded_leaves.h"

#include <algorithm>

#include "obstacle/leaf_sets.h"

namespace dccd {
namespace {

class Splitter {
 public:
  Splitter(double resolution_m, const Eigen::Isometry3d& fixed_from_map, const std::vector<Box>& boxes)
      : resolution_m_(resolution_m),
        fixed_from_map_(fixed_from_map),
        extent_(fixed_from_map.linear().cwiseAbs() * Vec3::Ones()),
        boxes_(boxes) {}

  void add(const OccupiedLeaf& leaf) {
    const double half = 0.5 * leaf.size * resolution_m_;
    const Vec3 corner(voxelPlane(leaf.min.x, resolution_m_), voxelPlane(leaf.min.y, resolution_m_),
                      voxelPlane(leaf.min.z, resolution_m_));
    const Vec3 centre = fixed_from_map_ * Vec3(corner + Vec3::Constant(half)), extent = half * extent_;
    const auto any = [this](const auto& condition) { return std::any_of(boxes_.begin(), boxes_.end(), condition); };
    const bool near = any([&](const Box& box) {
      return ((centre + extent).array() >= box.min.array()).all() &&
             ((centre - extent).array() <= box.max.array()).all();
    });
    if (!near) {
      remaining_.leaves.push_back(leaf);
      return;
    }
    // The whole cube, or for a finest voxel its centre.
    const Vec3 decisive = leaf.size == 1 ? Vec3(Vec3::Zero()) : extent;
    const bool inside = any([&](const Box& box) {
      return ((centre - decisive).array() >= box.min.array()).all() &&
             ((centre + decisive).array() <= box.max.array()).all();
    });
    if (inside) {
      remaining_.excluded_voxels += std::uint64_t{leaf.size} * leaf.size * leaf.size;
    } else if (leaf.size == 1 || parts_ + 8 > MAX_ADDED_LEAVES) {
      remaining_.leaves.push_back(leaf);
    } else {
      split(leaf);
    }
  }

  void reserve(std::size_t leaves) { remaining_.leaves.reserve(leaves); }
  RemainingLeaves take() { return std::move(remaining_); }

 private:
  void split(const OccupiedLeaf& leaf) {
    parts_ += 8;
    const std::size_t first = remaining_.leaves.size();
    const std::uint64_t before = remaining_.excluded_voxels;
    for (const OccupiedLeaf& part : eighthsOf(leaf)) add(part);
    if (remaining_.excluded_voxels > before) return;
    remaining_.leaves.resize(first);
    remaining_.leaves.push_back(leaf);
  }

  double resolution_m_;
  Eigen::Isometry3d fixed_from_map_;
  Vec3 extent_;  // half of the box around a turned cube, whose own half edge is 1
  const std::vector<Box>& boxes_;
  RemainingLeaves remaining_;
  std::size_t parts_ = 0;
};

}  // namespace

RemainingLeaves leavesOutside(const std::vector<OccupiedLeaf>& leaves, double resolution_m,
                              const Eigen::Isometry3d& fixed_from_map, const std::vector<Box>& boxes) {
  Splitter splitter(resolution_m, fixed_from_map, boxes);
  splitter.reserve(leaves.size() + MAX_ADDED_LEAVES);  // a list that grows would take three times as much
  for (const OccupiedLeaf& leaf : leaves) splitter.add(leaf);
  return splitter.take();
}

}  // namespace dccd
