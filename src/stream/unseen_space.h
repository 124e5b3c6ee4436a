// What is free in a map beside bodies, and was never seen so while none of them was near: VoxelState::UNKNOWN of voxels
// that a map tells of.
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "obstacle/voxel_tree.h"
#include "stream/reach_search.h"

namespace dccd {

/// What a map shows, and what the one before it did.
struct MapChange {
  const VoxelTree &now, &before;
  const VoxelTree *known, *known_before;  ///< null: all that is not occupied is free
  bool has_before;                        ///< else nothing was known

  /// Whether all of what is not occupied is free.
  bool isFree(const OccupiedLeaf& part) const;
};

/// Not thread-safe.
class UnseenSpace {
 public:
  std::size_t size() const { return cubes_.size(); }
  /// As of the map before, from ask() up to keep(), too.
  bool holds(const OccupiedLeaf& voxel);

  /// What the map shows as free within the boxes of bodies, and the one before did not. Of what it does not show
  /// nothing is held.
  std::vector<OccupiedLeaf> firstFree(const MapChange& change, const std::vector<KeyBox>& of_bodies, bool may_be_near);
  /// Takes what is unseen from now on, and gives what is to be searched for: in each map so many, in turn. may_be_near:
  /// some body may be anywhere, and nothing is seen free without one.
  std::vector<OccupiedLeaf> ask(const MapChange& change, const std::vector<KeyBox>& of_bodies, bool may_be_near,
                                std::vector<OccupiedLeaf> unseen);
  /// Once that is done: what no body reaches was seen free. Gives what is to be searched for next.
  std::vector<OccupiedLeaf> settle(const std::vector<ReachedCube>& searched);
  /// What was found holds from now on.
  void keep();

 private:
  std::vector<OccupiedLeaf> cubes_, next_;  // of them the first is the next in turn
  std::optional<VoxelTree> tree_;           // of cubes_
  std::size_t asked_ = 0;
};

}  // namespace dccd
