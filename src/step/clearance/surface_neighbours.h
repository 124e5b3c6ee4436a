// Which features of a body are so near each other along its surface that their distance says nothing of a fold.
#pragma once

#include <array>
#include <cstdint>
#include <utility>
#include <vector>

#include "step/clearance/feature_tree.h"

namespace dccd {

/// Two features are neighbours where a way along the edges of the mesh leads from a vertex of one to a vertex of the
/// other that is shorter than self_m, in the reference frame. The way along edges is never shorter than the way on the
/// surface: what is left out is nearer than self_m there, and some of what is as near is asked for.
///
/// Made once. A patch is a node of the tree whose features are so few that a search around each patch is little work.
/// Where patches are leaves, a table has every pair of neighbours; else it has the pairs of patches whose features are
/// all neighbours, and what else comes near in space is searched for one feature at a time. Of nodes above patches
/// another table has the pairs whose features are all neighbours.
class SurfaceNeighbours {
 public:
  static constexpr bool ITSELF = true;

  void set(const Topology& topology, const Positions& reference, double self_m, const FeatureTree& tree);
  /// For NearestSearch, of two nodes of the tree, the second not before the first. Of leaves bit LEAF * i + j for each
  /// pair of their features that are not known to be neighbours; of other nodes 0 where all of them are.
  std::uint32_t asked(std::uint32_t node_a, std::uint32_t node_b) const;
  bool leavesOut(std::uint32_t feature_a, std::uint32_t feature_b);

 private:
  using Feature = FeatureTree::Feature;
  struct Entry {
    std::uint32_t patch, mask;
  };
  const std::vector<Index>& around(const Index* begin, const Index* end);
  void choosePatches();
  void listNeighbours();
  void listWholePatches();
  void listWholeNodes();
  bool isWhole(std::uint32_t node_a, std::uint32_t node_b) const;

  const FeatureTree* tree_ = nullptr;
  double self_m_ = 0;
  std::vector<std::uint32_t> begin_;             // of each vertex's edges
  std::vector<std::pair<Index, double>> edges_;  // the other end, and the length [m]
  std::vector<std::uint32_t> patch_of_;          // per node; NO_INDEX above them
  std::vector<std::uint32_t> patch_node_;        // per patch
  bool exact_ = true;                            // the patches are leaves, and the table has all neighbours
  std::vector<std::uint32_t> row_;               // per patch, where its entries begin, and their end
  std::vector<Entry> entries_;                   // with patches that are not before it
  std::vector<std::uint32_t> depth_;             // of a node down to patches
  std::vector<std::uint32_t> whole_row_;         // per node, where its partners begin, and their end
  std::vector<std::uint32_t> whole_nodes_;       // that are not before it
  // Of the search that was made last:
  std::vector<std::uint32_t> reached_;  // per vertex the number of the last search that came there
  std::vector<double> way_m_;           // per vertex, of that search
  std::uint32_t search_ = 0;
  std::uint32_t around_ = NO_INDEX;  // the feature, if it was from one
  std::vector<Index> found_;
  std::vector<std::pair<double, Index>> heap_;
};

}  // namespace dccd
