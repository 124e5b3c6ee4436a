// What a step against the map tells of itself while it is computed.
#pragma once

#include <cstddef>

#include "dccd/voxel_surface.h"

namespace dccd {

class LeafObserver {
 public:
  virtual ~LeafObserver() = default;
  /// The bounds of a feature reach the leaf: these pairs alone are tested. Of an edge or a face, once for what it may
  /// touch at t=0, and once for what it may meet on its way: leaves with an edge or a corner there that stands out.
  virtual void onLeaf(const Index* vertices, std::size_t count, const OccupiedLeaf& leaf) = 0;
};

}  // namespace dccd
