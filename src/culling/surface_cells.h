// A surface in cells of faces, and where they lie beside each other: what is known once per topology.
#pragma once

#include <cstdint>
#include <vector>

#include "culling/contour.h"
#include "culling/scene_arrays.h"

namespace dccd {

/// Cells are clusters of the tree of faces. Takes below 24 bytes a triangle.
class SurfaceCells {
 public:
  static constexpr std::uint32_t BORDER = 0xffffffff;  ///< in the place of a cell: beside the mesh's own border
  /// Of a body with faces.
  explicit SurfaceCells(const SceneBody& body);

  std::size_t count() const { return sound_.size(); }
  /// No edge of it has three faces, or two that are not the same way round. (Nor has it a vertex of very many faces.)
  bool isSound(std::size_t cell) const { return sound_[cell] != 0; }
  /// Every edge and vertex is one of a face, and every cell is sound.
  bool isWhole() const { return whole_; }

  /// What is beside a cell: another one, or the mesh's border; and the edges between them, by a cell's own faces.
  struct Neighbour {
    std::uint32_t cell;  ///< or BORDER
    std::uint32_t first_side;
  };
  const Neighbour* firstNeighbour(std::size_t cell) const { return neighbours_.data() + begin_[cell]; }
  const Neighbour* lastNeighbour(std::size_t cell) const { return neighbours_.data() + begin_[cell + 1]; }
  const Contour::Side* firstSide(const Neighbour& n) const { return sides_.data() + n.first_side; }
  const Contour::Side* lastSide(const Neighbour& n) const { return sides_.data() + (&n)[1].first_side; }

  /// Cells with faces that hold all features of a cluster; none: no face holds one of them.
  const std::uint32_t* firstHome(FeatureKind kind, std::size_t cluster) const {
    const Homes& homes = homes_[static_cast<int>(kind)];
    return homes.cells.data() + homes.begin[cluster];
  }
  const std::uint32_t* lastHome(FeatureKind kind, std::size_t cluster) const { return firstHome(kind, cluster + 1); }

 private:
  struct Homes {
    std::vector<std::uint32_t> begin{0}, cells;
  };
  class Builder;

  bool whole_ = false;
  std::vector<std::uint8_t> sound_;
  std::vector<std::uint32_t> begin_{0};
  std::vector<Neighbour> neighbours_;  // and one more
  std::vector<Contour::Side> sides_;
  Homes homes_[3];  // by FeatureKind
};

}  // namespace dccd
