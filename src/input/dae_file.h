// DAE (Collada). assimp (5.2.5, of Debian 12) takes the first of two things of one name, reads on behind the end of a
// list of numbers, makes 0 of a negative index, goes on without a geometry that it does not find, rounds to float, and
// appends to a list until memory is gone where a letter stands among the indices, as fuzzing found.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// By the table in doc/mesh_files.md: every polygon of the scene, in metres by the file's unit, with the transforms of
/// its nodes; the axes are the file's own whatever its up_axis is, as in RViz. Welded by weldPolygons(). Throws
/// MeshFileError naming the file, and the line and element that cannot be read.
MeshFile loadDaeFile(const std::string& path);

}  // namespace dccd
