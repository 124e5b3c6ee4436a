// OBJ: vertices, faces and lines, as doubles and in their order. PCL's reader ends the program on lines that end early
// or hold other bytes; assimp's (5.2.5, of Debian 12) rounds to float, opens the files that an OBJ names as its
// materials, and writes to a wild address when such a file sets a value before it names a material: two minutes of
// fuzzing found that.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// By the table in doc/mesh_files.md: `v`, `f` or `l`, and `g`, whose groups the faces after it belong to; what is
/// known to carry no geometry is skipped, a keyword that is not known is remarked, one that carries other geometry is
/// refused. Throws MeshFileError naming the file, the line and the word.
MeshFile loadObjFile(const std::string& path);

}  // namespace dccd
