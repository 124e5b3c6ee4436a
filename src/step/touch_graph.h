// Which touches belong together: connected sets by the meshes' edges and the map's leaves (doc/algorithm.md,
// "Patches").
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <tuple>
#include <vector>

#include "dccd/body.h"
#include "dccd/contact.h"
#include "dccd/outcome.h"

namespace dccd {

/// A contact, or an edge through a face, as the graph looks at it. Vertices are numbered through all bodies.
struct Touch {
  static constexpr std::uint8_t CROSSING = 5;  ///< beside the values of PairKind

  std::array<Index, 5> point{NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX};  ///< the leaf's key is in the last two
  std::array<std::uint16_t, 2> body{0, 0};
  std::uint8_t kind = CROSSING;
  std::uint8_t level = 0;  ///< the leaf's edge is 2^level finest voxels
  bool initial = false;
  bool certain = true;
  bool expected = false;

  bool onMap() const { return body[1] == OBSTACLE_BODY; }
  VoxelKey voxel() const {
    return {static_cast<std::uint16_t>(point[3] >> 16), static_cast<std::uint16_t>(point[3]),
            static_cast<std::uint16_t>(point[4])};
  }
  auto key() const { return std::tie(kind, body, point, level); }
};

/// A leaf by its key and size.
struct Leaf {
  VoxelKey min;
  std::uint32_t size = 1;
};

/// Buffers are kept from run to run, and what the meshes look like as long as they stay. Not thread-safe.
class TouchGraph {
 public:
  void setBodies(const std::vector<Body>& bodies);
  Index firstVertex(std::size_t body) const { return vertex_begin_[body]; }
  std::size_t bodyCount() const { return topologies_.size(); }
  bool sameMesh(std::size_t body, const Body& now) const;

  Touch touchOf(const Contact& contact) const;
  Touch touchOf(const StartIntersection& crossing) const;

  /// Per touch its component, numbered in the order of their first touches. The touches, whose order is by key(), are
  /// looked at again by the functions below.
  const std::vector<std::uint32_t>& components(const std::vector<Touch>& touches);
  const std::vector<std::uint32_t>& lastComponents() const { return component_; }
  std::uint32_t componentCount() const { return component_count_; }

  // Of the last run. Points are vertices, then leaves.
  std::size_t vertexCount() const { return vertex_begin_.back(); }
  std::size_t pointCount() const { return vertexCount() + leaves_.size(); }
  Leaf leaf(std::size_t point) const;
  /// Calls with the touches at the point, ascending.
  template <class Function>
  void forTouchesAt(std::size_t point, const Function& function) const {
    for (std::uint32_t i = begin_[point]; i < begin_[point + 1]; ++i) function(entries_[i] >> 1);
  }
  bool isTouched(std::size_t point) const { return begin_[point] < begin_[point + 1]; }

 private:
  struct Span {
    const Index *first, *last;
    const Index* begin() const { return first; }
    const Index* end() const { return last; }
    std::size_t size() const { return static_cast<std::size_t>(last - first); }
  };
  struct Mark {
    std::uint32_t tag = 0, set = 0;
  };
  struct Set {
    std::uint32_t parent, root;
  };

  Span side(std::uint32_t touch, int side) const;
  Span neighbours(Index vertex) const;
  std::uint32_t root(std::uint32_t touch);
  void join(std::uint32_t a, std::uint32_t b);
  void beginRun();
  void numberLeaves();
  void listByPoint();
  void beginPlace();
  std::uint32_t setOf(std::uint32_t touch);
  void joinSets(std::uint32_t a, std::uint32_t b);
  void endPlace();
  void mark(Index point, std::uint32_t set);
  void joinMarked();
  void joinOnMap();
  void joinAtVertex(Index vertex);

  std::vector<std::shared_ptr<const Topology>> topologies_;
  std::vector<Index> vertex_begin_{0};
  std::vector<std::uint32_t> neighbours_begin_, neighbours_;  // per vertex: the other ends of its edges, ascending

  const std::vector<Touch>* touches_ = nullptr;
  std::vector<std::uint64_t> leaves_;  // keys, ascending: level, x, y, z
  std::vector<Index> leaf_of_;         // per touch with the map, from map_begin_ on: its leaf as a point
  std::uint32_t map_begin_ = 0, map_end_ = 0;
  std::vector<std::uint32_t> begin_, entries_;  // by point: touch << 1 | the side that the point is on
  std::vector<std::uint32_t> parent_;
  // Of one place, with its tag: sets of touches that meet there, and where they are on the other side.
  std::vector<Mark> marks_, seen_;  // per point; per root
  std::vector<Set> sets_;
  std::vector<std::array<std::uint32_t, 2>> at_place_;  // entry, set
  std::vector<Index> marked_;
  std::uint32_t tag_ = 0;
  std::vector<std::uint32_t> component_;
  std::uint32_t component_count_ = 0;
};

}  // namespace dccd
