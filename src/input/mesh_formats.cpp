#include "input/mesh_formats.h"

#include "input/dae_file.h"
#include "input/obj_file.h"
#include "input/ply_file.h"
#include "input/stl_file.h"

namespace dccd {

MeshFile loadMeshFile(const std::string& path) {
  const std::string ending = fileEnding(path);
  if (ending == "obj") return loadObjFile(path);
  if (ending == "ply") return loadPlyFile(path);
  if (ending == "stl") return loadStlFile(path);
  if (ending == "dae") return loadDaeFile(path);
  requireReadable(path);
  throw MeshFileError(path + ": unknown mesh format '" + ending + "'; STL, OBJ, PLY and DAE can be read");
}

}  // namespace dccd
