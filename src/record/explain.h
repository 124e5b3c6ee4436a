// Why is there no contact, or who found it? The step once more, with an observer that watches one pair. For people; not
// a fast path.
#pragma once

#include <array>
#include <string>
#include <vector>

#include "dccd/detect.h"
#include "dccd/export.h"

namespace dccd {

/// A vertex and a face, or two edges; in any order of the face's and the edges' vertices.
struct PairQuestion {
  PairKind kind = PairKind::VERTEX_FACE;
  std::array<std::uint16_t, 2> body{0, 0};  ///< of the vertex and the face; of the two edges
  Quad vertex{};                            ///< body-local
};

/// A vertex, an edge or a face (VERTEX_VOXEL_FACE, EDGE_VOXEL_EDGE, FACE_VOXEL_CORNER) and the leaf that holds a voxel.
struct VoxelQuestion {
  PairKind kind = PairKind::VERTEX_VOXEL_FACE;
  std::uint16_t body = 0;
  std::vector<Index> vertex;  ///< 1, 2 or 3, body-local, in any order
  VoxelKey voxel;
};

/// What one stage says of the pair. A stage that rejects has a proof that the features stay apart; stages before the
/// rungs are asked all the same, and every rung about what the planar filter keeps.
struct TraceLine {
  enum class Says : std::uint8_t { KEPT, REJECTED, CONTACT, UNDECIDED };
  std::size_t part = 0;  ///< of the step, where it was split
  std::string stage;
  Says says = Says::KEPT;
  std::string text;
};
DCCD_EXPORT const char* toString(TraceLine::Says says);

/// Throw std::invalid_argument when bodies, vertices, features or a map that the question names do not exist.
DCCD_EXPORT std::vector<TraceLine> explain(const Step& step, const Options& options, const PairQuestion& question);
DCCD_EXPORT std::vector<TraceLine> explain(const Step& step, const Options& options, const VoxelQuestion& question);

}  // namespace dccd
