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

  struct Node {
    std::uint32_t first = 0, count = 0;  ///< of the features; count 0: no leaf
    std::uint32_t right = 0;             ///< the second child; the first one is the next node
  };

  /// Positions guide the order alone; any will do.
  void build(const SceneBody& body, const Positions& positions);
  bool isBuilt() const { return built_; }
  bool empty() const { return features_.empty(); }
  /// Makes the boxes anew. The positions must live while they are used; those of the features are finite.
  void refit(const Positions& t0, const Positions& t1);

  std::uint32_t root() const { return 0; }
  bool isLeaf(std::uint32_t node) const { return nodes_[node].count > 0; }
  const StepBox& box(std::uint32_t node) const { return boxes_[node]; }
  /// Calls f(child) for each child.
  template <class F>
  void forChildren(std::uint32_t node, F&& f) const {
    f(node + 1);
    f(nodes_[node].right);
  }
  /// Calls f(feature) for each feature of a leaf.
  template <class F>
  void forItems(std::uint32_t leaf, F&& f) const {
    const Node& n = nodes_[leaf];
    for (std::uint32_t i = n.first; i < n.first + n.count; ++i) f(i);
  }
  const Feature& feature(std::uint32_t feature) const { return features_[feature]; }
  StepBox itemBox(std::uint32_t feature) const;
  MovingHull itemHull(std::uint32_t feature) const;

 private:
  std::uint32_t addNode(std::vector<std::uint32_t>& order, const std::vector<Vec3>& centres, std::uint32_t first,
                        std::uint32_t last);

  bool built_ = false;
  std::vector<Feature> features_;
  std::vector<Node> nodes_;
  std::vector<StepBox> boxes_;
  const Positions *t0_ = nullptr, *t1_ = nullptr;
};

}  // namespace dccd
