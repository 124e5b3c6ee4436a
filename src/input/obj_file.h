// OBJ: vertices and faces, as doubles and in their order. PCL's reader ends the program on lines that end early or hold
// other bytes; assimp's (5.2.5, of Debian 12) rounds to float, opens the files that an OBJ names as its materials, and
// writes to a wild address when such a file sets a value before it names a material: two minutes of fuzzing found that.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// `v` and `f` lines, faces with indices from 1 or backwards from the newest vertex, and `g` lines: the groups that the
/// faces after them belong to. All else is skipped. Throws MeshFileError naming the file, the
/// line and what is wrong with it.
MeshFile loadObjFile(const std::string& path);

}  // namespace dccd
