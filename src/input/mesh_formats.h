// Which reader a mesh file gets.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// OBJ, PLY, STL or DAE, by the path's ending. In the first two, vertices keep their numbers, their order and every bit
/// of their coordinates, as frames and topologies need it; the triangles of the others are welded by exact coordinates.
/// Throws MeshFileError naming the file and what is wrong with it.
MeshFile loadMeshFile(const std::string& path);

}  // namespace dccd
