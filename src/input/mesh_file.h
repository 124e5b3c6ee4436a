// Mesh files: PLY by PCL's reader (ASCII, binary of either byte order), OBJ by our own (obj_file.h).
#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "dccd/types.h"

namespace dccd {

struct MeshFileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct MeshFile {
  Positions positions;      ///< [m], in the file's frame; float or double coordinates are taken exactly
  std::vector<Face> faces;  ///< polygons with more than three corners as fans
};

/// Throws MeshFileError naming the file and what is wrong with it.
MeshFile loadMeshFile(const std::string& path);

}  // namespace dccd
