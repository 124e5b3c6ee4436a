// Which touches belong together: those between the same two areas of the meshes (doc/algorithm.md, "Patches").
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <type_traits>
#include <unordered_map>
#include <vector>

#include "dccd/body.h"
#include "dccd/contact.h"
#include "dccd/outcome.h"

namespace dccd {

/// Touches that come one after the other, of one kind and the same two bodies.
struct TouchGroup {
  std::array<std::uint16_t, 2> body{0, 0};
  std::array<std::uint8_t, 2> sizes{0, 0};  ///< vertices on each side; none of the map's
  std::uint32_t first = 0, last = 0;        ///< its touches, as the graph numbers them
  std::size_t vertices = 0;                 ///< where those of its first touch are

  int size() const { return sizes[0] + sizes[1]; }
  bool onMap() const { return body[1] == OBSTACLE_BODY; }
  std::array<std::uint16_t, 2> partners() const { return {std::min(body[0], body[1]), std::max(body[0], body[1])}; }
};

/// Calls f(size) with the number as a constant, for a group's number of vertices.
template <class F>
void withSize(int size, const F& f) {
  if (size == 1) f(std::integral_constant<int, 1>());
  if (size == 2) f(std::integral_constant<int, 2>());
  if (size == 3) f(std::integral_constant<int, 3>());
  if (size == 4) f(std::integral_constant<int, 4>());
  if (size == 5) f(std::integral_constant<int, 5>());
}

/// Buffers are kept from run to run, and what the meshes look like as long as they stay. Not thread-safe.
class TouchGraph {
 public:
  /// Calls f(first, last) over [0, n), in pieces of about a size, side by side or not.
  using Parallel =
      std::function<void(std::size_t n, std::size_t piece, const std::function<void(std::size_t, std::size_t)>& f)>;
  static void oneByOne(std::size_t n, std::size_t, const std::function<void(std::size_t, std::size_t)>& f) { f(0, n); }

  /// A vertex that touches something, and one of the other side; numbered through all bodies.
  struct Spot {
    std::array<Index, 2> vertex{NO_INDEX, NO_INDEX};  ///< [1]: NO_INDEX with the map
    std::array<std::uint16_t, 2> body{0, 0};          ///< partners, ascending; [1] may be OBSTACLE_BODY
    bool expected = false;
  };

  void setBodies(const std::vector<Body>& bodies);
  Index firstVertex(std::size_t body) const { return vertex_begin_[body]; }
  std::size_t vertexCount() const { return vertex_begin_.empty() ? 0 : vertex_begin_.back(); }
  std::size_t bodyCount() const { return topologies_.size(); }
  bool sameMesh(std::size_t body, const Body& now) const;

  /// Forgets all touches.
  void clear();
  /// Numbered on from those before. T: Contact, in canonical order; StartIntersection or Spot in any, but those of the
  /// same bodies should lie together.
  template <class T>
  void add(const T* first, const T* last, const Parallel& parallel = oneByOne);
  /// Finds to which patch each belongs. Patches are numbered in the order of their first touches.
  void findPatches(const Parallel& parallel = oneByOne);

  std::uint32_t touchCount() const { return touch_count_; }
  std::uint32_t patchCount() const { return patch_count_; }
  const std::vector<TouchGroup>& groups() const { return groups_; }
  bool isExpected(std::uint32_t touch) const { return expected_[touch]; }
  /// group.size() of them, those of the first side first, numbered through all bodies.
  const Index* verticesOf(const TouchGroup& group, std::uint32_t touch) const {
    return vertices_.data() + group.vertices + (touch - group.first) * static_cast<std::size_t>(group.size());
  }
  /// Calls f(group, first, last, patch) for all touches in their order, as many at once as may be.
  template <class F>
  void forEach(const F& f) const {
    for (std::size_t g = 0; g < groups_.size(); ++g) {
      const auto [begin, end] = runs_of_[g];
      for (std::size_t r = begin; r < end; ++r) {
        const std::uint32_t last = r + 1 < end ? runs_[r + 1].first : groups_[g].last;
        f(groups_[g], runs_[r].first, last, number_[runs_[r].component]);
      }
    }
  }

 private:
  /// Touches of one component, up to the first one of the next run.
  struct Run {
    std::uint32_t first, component;
  };
  /// The first touch of those of one group that come one after the other and are between the same two areas.
  struct Change {
    std::uint32_t first;
    std::array<Index, 2> areas;  // ascending
  };

  template <class T>
  void take(const TouchGroup& group, std::uint32_t first, std::uint32_t last, const T* touch);
  void findAreas(std::size_t first, std::size_t last);
  void findAreasOf(std::size_t body);
  Index areaRoot(Index vertex);
  void nameComponents(std::size_t first, std::size_t last, const Parallel& parallel);
  void findChanges(const TouchGroup& group, std::uint32_t first, std::uint32_t last,
                   std::vector<Change>& changes) const;

  std::vector<std::shared_ptr<const Topology>> topologies_;
  std::vector<Index> vertex_begin_;                           // per body, and where the last one ends
  std::vector<std::uint32_t> neighbours_begin_, neighbours_;  // per vertex: the smaller ends of its edges

  std::vector<TouchGroup> groups_;
  std::vector<Index> vertices_;         // more than are used
  std::vector<std::uint8_t> expected_;  // per touch, and more
  std::size_t vertices_used_ = 0;
  std::uint32_t touch_count_ = 0, component_count_ = 0, patch_count_ = 0;
  std::vector<std::uint32_t> by_partners_;  // the groups, those with the first one's partners first
  // Of the same two partners.
  std::vector<std::uint8_t> is_touched_;  // per vertex: of the first group's partners from when they are added
  std::vector<Index> area_;               // per touched vertex, one of its area: in the end the first of them
  std::unordered_map<std::uint64_t, std::uint32_t> by_areas_;
  std::vector<std::vector<Change>> changes_;  // per piece of a group's touches
  std::vector<Run> runs_;
  std::vector<std::array<std::size_t, 2>> runs_of_;  // per group
  std::vector<std::uint32_t> number_;                // per component: its patch
};

}  // namespace dccd
