// Why is a pair a contact, or why not? The one pair is asked again, filter by filter. For people; not a fast path.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dccd/detect.h"
#include "dccd/export.h"

namespace dccd {

/// Two features of meshes, or one and the map's leaf that holds a voxel.
struct PairQuestion {
  PairKind kind = PairKind::VERTEX_FACE;
  std::array<std::uint16_t, 2> body{0, 0};  ///< of the vertex and the face, of the two edges; with the map the first
  std::vector<Index> vertex;                ///< body-local, one feature's after the other's, in any order of each
  VoxelKey voxel{};                         ///< with the map
};

/// What one stage says of the pair. A stage that rejects has a proof that the features stay apart.
struct TraceLine {
  enum class Says : std::uint8_t { KEPT, REJECTED, CONTACT, UNDECIDED };
  std::size_t part = 0;  ///< of the step, where it was split
  std::string stage;     ///< "rules", "separation", "self", "broad phase", "planar"; "bounds" of the map; the rung
  Says says = Says::KEPT;
  std::string text;
};
DCCD_EXPORT const char* toString(TraceLine::Says says);

/// Each filter, and the rung, is asked about the pair alone, whatever the one before said: the later ones confirm what
/// was rejected. Throws std::invalid_argument when bodies, vertices, features or a map that the question names do not
/// exist.
DCCD_EXPORT std::vector<TraceLine> explain(const Step& step, const Options& options, const PairQuestion& question);

}  // namespace dccd
