// The way of one mesh feature and one leaf of the map through a step: why is there no contact, or who found it? For
// people; not a fast path. Pairs of mesh features: pair_trace.h.
#pragma once

#include "record/pair_trace.h"

namespace dccd {

/// A vertex, an edge or a face (VERTEX_VOXEL_FACE, EDGE_VOXEL_EDGE, FACE_VOXEL_CORNER) and the leaf that holds a voxel.
struct VoxelQuestion {
  PairKind kind = PairKind::VERTEX_VOXEL_FACE;
  std::uint16_t body = 0;
  std::vector<Index> vertex;  ///< 1, 2 or 3, body-local, in any order
  VoxelKey voxel;
};

/// Throws std::invalid_argument when the body, a vertex, the feature or the map does not exist.
DCCD_EXPORT std::vector<TraceLine> traceVoxel(const StepInput& input, const std::vector<MonitorBody>& bodies,
                                              const MonitorOptions& options, const MonitorMap& map,
                                              const VoxelQuestion& question);

}  // namespace dccd
