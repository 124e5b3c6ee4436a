// STL, binary and ASCII. PCL reads it through VTK only, a large library for fifty bytes a triangle. assimp's reader
// (5.2.5, of Debian 12) reads past its buffer where a file begins with the mark of UTF-32, as fuzzing found, loses
// memory on every file that it refuses, and rounds ASCII coordinates to float.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// By the table in doc/mesh_files.md, welded by weldTriangles(). Throws MeshFileError naming the file, and of text the
/// line and the word.
MeshFile loadStlFile(const std::string& path);

}  // namespace dccd
