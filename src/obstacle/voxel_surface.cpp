#include "dccd/voxel_surface.h"

#include <cmath>
#include <stdexcept>
#include <tuple>

#include "obstacle/resolution.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {
namespace {

double checkedResolution(double resolution_m) {
  if (isResolution(resolution_m)) return resolution_m;
  throw std::invalid_argument(noResolution("resolution_m", resolution_m));
}

}  // namespace

VoxelSurface::Impl::Impl(double resolution, const std::vector<OccupiedLeaf>& leaves)
    : resolution_m(checkedResolution(resolution)),
      inverse_resolution(1.0 / resolution),
      tree(leaves),
      features(exposedFeatures(tree)) {
  std::int64_t lo[3] = {VoxelTree::KEYS, VoxelTree::KEYS, VoxelTree::KEYS};
  std::int64_t hi[3] = {0, 0, 0};
  for (std::size_t i = 0; i < features.size(); ++i) {
    const OccupiedLeaf& leaf = tree.leaves()[i];
    const std::int64_t key[3] = {leaf.min.x, leaf.min.y, leaf.min.z};
    for (int axis = 0; axis < 3; ++axis) {
      lo[axis] = std::min(lo[axis], key[axis]);
      hi[axis] = std::max(hi[axis], key[axis] + leaf.size);
    }
  }
  if (features.empty()) return;
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
  return std::make_shared<const VoxelSurface>(std::make_unique<Impl>(resolution_m, leaves));
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
