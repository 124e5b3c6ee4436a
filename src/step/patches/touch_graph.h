// Which touches belong together: those between the same two areas of the meshes (doc/algorithm.md, "Patches").
#pragma once

#include <array>
#include <cstdint>
#include <iterator>
#include <memory>
#include <tuple>
#include <unordered_map>
#include <vector>

#include "dccd/body.h"
#include "dccd/contact.h"
#include "dccd/outcome.h"

namespace dccd {

/// A contact, or an edge through a face, as the graph looks at it. Vertices are numbered through all bodies.
struct Touch {
  // Kinds beside the values of PairKind, and the vertices of their sides.
  static constexpr std::uint8_t CROSSING = std::size(PAIR_KINDS);
  static constexpr std::uint8_t VERTICES = CROSSING + 1;  ///< one of each side, of something that touched
  static constexpr std::array<std::uint8_t, 2> MORE_SIZES[] = {{2, 3}, {1, 1}};

  std::array<Index, 5> point{NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX};  ///< the leaf's key is in the last two
  std::array<std::uint16_t, 2> body{0, 0};
  std::uint8_t kind = CROSSING;
  std::uint8_t level = 0;  ///< the leaf's edge is 2^level finest voxels
  bool initial = false;
  bool certain = true;
  bool expected = false;

  /// How many vertices are on its sides; a leaf has none.
  int firstSize() const { return sizes()[0]; }
  int secondSize() const { return sizes()[1]; }
  int size() const { return firstSize() + secondSize(); }
  const std::array<std::uint8_t, 2>& sizes() const {
    return kind < CROSSING ? PAIR_KINDS[kind].vertices : MORE_SIZES[kind - CROSSING];
  }
  bool onMap() const { return body[1] == OBSTACLE_BODY; }
  VoxelKey voxel() const {
    return {static_cast<std::uint16_t>(point[3] >> 16), static_cast<std::uint16_t>(point[3]),
            static_cast<std::uint16_t>(point[4])};
  }
  auto key() const { return std::tie(kind, body, point, level); }
};

/// Buffers are kept from run to run, and what the meshes look like as long as they stay. Not thread-safe.
class TouchGraph {
 public:
  void setBodies(const std::vector<Body>& bodies);
  Index firstVertex(std::size_t body) const { return vertex_begin_[body]; }
  std::size_t vertexCount() const { return vertex_begin_.empty() ? 0 : vertex_begin_.back(); }
  std::size_t bodyCount() const { return topologies_.size(); }
  bool sameMesh(std::size_t body, const Body& now) const;

  Touch touchOf(const Contact& contact) const;
  Touch touchOf(const StartIntersection& crossing) const;

  /// Per touch the patch that it belongs to, numbered in the order of their first touches. They may come in any order;
  /// those of one kind and the same bodies should lie together.
  const std::vector<std::uint32_t>& components(const std::vector<Touch>& touches);
  std::uint32_t componentCount() const { return component_count_; }

 private:
  /// Touches that lie together: of one kind and the same two bodies.
  struct Group {
    std::array<std::uint16_t, 2> partners;  // the bodies, ascending
    std::uint32_t first, last;
  };

  void findGroups(const std::vector<Touch>& touches);
  void findAreas(const std::vector<Touch>& touches, const Group* first, const Group* last);
  void findAreasOf(std::size_t body);
  Index areaRoot(Index vertex);
  void nameComponents(const std::vector<Touch>& touches, const Group* first, const Group* last);

  std::vector<std::shared_ptr<const Topology>> topologies_;
  std::vector<Index> vertex_begin_;                           // per body, and where the last one ends
  std::vector<std::uint32_t> neighbours_begin_, neighbours_;  // per vertex: the other ends of its edges, ascending

  std::vector<Group> groups_;  // by partners
  // Of the same two partners.
  std::vector<std::uint8_t> is_touched_;  // per vertex; between two runs none is
  std::vector<Index> area_;               // per touched vertex, one of its area: in the end the first of them
  std::unordered_map<std::uint64_t, std::uint32_t> by_areas_;
  std::vector<std::uint32_t> component_, number_;
  std::uint32_t component_count_ = 0;
};

}  // namespace dccd
