// What UnfoldedParts knows of a topology, in the order in which the body's trees hold it.
#pragma once

#include <vector>

#include "culling/unfolded_parts.h"

namespace dccd {

class UnfoldedPartsBuilder {
 public:
  /// Of parts the number of clusters of a cell is read, all else is written by build().
  UnfoldedPartsBuilder(const SceneBody& body, UnfoldedParts& parts);
  void build();

 private:
  static constexpr Index BORDER = NO_INDEX, UNSOUND = NO_INDEX - 1;

  std::uint32_t cellOf(std::size_t face) const { return static_cast<std::uint32_t>(face / faces_of_a_cell_); }
  Index cornerOf(std::size_t side) const { return faces_.feature(side / 3)[side % 3]; }
  Index nextCornerOf(std::size_t side) const { return faces_.feature(side / 3)[(side + 1) % 3]; }
  void findPartners();
  void findFans();
  void findParts();
  /// False: nothing can be told of the border.
  bool describeBorder(std::uint32_t cell);
  bool describePath(std::vector<std::size_t> sides, Index first, Index last);
  Index faceWith(FeatureKind kind, std::size_t slot) const;
  void findHomes(FeatureKind kind);
  void findNear(FeatureKind kind_a, FeatureKind kind_b);
  void sampleFaces();

  const SceneBody& body_;
  const ClusterTree& faces_;
  UnfoldedParts& parts_;
  const std::size_t faces_of_a_cell_;
  std::vector<Index> partner_;                        // per side of a face: the face beside it, or BORDER or UNSOUND
  std::vector<std::uint32_t> fan_begin_, fan_;        // per used vertex: its faces
  std::vector<std::vector<std::size_t>> outer_side_;  // per cell: sides beside no face of the same cell
  std::vector<std::uint32_t> in_part_of_;  // per cell: the last cell, and one more, that it was in the part of
};

}  // namespace dccd
