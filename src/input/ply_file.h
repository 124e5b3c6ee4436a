// PLY: vertices, faces and triangle strips, of ASCII and of binary files of either byte order. PCL's parser takes
// whatever a header claims, reads `1.0-1` as two numbers, and refuses lists outside of the faces.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// By the table in doc/mesh_files.md. What else the file holds is skipped by its types, and elements of other names are
/// remarked. Throws MeshFileError naming the file, the line or the polygon, and the value.
MeshFile loadPlyFile(const std::string& path);

}  // namespace dccd
