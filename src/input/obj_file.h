// OBJ: vertices and faces. PCL's reader ends the program on lines that end early or hold other bytes.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// `v` and `f` lines, faces with indices from 1 or backwards from the newest vertex; all else is skipped. Polygons
/// become fans. Throws MeshFileError naming the file, the line and what is wrong with it.
MeshFile loadObjFile(const std::string& path);

}  // namespace dccd
