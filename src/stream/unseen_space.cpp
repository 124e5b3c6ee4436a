#include "stream/unseen_space.h"

#include <algorithm>
#include <utility>

#include "dccd/tolerances.h"
#include "obstacle/leaf_sets.h"

namespace dccd {
namespace {

bool meetsAny(const OccupiedLeaf& cube, const std::vector<KeyBox>& boxes) {
  return std::any_of(boxes.begin(), boxes.end(), [&](const KeyBox& box) { return meets(cube, box); });
}

/// Calls visit(part) for the parts of a cube that lie in the boxes, as large ones as there are.
template <class Visit>
void visitInside(const OccupiedLeaf& cube, const std::vector<KeyBox>& boxes, const Visit& visit) {
  if (!meetsAny(cube, boxes)) return;
  const auto holds = [&](const KeyBox& box) { return isInside(cube, box); };
  if (cube.size == 1 || std::any_of(boxes.begin(), boxes.end(), holds)) return visit(cube);
  for (const OccupiedLeaf& part : eighthsOf(cube)) visitInside(part, boxes, visit);
}

}  // namespace

bool MapChange::isFree(const OccupiedLeaf& part) const {
  return !known || coverage(*known, part) == VoxelTree::Coverage::FULL;
}

bool UnseenSpace::holds(const OccupiedLeaf& voxel) {
  if (cubes_.empty()) return false;
  if (!tree_) tree_.emplace(cubes_);
  return coverage(*tree_, voxel) == VoxelTree::Coverage::FULL;
}

std::vector<OccupiedLeaf> UnseenSpace::firstFree(const MapChange& change, const std::vector<KeyBox>& of_bodies,
                                                 bool may_be_near) {
  const std::vector<KeyBox> boxes = may_be_near ? std::vector<KeyBox>{ALL_KEYS} : of_bodies;
  std::vector<OccupiedLeaf> fresh;
  // One without anything free tells nothing of who looked: what it leaves out is free.
  if (!change.known || boxes.empty() || (change.has_before && !change.known_before)) return fresh;
  const VoxelTree nothing{std::vector<OccupiedLeaf>()};
  const auto takeFree = [&](const OccupiedLeaf& part) {
    visitUncovered(change.now, part, [&](const OccupiedLeaf& cube) {
      visitInside(cube, boxes, [&](const OccupiedLeaf& inside) {
        if (cubes_.empty()) return fresh.push_back(inside);
        if (!tree_) tree_.emplace(cubes_);
        visitUncovered(*tree_, inside, [&](const OccupiedLeaf& left) { fresh.push_back(left); });
      });
    });
  };
  KeyBox all = boxes.front();
  for (const KeyBox& box : boxes) extend(all, box);
  visitDifference(*change.known, change.known_before ? *change.known_before : nothing, takeFree, all);
  return fresh;
}

std::vector<OccupiedLeaf> UnseenSpace::ask(const MapChange& change, const std::vector<KeyBox>& of_bodies,
                                           bool may_be_near, std::vector<OccupiedLeaf> unseen) {
  next_.clear();
  for (const OccupiedLeaf& cube : cubes_) {
    visitUncovered(change.now, cube, [&](const OccupiedLeaf& part) {
      if (may_be_near || meetsAny(part, of_bodies)) unseen.push_back(part);
    });
  }
  const std::size_t asked = may_be_near ? 0 : std::min(unseen.size(), tolerance::OWN_UNKNOWN_ASKED);
  asked_ = asked;
  const auto rest = unseen.begin() + static_cast<std::ptrdiff_t>(asked);
  next_.assign(rest, unseen.end());
  unseen.erase(rest, unseen.end());
  return unseen;
}

std::vector<OccupiedLeaf> UnseenSpace::settle(const std::vector<ReachedCube>& searched) {
  std::vector<OccupiedLeaf> asked;
  for (const ReachedCube& cube : searched) {
    if (cube.near.empty()) continue;
    if (cube.leaf.size == 1 || asked_ >= tolerance::OWN_UNKNOWN_ASKED) {
      next_.push_back(cube.leaf);
      continue;
    }
    for (const OccupiedLeaf& part : eighthsOf(cube.leaf)) asked.push_back(part);
    asked_ += 8;
  }
  return asked;
}

void UnseenSpace::keep() {
  tree_.reset();
  cubes_.swap(next_);
}

}  // namespace dccd
