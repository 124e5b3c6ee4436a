// A part of a step against the map.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "dccd/outcome.h"
#include "dccd/voxel_surface.h"

namespace dccd {

struct Part;
class Looked;

/// `fixed` itself where the frames are the same, else `moved`, filled with the positions in the map's frame [m].
const Positions& inMapFrame(const Eigen::Isometry3d& map_from_fixed, const Positions& fixed, Positions& moved);

/// A step's map without what exclude_boxes leave out.
struct ReducedMap {
  std::shared_ptr<const VoxelSurface> surface;   ///< null: there is none
  std::shared_ptr<const VoxelSurface> measured;  ///< with OwnVoxels::seen, where distances are wanted
  std::uint64_t excluded_voxels = 0;

  /// Made anew where it is another map, or where it lies elsewhere under the boxes, which are the same until clear().
  void set(const ObstacleMap& map, const std::vector<Box>& exclude_boxes, bool is_measured);
  void clear() noexcept;

 private:
  std::shared_ptr<const VoxelSurface> given_;
  std::shared_ptr<const std::vector<OccupiedLeaf>> seen_;
  Eigen::Isometry3d pose_ = Eigen::Isometry3d::Identity();
};

/// The contacts of a body with the map, as long as neither changes.
struct MapAnswer {
  std::shared_ptr<const VoxelSurface> map;  ///< null: none
  Eigen::Matrix4d pose = Eigen::Matrix4d::Identity();
  std::vector<Contact> contacts;
  std::uint64_t pairs = 0;  ///< that were tested
};

class MapSearch {
 public:
  /// Options change, or the bodies but for the first ones.
  void keepBodies(std::size_t count) { checks_.resize(std::min(checks_.size(), count)); }
  /// Adds what the bodies touch; known: of bodies that do not move it is taken from there, and kept there. Where the
  /// deadline ends it, the result is not complete and its bound on what was left out is 0. looked: of which bodies all
  /// was looked at. False: not of all.
  bool run(const Part& part, std::vector<MapAnswer>& known, Looked& looked, Findings& result);

 private:
  bool runBody(const Part& part, std::size_t body, std::vector<MapAnswer>& known, ObstacleStats& total, Looked& looked,
               Findings& result);

  std::vector<std::unique_ptr<ObstacleCheck>> checks_;  // per body, once it came near
  std::vector<std::uint8_t> active_;
  Positions t0_, t1_;
};

}  // namespace dccd
