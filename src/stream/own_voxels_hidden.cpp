// What maps leave out, where the unknown is an obstacle: of it bodies hide what was FREE when they came.
#include <algorithm>

#include "dccd/tolerances.h"
#include "obstacle/known_space_impl.h"
#include "obstacle/leaf_sets.h"
#include "obstacle/voxel_surface_impl.h"
#include "stream/own_voxels_look.h"

namespace dccd {
namespace {

VoxelTree treeOf(const std::unordered_map<std::uint64_t, std::uint16_t>& hidden) {
  std::vector<OccupiedLeaf> leaves;
  for (const auto& [key, body] : hidden) leaves.push_back({unpacked(key), 1});
  return VoxelTree(leaves);
}

}  // namespace

/// What was hidden, and what was FREE for the last map and is left out by this one.
void OwnVoxelFinder::listHidden(Look& look) {
  if (!look.map.unknown || !look.change.known_before || !look.change.known) return;
  const std::size_t most = look.cubes.size() + tolerance::MOST_OWN_ASKED;
  const VoxelTree remembered(remembered_);
  auto askFree = [&](const OccupiedLeaf& voxel) {
    const bool was_free = stated_.count(packed(voxel.min)) == 0 && !unseen_.holds(voxel) && !wasSeenAgain(voxel);
    if (was_free && look.cubes.size() < most) look.ask(voxel, ReachedCube::Why::HIDDEN);
  };
  const auto takeFree = [&](const OccupiedLeaf& part) {
    visitUncovered(look.change.before, part, [&](const OccupiedLeaf& free) {
      visitUncovered(remembered, free, [&](const OccupiedLeaf& left) { visitVoxels(left, look.region, askFree); });
    });
  };
  visitDifference(*look.change.known_before, *look.change.known, takeFree, look.region);
  for (const auto& [key, body] : hidden_free_) {
    const OccupiedLeaf voxel{unpacked(key), 1};
    if (coverage(*look.change.known, voxel) != VoxelTree::Coverage::FULL) askFree(voxel);
  }
}

void OwnVoxelFinder::hide(const ReachedCube& cube, Look& look) const {
  BodySet owners = look.ownersOf(cube);
  owners.removeIf([&](int body) { return look.not_yet.count(body) > 0; });
  if (!owners.empty()) look.hidden_free[packed(cube.leaf.min)] = *owners.begin();
}

std::vector<OccupiedLeaf> OwnVoxelFinder::withoutHidden(const std::vector<OccupiedLeaf>& cubes) const {
  const VoxelTree hidden = treeOf(hidden_free_);
  std::vector<OccupiedLeaf> left;
  for (const OccupiedLeaf& cube : cubes) {
    visitUncovered(hidden, cube, [&](const OccupiedLeaf& part) { left.push_back(part); });
  }
  return left;
}

std::vector<OccupiedLeaf> OwnVoxelFinder::unknownObstacles(const ObstacleMap& map, const VoxelTree& sure,
                                                           std::vector<OwnVoxel>& voxels) const {
  std::vector<OccupiedLeaf> obstacles;
  if (!map.unknown) return obstacles;
  const VoxelTree& unknown = KnownSpace::Impl::treeOf(*map.unknown);
  HiddenFree hidden = hidden_free_;
  for (const auto& [key, voxel] : stated_) {
    if (!voxel.shown && voxel.state == VoxelState::OWN) hidden[key] = *voxel.owners.begin();
  }
  for (const auto& [key, body] : hidden) {
    const OccupiedLeaf leaf{unpacked(key), 1};
    const bool is_unknown = coverage(unknown, leaf) == VoxelTree::Coverage::FULL;
    if (is_unknown && coverage(sure, leaf) != VoxelTree::Coverage::FULL) voxels.push_back({leaf.min, body, false});
  }
  const VoxelTree left_out = treeOf(hidden);
  for (const OccupiedLeaf& cube : unknown.leaves()) {
    visitUncovered(left_out, cube, [&](const OccupiedLeaf& part) {
      visitUncovered(sure, part, [&](const OccupiedLeaf& left) { obstacles.push_back(left); });
    });
  }
  return obstacles;
}

}  // namespace dccd
