#include "input/mesh_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <map>

#include "dccd/regular_file.h"

namespace dccd {
namespace {

constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{512} << 20;

}  // namespace

std::string fileEnding(const std::string& path) {
  const std::size_t dot = path.find_last_of("./");
  std::string e = dot == std::string::npos || path[dot] == '/' ? "" : path.substr(dot + 1);
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return e;
}

void requireReadable(const std::string& path) {
  const std::string problem = regularFileProblem(path, MAX_FILE_BYTES);
  if (!problem.empty()) throw MeshFileError(path + ": " + problem);
  if (!std::ifstream(path)) throw MeshFileError(path + ": cannot be opened");
}

std::string readWholeFile(const std::string& path) {
  requireReadable(path);
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  std::string bytes(static_cast<std::size_t>(file.tellg()), '\0');
  file.seekg(0);
  if (!file.read(bytes.data(), static_cast<std::streamsize>(bytes.size()))) {
    throw MeshFileError(path + ": reading failed");
  }
  return bytes;
}

std::vector<std::size_t> setPolygons(Polygons polygons, MeshFile& mesh) {
  PolygonFaces made = facesOf(polygons, mesh.positions);
  mesh.polygons = std::move(polygons);
  mesh.faces = std::move(made.faces);
  mesh.unchecked = std::move(made.unchecked);
  return std::move(made.ends);
}

void remarkUnchecked(const std::function<std::string(std::size_t)>& name, MeshFile& mesh) {
  if (mesh.unchecked.empty()) return;
  mesh.remarks.push_back(std::to_string(mesh.unchecked.size()) +
                         " polygons cannot be used and are unchecked, the first is " + name(mesh.unchecked[0]));
}

bool isPadding(std::string_view bytes) {
  return bytes.find_first_not_of(std::string_view("\0 \t\r\n", 5)) == std::string_view::npos;
}

MeshFile weldTriangles(const Positions& corners, const std::string& path) {
  if (corners.empty() || corners.size() % 3 != 0) throw MeshFileError(path + ": no whole triangles");
  std::vector<std::size_t> ends;
  for (std::size_t end = 3; end <= corners.size(); end += 3) ends.push_back(end);
  return weldPolygons(corners, std::move(ends), path);
}

MeshFile weldPolygons(const Positions& corners, std::vector<std::size_t> ends, const std::string& path) {
  MeshFile mesh;
  Polygons polygons;
  polygons.ends = std::move(ends);
  std::map<std::array<double, 3>, Index> known;
  for (const Vec3& p : corners) {
    if (!p.allFinite()) throw MeshFileError(path + ": a coordinate is not finite");
    const auto [it, fresh] = known.try_emplace({p.x(), p.y(), p.z()}, static_cast<Index>(mesh.positions.size()));
    if (fresh) mesh.positions.push_back(p);
    polygons.corners.push_back(it->second);
  }
  setPolygons(std::move(polygons), mesh);
  return mesh;
}

}  // namespace dccd
