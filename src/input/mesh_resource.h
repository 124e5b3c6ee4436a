// Mesh files by path, file:// or package:// address.
#pragma once

#include <memory>
#include <string>

#include "dccd/topology.h"

namespace dccd {

struct MeshResource {
  std::shared_ptr<const Topology> topology;
  Positions positions;  ///< [m], after scaling
};

/// The mesh of a rigid body: PLY, OBJ, STL or DAE. The triangles of the last two are welded by exact coordinates.
/// Throws std::invalid_argument naming the file and what is wrong with it, or the package that is not found.
MeshResource loadMeshResource(const std::string& address, double scale);

/// The faces over the points that a tracker sends: PLY, OBJ or STL. A DAE is refused, for its vertices are numbered by
/// the library that reads it. Throws as above.
std::shared_ptr<const Topology> loadTopologyFile(const std::string& address);

}  // namespace dccd
