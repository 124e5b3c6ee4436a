#include "dccd/known_space.h"

#include <algorithm>
#include <stdexcept>
#include <string>
#include <utility>

#include "obstacle/known_space_impl.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/resolution.h"
#include "obstacle/voxel_surface_impl.h"

namespace dccd {
namespace {

using Coverage = VoxelTree::Coverage;

/// The voxels whose closed boxes meet a closed region, exactly: the outward rounded keys, corrected by the planes.
/// False where the region lies outside of the map's range.
bool touchedKeys(const Box& region_m, double resolution_m, KeyBox& keys) {
  const double inverse = 1.0 / resolution_m;
  for (int axis = 0; axis < 3; ++axis) {
    const double lo = region_m.min[axis], hi = region_m.max[axis];
    if (hi < voxelPlane(0, resolution_m) || lo > voxelPlane(VoxelTree::KEYS, resolution_m)) return false;
    keys.lo[axis] = outwardKey(lo, inverse, -1);
    keys.hi[axis] = outwardKey(hi, inverse, +1);
    while (keys.lo[axis] < keys.hi[axis] && voxelPlane(keys.lo[axis] + 1, resolution_m) < lo) ++keys.lo[axis];
    while (keys.hi[axis] > keys.lo[axis] && voxelPlane(keys.hi[axis], resolution_m) > hi) --keys.hi[axis];
  }
  return true;
}

/// Calls visit(cube) for the largest aligned cubes of unknown voxels in the key box, until it returns false.
template <class Visit>
bool visitUnknown(const VoxelTree& tree, const OccupiedLeaf& cube, const KeyBox& keys, Visit& visit) {
  if (!meets(cube, keys)) return true;
  const Coverage covered = coverage(tree, cube);
  if (covered == Coverage::FULL) return true;
  if (covered == Coverage::EMPTY && isInside(cube, keys)) return visit(cube);
  const std::array<OccupiedLeaf, 8> parts = eighthsOf(cube);
  return std::all_of(parts.begin(), parts.end(),
                     [&](const OccupiedLeaf& part) { return visitUnknown(tree, part, keys, visit); });
}

constexpr OccupiedLeaf WHOLE_MAP{{0, 0, 0}, VoxelTree::KEYS};

}  // namespace

std::shared_ptr<const KnownSpace> KnownSpace::build(double resolution_m,
                                                    const std::vector<OccupiedLeaf>& known_leaves) {
  if (!isResolution(resolution_m)) throw std::invalid_argument(noResolution("resolution_m", resolution_m));
  return std::shared_ptr<const KnownSpace>(new KnownSpace(std::make_unique<Impl>(resolution_m, known_leaves)));
}

std::shared_ptr<const KnownSpace> KnownSpace::build(double resolution_m, const std::vector<OccupiedLeaf>& known_leaves,
                                                    std::vector<OccupiedLeaf> found) {
  const std::shared_ptr<const KnownSpace> known = build(resolution_m, known_leaves);
  known->impl_->found = std::move(found);
  return known;
}

const std::vector<OccupiedLeaf>* KnownSpace::found() const { return impl_->found ? &*impl_->found : nullptr; }

KnownSpace::KnownSpace(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
KnownSpace::~KnownSpace() = default;

double KnownSpace::resolution() const { return impl_->resolution_m; }
std::size_t KnownSpace::memoryBytes() const {
  return sizeof(Impl) + impl_->tree.memoryBytes() +
         (impl_->found ? impl_->found->capacity() * sizeof(OccupiedLeaf) : 0);
}

bool KnownSpace::isKnown(const Box& region_m) const {
  if (region_m.empty()) return true;
  for (int axis = 0; axis < 3; ++axis) {
    if (region_m.min[axis] < voxelPlane(0, impl_->resolution_m)) return false;
    if (region_m.max[axis] > voxelPlane(VoxelTree::KEYS, impl_->resolution_m)) return false;
  }
  KeyBox keys;
  if (!touchedKeys(region_m, impl_->resolution_m, keys)) return false;
  const auto stop = [](const OccupiedLeaf&) { return false; };
  return visitUnknown(impl_->tree, WHOLE_MAP, keys, stop);
}

std::vector<OccupiedLeaf> KnownSpace::unknownLeaves(const Box& crop_m, std::size_t max_leaves) const {
  std::vector<OccupiedLeaf> leaves;
  if (crop_m.empty()) return leaves;
  if (!crop_m.min.allFinite() || !crop_m.max.allFinite()) {
    throw std::invalid_argument("crop_m has corners that are not finite");
  }
  KeyBox keys;
  if (!touchedKeys(crop_m, impl_->resolution_m, keys)) return leaves;
  const auto keep = [&](const OccupiedLeaf& cube) {
    if (leaves.size() == max_leaves) return false;
    leaves.push_back(cube);
    return true;
  };
  if (!visitUnknown(impl_->tree, WHOLE_MAP, keys, keep)) {
    throw std::length_error("the unknown space of the crop box has more leaves than the limit of " +
                            std::to_string(max_leaves) + "; make the box smaller");
  }
  return leaves;
}

}  // namespace dccd
