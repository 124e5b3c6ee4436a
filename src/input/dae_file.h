// DAE (Collada), through assimp. Two minutes of libFuzzer on the reader of assimp 5.2.5 (Debian 12) found that one
// letter among the indices of a primitive makes it append to a list for ever, until memory runs out. So it runs in a
// child process with limits on memory and time: whatever becomes of that, this process gets an answer and goes on.
//
// Not through geometric_shapes: its createMeshFromResource drops the file's unit with the root's transform (a pyramid
// of 200 millimetres becomes one of 200 metres), and its resource_retriever would bring libcurl and some fifty
// libraries more to read a file that lies on this machine.
#pragma once

#include <string>

#include "input/mesh_file.h"

namespace dccd {

/// Every polygon of the scene, in metres by the file's unit, with the transforms of its nodes; the axes are the file's
/// own whatever its up_axis is, as in RViz. Coordinates are of single precision in assimp. Welded by weldPolygons().
/// Throws MeshFileError naming the file and what is wrong with it.
MeshFile loadDaeFile(const std::string& path);

}  // namespace dccd
