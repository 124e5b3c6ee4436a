// Any bytes as a mesh file: the first chooses STL, PLY, OBJ or, as a d, DAE.
#include <sys/mman.h>
#include <unistd.h>

#include <stdexcept>
#include <string>

#include "fuzz/fuzz_target.h"
#include "input/dae_file.h"
#include "input/obj_file.h"
#include "input/ply_file.h"
#include "input/stl_file.h"

namespace {

using namespace dccd;

/// A file in memory under a name with the format's ending, as the readers ask for.
class NamedBytes {
 public:
  NamedBytes(const std::uint8_t* data, std::size_t size, const std::string& ending)
      : descriptor_(::memfd_create("fuzz", 0)),
        path_("/tmp/deformable_ccd_fuzz_" + std::to_string(::getpid()) + ending) {
    const std::string target = "/proc/" + std::to_string(::getpid()) + "/fd/" + std::to_string(descriptor_);
    ::unlink(path_.c_str());
    if (descriptor_ < 0 || ::write(descriptor_, data, size) != static_cast<ssize_t>(size) ||
        ::symlink(target.c_str(), path_.c_str()) != 0) {
      throw std::logic_error("no file in memory");
    }
  }
  ~NamedBytes() {
    ::unlink(path_.c_str());
    ::close(descriptor_);
  }
  const std::string& path() const { return path_; }

 private:
  int descriptor_;
  std::string path_;
};

void mesh_file(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return;
  static const std::pair<const char*, MeshFile (*)(const std::string&)> FORMATS[] = {
      {".stl", loadStlFile}, {".ply", loadPlyFile}, {".obj", loadObjFile}, {".dae", loadDaeFile}};
  const auto& [ending, load] = FORMATS[data[0] == 'd' ? 3 : data[0] % 3];
  const NamedBytes file(data + 1, size - 1, ending);
  try {
    const MeshFile mesh = load(file.path());
    if (mesh.positions.empty()) throw std::logic_error("a mesh without vertices");
    for (const Face& face : mesh.faces) {
      for (const Index v : face) {
        if (v >= mesh.positions.size()) throw std::logic_error("a face names a vertex that is not there");
      }
    }
    for (const Edge& edge : mesh.edges) {
      if (edge[0] >= edge[1] || edge[1] >= mesh.positions.size()) throw std::logic_error("an edge that is none");
    }
    if (mesh.polygons.size() > 0 && !mesh.edges.empty()) throw std::logic_error("faces and lines");
  } catch (const MeshFileError& error) {
    if (std::string(error.what()).find(file.path()) == std::string::npos)
      throw std::logic_error("an error without the file");
  }
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(mesh_file)
