// Mesh files by path, file:// or package:// address.
#pragma once

#include <memory>
#include <string>

#include "dccd/topology.h"
#include "input/mesh_file.h"

namespace dccd {

struct MeshResource {
  std::shared_ptr<const Topology> topology;
  Positions positions;           ///< [m], after scaling
  std::vector<Face> file_faces;  ///< which the groups count; the topology has equal ones once
  FaceGroups groups;
  std::uint64_t dropped_faces = 0;  ///< polygons that cannot be used: unchecked
  std::vector<std::string> hints;   ///< about what of the file was skipped

  /// The vertices of a group's faces, each once, in order; empty where there is no such group.
  std::vector<Index> verticesOf(const std::string& group) const;
};

/// Where a file lies, in full: of a path, file:// or package:// address. Throws std::invalid_argument naming a package
/// that is not found.
std::string pathOf(const std::string& address);

/// The mesh of a rigid body: PLY, OBJ, STL or DAE. The triangles of the last two are welded by exact coordinates.
/// Throws std::invalid_argument naming the file and what is wrong with it, or the package that is not found.
MeshResource loadMeshResource(const std::string& address, double scale);

/// The faces over the points that a tracker sends, or of an OBJ or PLY the lines between them: PLY, OBJ or STL. A DAE
/// is refused, for its vertices are numbered by the library that reads it. Throws as above.
MeshResource loadTopologyFile(const std::string& address);

}  // namespace dccd
