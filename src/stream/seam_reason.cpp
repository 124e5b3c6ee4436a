#include "stream/seam_reason.h"

#include <cmath>
#include <sstream>

#include "dccd/tolerances.h"

namespace dccd {

namespace {

void addFarthest(const Positions& before, const Positions& after, std::ostringstream& text) {
  std::size_t farthest = 0;
  double most_sq = -1;
  for (std::size_t v = 0; v < after.size(); ++v) {
    const double moved_sq = (after[v] - before[v]).squaredNorm();
    if (moved_sq > most_sq) most_sq = moved_sq, farthest = v;
  }
  text << "vertex " << farthest << " moved " << std::sqrt(most_sq) << " m";
}

/// In millimetres everything moves too far.
void addSize(const Positions& positions, std::ostringstream& text) {
  Box box;
  for (const Vec3& p : positions) {
    if (!p.allFinite()) continue;
    box.min = box.min.cwiseMin(p);
    box.max = box.max.cwiseMax(p);
  }
  if (box.empty() || (box.max - box.min).maxCoeff() <= tolerance::LARGEST_PLAUSIBLE_M) return;
  text << "; the mesh is " << (box.max - box.min).maxCoeff() << " m across: are its coordinates in millimetres?";
}

std::string sizeOf(const Topology& topology) {
  const std::string parts = topology.hasFaces() ? std::to_string(topology.faces().size()) + " faces"
                                                : std::to_string(topology.edges().size()) + " edges";
  return std::to_string(topology.vertexCount()) + " vertices and " + parts;
}

}  // namespace

std::string seamReason(StepStatus status, const MeshFrame& before, const MeshFrame& after,
                       const MeshStoreOptions& options) {
  if (status == StepStatus::OK) return {};  // nearly always; a stream for text takes microseconds to make
  std::ostringstream text;
  const double elapsed_s = secondsBetween(before.stamp_ns, after.stamp_ns);
  switch (status) {
    case StepStatus::TIME_JUMP:
      text << "the stamp is " << -elapsed_s << " s before that of the last frame";
      break;
    case StepStatus::GAP:
      text << elapsed_s << " s since the last frame, max_step_s is " << options.max_step_s;
      break;
    case StepStatus::TELEPORT:
      addFarthest(before.positions, after.positions, text);
      text << " in " << elapsed_s << " s, max_vertex_step_m is " << options.max_vertex_step_m;
      addSize(after.positions, text);
      break;
    case StepStatus::TOPOLOGY_CHANGED:
      text << "the mesh has " << sizeOf(*after.topology) << ", the last one had " << sizeOf(*before.topology);
      if (after.topology->vertexCount() == before.topology->vertexCount() &&
          after.topology->faces().size() == before.topology->faces().size() &&
          after.topology->edges().size() == before.topology->edges().size()) {
        text << ", joined otherwise";
      }
      break;
    case StepStatus::DUPLICATE:
      text << (after.stamp_ns == 0 ? "there is no stamp, and no /clock yet by which to tell the time of receipt"
                                   : "the stamp is that of the last frame");
      break;
    default:
      break;
  }
  return text.str();
}

}  // namespace dccd
