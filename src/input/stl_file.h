// STL, binary and ASCII. PCL reads it through VTK only, a large library for fifty bytes a triangle; assimp's reader
// stood ten minutes of fuzzing, but rounds ASCII coordinates to float and loses memory on every file that it refuses.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// Welded by weldTriangles(). Throws MeshFileError naming the file and what is wrong with it.
MeshFile loadStlFile(const std::string& path);

}  // namespace dccd
