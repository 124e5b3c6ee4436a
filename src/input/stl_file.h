// STL, binary and ASCII. PCL reads it through VTK only, which would be a large library for fifty bytes a triangle.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// Corners with equal coordinates become one vertex, triangles without area are left out. Throws MeshFileError naming
/// the file and what is wrong with it.
MeshFile loadStlFile(const std::string& path);

}  // namespace dccd
