// A mesh with fewer of its own vertices, for the study of what accuracy costs.
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "dccd/topology.h"

namespace dccd {

/// For the bodies of a stream: of a grid every nth row and column, and the last ones. What is no grid stays as it is.
/// The vertices keep their numbers; those that are left out carry no feature.
class ThinnedMeshes {
 public:
  /// Those that are not `thin`, by body, stay as they are.
  ThinnedMeshes(std::size_t every_nth, std::vector<bool> thin) : every_nth_(every_nth), thin_(std::move(thin)) {}
  std::shared_ptr<const Topology> operator()(std::size_t body, const std::shared_ptr<const Topology>& topology);

 private:
  std::size_t every_nth_;
  std::vector<bool> thin_;
  std::map<std::size_t, std::pair<std::shared_ptr<const Topology>, std::shared_ptr<const Topology>>> last_;  // by body
};

}  // namespace dccd
