#include "dccd/known_space.h"

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <string>
#include <utility>

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

/// A block of 4^3 voxels and which of them are touched.
using TouchedBlock = std::pair<std::uint64_t, std::uint64_t>;

std::uint64_t packBlock(std::int32_t x, std::int32_t y, std::int32_t z) {
  return static_cast<std::uint64_t>(x) << 32 | static_cast<std::uint64_t>(y) << 16 | static_cast<std::uint64_t>(z);
}

/// Sorts them, each block once.
void uniteBlocks(std::vector<TouchedBlock>& blocks) {
  std::sort(blocks.begin(), blocks.end());
  std::size_t kept = 0;
  for (std::size_t i = 0; i < blocks.size(); ++i) {
    if (kept > 0 && blocks[kept - 1].first == blocks[i].first) {
      blocks[kept - 1].second |= blocks[i].second;
    } else {
      blocks[kept++] = blocks[i];
    }
  }
  blocks.resize(kept);
}

constexpr std::chrono::nanoseconds BLOCK_TIME(300);  // to sort a block among a million, and to count its voxels
constexpr std::size_t FEATURES_PER_LOOK_AT_THE_CLOCK = 32;

/// How many blocks can be sorted and counted before the deadline.
std::size_t blocksUntil(const Deadline& deadline) {
  const auto left = deadline.at() - Deadline::Clock::now();
  return static_cast<std::size_t>(std::max<std::int64_t>(0, left / BLOCK_TIME));
}

/// Appends the blocks of a key box; false when that makes more than the limit. Neighbours touch the same blocks: up to
/// twice the limit is held before they are united, so that this comes seldom.
bool addBlocks(const KeyBox& keys, std::size_t limit, std::vector<TouchedBlock>& blocks) {
  std::size_t count = 1;
  for (int axis = 0; axis < 3; ++axis) {
    count *= static_cast<std::size_t>((keys.hi[axis] >> 2) - (keys.lo[axis] >> 2) + 1);
  }
  if (count > limit) return false;
  if (count > 2 * limit - blocks.size()) {
    uniteBlocks(blocks);
    if (blocks.size() > limit) return false;
  }
  const auto range = [&keys](int axis, std::int32_t block) {
    const std::int32_t lo = std::max(0, keys.lo[axis] - 4 * block), hi = std::min(3, keys.hi[axis] - 4 * block);
    return RANGE_MASKS[axis][lo][hi];
  };
  for (std::int32_t z = keys.lo[2] >> 2; z <= keys.hi[2] >> 2; ++z) {
    for (std::int32_t y = keys.lo[1] >> 2; y <= keys.hi[1] >> 2; ++y) {
      const std::uint64_t yz = range(1, y) & range(2, z);
      for (std::int32_t x = keys.lo[0] >> 2; x <= keys.hi[0] >> 2; ++x) {
        blocks.emplace_back(packBlock(x, y, z), range(0, x) & yz);
      }
    }
  }
  return true;
}

}  // namespace

struct KnownSpace::Impl {
  Impl(double resolution, const std::vector<OccupiedLeaf>& leaves) : resolution_m(resolution), tree(leaves) {}

  /// The known voxels of a block of 4^3.
  std::uint64_t knownCells(std::int32_t x, std::int32_t y, std::int32_t z) const {
    const std::uint32_t parent = tree.find(1, x >> 2, y >> 2, z >> 2);
    if (parent == VoxelTree::NONE) {
      return tree.coverage(4 * x, 4 * y, 4 * z, 4) == Coverage::FULL ? ~std::uint64_t{0} : 0;
    }
    const VoxelTree::Node& node = tree.nodes(1)[parent];
    const unsigned bit = cellBit(x, y, z);
    if (node.child >> bit & 1) return tree.nodes(0)[node.childAt(bit)].full;
    return node.full >> bit & 1 ? ~std::uint64_t{0} : 0;
  }

  double resolution_m;
  VoxelTree tree;
};

std::shared_ptr<const KnownSpace> KnownSpace::build(double resolution_m,
                                                    const std::vector<OccupiedLeaf>& known_leaves) {
  if (!isResolution(resolution_m)) throw std::invalid_argument(noResolution("resolution_m", resolution_m));
  return std::shared_ptr<const KnownSpace>(new KnownSpace(std::make_unique<Impl>(resolution_m, known_leaves)));
}

KnownSpace::KnownSpace(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
KnownSpace::~KnownSpace() = default;

double KnownSpace::resolution() const { return impl_->resolution_m; }
std::size_t KnownSpace::memoryBytes() const { return sizeof(Impl) + impl_->tree.memoryBytes(); }

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

SweptSpace KnownSpace::sweptSpace(const Topology& topology, const Positions& map_t0, const Positions& map_t1,
                                  const std::uint8_t* vertex_active, std::size_t limit,
                                  const Deadline& deadline) const {
  SweptSpace swept;
  std::vector<TouchedBlock> blocks;
  std::size_t features = 0;
  // addBlocks() may hold twice as many as it is allowed, and all that it holds is sorted and counted in the end.
  const std::size_t most_blocks = deadline.isNever() ? limit : std::min(limit, blocksUntil(deadline) / 2);
  const auto isLate = [&] {
    return deadline.isOver() || (!deadline.isNever() && blocksUntil(deadline) < blocks.size());
  };
  const auto add = [&](const auto& feature) {
    if (swept.complete && features++ % FEATURES_PER_LOOK_AT_THE_CLOCK == 0) swept.complete = !isLate();
    if (!swept.complete) return;
    Box box;
    for (const Index v : feature) {
      if (vertex_active != nullptr && vertex_active[v] == 0) return;
      if (!map_t0[v].allFinite() || !map_t1[v].allFinite()) return;
      box.min = box.min.cwiseMin(map_t0[v]).cwiseMin(map_t1[v]);
      box.max = box.max.cwiseMax(map_t0[v]).cwiseMax(map_t1[v]);
    }
    KeyBox keys;
    if (touchedKeys(box, impl_->resolution_m, keys) && !addBlocks(keys, most_blocks, blocks)) swept.complete = false;
  };
  for (const Face& face : topology.faces()) add(face);
  if (!topology.hasFaces()) {
    for (const Edge& edge : topology.edges()) add(edge);
  }
  swept.complete = swept.complete && !isLate();
  if (!swept.complete) return swept;
  uniteBlocks(blocks);
  swept.complete = blocks.size() <= most_blocks;
  for (const auto& [block, touched] : blocks) {
    const auto at = [packed = block](int shift) { return static_cast<std::int32_t>(packed >> shift & 0xffff); };
    swept.voxels += bitCount(touched);
    swept.unknown += bitCount(touched & ~impl_->knownCells(at(32), at(16), at(0)));
  }
  return swept;
}

}  // namespace dccd
