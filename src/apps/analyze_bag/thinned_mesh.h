// A mesh with fewer of its own vertices, for the study of what accuracy costs.
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "dccd/topology.h"

namespace dccd {

/// Of a grid every nth row and column, and the last ones; of any other mesh with faces about one vertex in n^2, as
/// vtkDecimatePro chooses them where the mesh is now. A rope stays as it is. The vertices keep their numbers; those
/// that are left out carry no feature.
std::shared_ptr<const Topology> thinned(const std::shared_ptr<const Topology>& topology, const Positions& positions,
                                        std::size_t every_nth);

/// The same for the bodies of a stream: chosen once for each mesh, on the first frame that has it.
class ThinnedMeshes {
 public:
  /// Those that are not `thin`, by body, stay as they are.
  ThinnedMeshes(std::size_t every_nth, std::vector<bool> thin) : every_nth_(every_nth), thin_(std::move(thin)) {}
  std::shared_ptr<const Topology> operator()(std::size_t body, const std::shared_ptr<const Topology>& topology,
                                             const Positions& positions);

 private:
  std::size_t every_nth_;
  std::vector<bool> thin_;
  std::map<std::size_t, std::pair<std::shared_ptr<const Topology>, std::shared_ptr<const Topology>>> last_;  // by body
};

}  // namespace dccd
