#include "apps/analyze_bag/thinned_mesh.h"

namespace dccd {
namespace {

/// Columns of a grid in Topology::grid's form; 0: it is none.
std::size_t gridColumns(const Topology& topology) {
  if (!topology.hasFaces()) return 0;
  const std::size_t cols = topology.faces().front()[1], vertices = topology.vertexCount();
  if (cols < 2 || vertices % cols != 0 || vertices / cols < 2) return 0;
  return Topology::grid(vertices / cols, cols) == topology ? cols : 0;
}

/// 0, n, 2n, ... and the last one.
std::vector<Index> everyNth(std::size_t count, std::size_t n) {
  std::vector<Index> kept;
  for (std::size_t i = 0; i + 1 < count; i += n) kept.push_back(static_cast<Index>(i));
  kept.push_back(static_cast<Index>(count - 1));
  return kept;
}

std::vector<Face> thinnedGrid(std::size_t rows, std::size_t cols, std::size_t n) {
  const std::vector<Index> kept_rows = everyNth(rows, n), kept_cols = everyNth(cols, n);
  std::vector<Face> faces = Topology::grid(kept_rows.size(), kept_cols.size()).faces();
  for (Face& face : faces) {
    for (Index& v : face)
      v = kept_rows[v / kept_cols.size()] * static_cast<Index>(cols) + kept_cols[v % kept_cols.size()];
  }
  return faces;
}

std::shared_ptr<const Topology> thinned(const std::shared_ptr<const Topology>& topology, std::size_t every_nth) {
  const std::size_t vertices = topology->vertexCount(), cols = gridColumns(*topology);
  if (cols == 0) return topology;
  return std::make_shared<const Topology>(
      Topology::fromTriangles(vertices, thinnedGrid(vertices / cols, cols, every_nth)));
}

}  // namespace

std::shared_ptr<const Topology> ThinnedMeshes::operator()(std::size_t body,
                                                          const std::shared_ptr<const Topology>& topology) {
  if (!thin_.at(body)) return topology;
  auto& [whole, thin] = last_[body];
  if (whole != topology) {
    whole = topology;
    thin = thinned(topology, every_nth_);
  }
  return thin;
}

}  // namespace dccd
