// A body's features as a tree of boxes for distances: its faces, edges that are on none, and vertices that are on
// neither, of what is not left out. Together they are all of its surface. Double precision, unlike the cluster trees,
// whose bounds are as coarse as the scene is wide.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "culling/scene_arrays.h"
#include "step/clearance/hull_pair.h"
#include "step/clearance/step_box.h"

namespace dccd {

class FeatureTree {
 public:
  using Feature = std::array<Index, 3>;  ///< the body's vertices; the rest NO_INDEX
  static constexpr std::uint32_t LEAF = 4;

  /// Positions guide the order alone; any will do.
  void build(const SceneBody& body, const Positions& positions);
  bool isBuilt() const { return built_; }
  bool empty() const { return features_.empty(); }
  /// Makes the boxes anew. The body's used vertices by their slots; they must live while the tree is used, and those of
  /// its features are finite.
  void refit(const VertexMotion* vertices);

  std::uint32_t root() const { return 0; }
  bool isLeaf(std::uint32_t node) const { return nodes_[node].right == 0; }
  const StepBox& box(std::uint32_t node) const { return boxes_[node]; }
  std::size_t nodeCount() const { return nodes_.size(); }
  /// Of the features of a node, which follow each other.
  std::uint32_t first(std::uint32_t node) const { return nodes_[node].first; }
  std::uint32_t count(std::uint32_t node) const { return nodes_[node].count; }
  /// Calls f(child) for each of a node's two children.
  template <class F>
  void forChildren(std::uint32_t node, F&& f) const {
    f(node + 1);
    f(nodes_[node].right);
  }
  /// Calls f(vertex) for each corner of a leaf's features.
  template <class F>
  void forCorners(std::uint32_t leaf, F&& f) const {
    for (std::size_t i = nodes_[leaf].vertices; i < nodes_[leaf].vertices_end; ++i) f(vertices_[leaf_slots_[i]]);
  }
  template <class F>
  void forItemCorners(std::uint32_t feature, F&& f) const {
    for (const Index slot : slots_[feature]) {
      if (slot != NO_INDEX) f(vertices_[slot]);
    }
  }
  const std::vector<Feature>& features() const { return features_; }
  StepBox itemBox(std::uint32_t feature) const;
  Reach leafReach(std::uint32_t leaf, const Turning& along) const;
  Reach itemReach(std::uint32_t feature, const Turning& along) const;
  MovingHull itemHull(std::uint32_t feature) const;
  /// Unit vectors across a face at either end of the step; zero where there is none.
  Turning itemNormal(std::uint32_t feature) const;

 private:
  struct Node {
    std::uint32_t first = 0, count = 0;  // of the features
    std::uint32_t right = 0;             // the second child; the first one is the next node. 0: a leaf
    std::uint32_t vertices = 0;          // of a leaf, where its slots begin
    std::uint32_t vertices_end = 0;
  };
  std::uint32_t addNode(std::vector<std::uint32_t>& order, const std::vector<Vec3>& centres, std::uint32_t first,
                        std::uint32_t last);

  bool built_ = false;
  std::vector<Feature> features_;
  std::vector<Feature> slots_;  // the same by slots
  std::vector<Node> nodes_;
  std::vector<Index> leaf_slots_;  // of each leaf, once each
  std::vector<StepBox> boxes_;
  const VertexMotion* vertices_ = nullptr;
};

}  // namespace dccd
