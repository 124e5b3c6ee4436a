#include "dccd/voxel_surface.h"

#include <stdexcept>

#include "base/next_surface.h"
#include "obstacle/resolution.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {

VoxelSurface::Impl::Impl(double resolution, VoxelTree of, std::vector<FeatureMask> exposed)
    : resolution_m(resolution),
      inverse_resolution(1.0 / resolution),
      tree(std::move(of)),
      features(std::move(exposed)) {
  std::array<std::int32_t, 3> lo, hi;
  if (!tree.occupiedKeys(lo, hi)) return;
  for (int axis = 0; axis < 3; ++axis) {
    bounds.min[axis] = voxelPlane(lo[axis], resolution_m);
    bounds.max[axis] = voxelPlane(hi[axis], resolution_m);
  }
}

KeyBox VoxelSurface::Impl::keysOf(const double* lo, const double* hi) const {
  KeyBox box;
  for (int axis = 0; axis < 3; ++axis) {
    box.lo[axis] = outwardKey(lo[axis], inverse_resolution, -1);
    box.hi[axis] = outwardKey(hi[axis], inverse_resolution, +1);
  }
  return box;
}

std::shared_ptr<const VoxelSurface> VoxelSurface::build(double resolution_m, std::vector<OccupiedLeaf> leaves) {
  if (!isResolution(resolution_m)) throw std::invalid_argument(noResolution("resolution_m", resolution_m));
  VoxelTree tree(leaves);
  std::vector<FeatureMask> features = exposedFeatures(tree);
  return std::make_shared<const VoxelSurface>(
      std::make_unique<Impl>(resolution_m, std::move(tree), std::move(features)));
}

std::shared_ptr<const VoxelSurface> nextSurface(double resolution_m, std::vector<OccupiedLeaf> leaves,
                                                const VoxelSurface& before) {
  // Where voxels have another size little is in common, whatever the keys say.
  if (resolution_m != before.resolution()) return VoxelSurface::build(resolution_m, std::move(leaves));
  VoxelTree::Change change;
  auto tree = VoxelTree::following(leaves, VoxelSurface::Impl::of(before).tree, change);
  if (!tree) return VoxelSurface::build(resolution_m, std::move(leaves));
  std::vector<FeatureMask> features =
      exposedFeatures(*tree, VoxelSurface::Impl::of(before).tree, VoxelSurface::Impl::of(before).features, change);
  return std::make_shared<const VoxelSurface>(
      std::make_unique<VoxelSurface::Impl>(resolution_m, std::move(*tree), std::move(features)));
}

VoxelSurface::VoxelSurface(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
VoxelSurface::~VoxelSurface() = default;

double VoxelSurface::resolution() const { return impl_->resolution_m; }
std::size_t VoxelSurface::leafCount() const { return impl_->features.size(); }
std::size_t VoxelSurface::memoryBytes() const {
  return sizeof(Impl) + impl_->tree.memoryBytes() + impl_->features.capacity() * sizeof(FeatureMask);
}
const Box& VoxelSurface::bounds() const { return impl_->bounds; }
const std::vector<OccupiedLeaf>& VoxelSurface::leaves() const { return impl_->tree.leaves(); }

const OccupiedLeaf* VoxelSurface::leafAt(const Vec3& point_map) const {
  const OccupiedLeaf* found = nullptr;
  if (!point_map.allFinite()) return found;
  impl_->tree.visitLeaves(impl_->keysOf(point_map.data(), point_map.data()), [&](std::uint32_t index) {
    const OccupiedLeaf& leaf = impl_->tree.leaves()[index];
    const LeafBox box = leafBox(leaf, impl_->resolution_m);
    for (int axis = 0; axis < 3; ++axis) {
      if (point_map[axis] < box.lo[axis] || point_map[axis] > box.hi[axis]) return true;
    }
    if (found == nullptr || leaf.min < found->min) found = &leaf;
    return true;
  });
  return found;
}

}  // namespace dccd
