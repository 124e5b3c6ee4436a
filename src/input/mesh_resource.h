// Mesh files by path or package:// address.
#pragma once

#include <memory>
#include <string>

#include "dccd/topology.h"

namespace dccd {

struct MeshResource {
  std::shared_ptr<const Topology> topology;
  Positions positions;  ///< [m], after scaling
};

/// PLY, OBJ or STL. STL's triangles are welded by exact coordinates. Throws std::invalid_argument naming the file and
/// what is wrong with it, or the package that is not found.
MeshResource loadMeshResource(const std::string& address, double scale);

}  // namespace dccd
