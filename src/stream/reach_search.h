// Which cubes of a map's space bodies came near to on their ways.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "dccd/mesh_store.h"
#include "obstacle/voxel_surface_impl.h"
#include "stream/rigid_shape.h"

namespace dccd {

/// Bodies by number, in the order in which they were added. Of more than MOST the others are left out.
class BodySet {
 public:
  static constexpr std::size_t MOST = 8;
  const std::uint16_t* begin() const { return bodies_.data(); }
  const std::uint16_t* end() const { return bodies_.data() + count_; }
  bool empty() const { return count_ == 0; }
  bool has(std::uint16_t body) const { return std::find(begin(), end(), body) != end(); }
  void add(std::uint16_t body) {
    if (count_ < MOST && !has(body)) bodies_[count_++] = body;
  }
  template <class Test>
  void removeIf(const Test& test) {
    const auto last = std::remove_if(bodies_.begin(), bodies_.begin() + count_, test);
    count_ = static_cast<std::uint8_t>(last - bodies_.begin());
  }

 private:
  std::array<std::uint16_t, MOST> bodies_{};
  std::uint8_t count_ = 0;
};

/// A body whose frames tell where it was, and how far from its surface a voxel may be its own.
struct TrackedBody {
  std::uint16_t body = 0;
  std::string name;
  double reach_m = 0;  ///< Body::own_voxels_m
  const MeshStore* frames = nullptr;
  bool holds_always = false;  ///< static: its newest frame, at all stamps
  bool shell = false;         ///< Body::shell: what is inside is not in it
  bool is_link = false;       ///< Body::link is one
  BodySet held{};             ///< what it holds, or is held by

  static constexpr std::uint16_t LINKS = 0xfffe;
  /// All links of a robot are one.
  std::uint16_t group() const { return is_link ? LINKS : body; }
};

using BodyWay = std::vector<MeshStore::Stretch>;

/// A cube, why it is asked for, and the bodies that reach it.
struct ReachedCube {
  enum class Why : std::uint8_t { APPEARED, VANISHED, REMEMBERED, STATED, SEEN };
  OccupiedLeaf leaf;
  Why why;
  LeafBox box;
  BodySet asked{};   ///< of these bodies and groups alone; empty: of all
  BodySet near{};    ///< within reach at some time; of a cube that did not appear the first one that was found will do
  BodySet always{};  ///< at each place that was asked for
};

/// Sets who is near. A cube counts as reached only where a point of a body's surface at some time of its way, and a
/// point of the cube, are seen to be within reach_m: the answer may miss a reach at the very rim, and invents none. So
/// does a cube whose middle is inside of a closed rigid body that is no shell. `shapes`: of rigid bodies, to be kept
/// from one map to the next; the answer is the same without them (null), and takes longer. `whole_way`: `always` is
/// asked for as well, which takes longer, too.
void searchReach(const std::vector<TrackedBody>& bodies, const std::vector<BodyWay>& ways,
                 const Eigen::Isometry3d& map_from_fixed, double resolution_m, std::vector<ReachedCube>& cubes,
                 RigidShapes* shapes, bool whole_way = false);

}  // namespace dccd
