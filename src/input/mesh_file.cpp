#include "input/mesh_file.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <fstream>
#include <map>

#include "base/regular_file.h"
#include "input/soup_weld.h"

namespace dccd {
namespace {

constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{512} << 20;

/// Empty: all are checked.
std::string uncheckedHint(const MeshFile& mesh) {
  if (mesh.unchecked.empty()) return {};
  return std::to_string(mesh.unchecked.size()) + " polygons cannot be used and are unchecked, the first is " +
         mesh.polygon_name(mesh.unchecked[0]);
}

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

void hintAtUnchecked(std::function<std::string(std::size_t)> name, MeshFile& mesh) {
  mesh.polygon_name = std::move(name);
  if (!mesh.unchecked.empty()) mesh.hints.push_back(uncheckedHint(mesh));
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
  mesh.is_soup = true;
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

std::size_t matchSoups(std::vector<MeshFile>& frames) {
  SoupWeld weld;
  std::size_t apart = 0;
  for (MeshFile& frame : frames) {
    Positions corners;
    corners.reserve(frame.polygons.corners.size());
    for (const Index v : frame.polygons.corners) corners.push_back(frame.positions[v]);
    frame.positions = std::move(corners);
    apart += weld.weld(frame.positions);
  }
  for (MeshFile& frame : frames) {
    Positions positions;
    positions.reserve(weld.cornerOfVertex().size());
    for (const Index corner : weld.cornerOfVertex()) positions.push_back(frame.positions[corner]);
    frame.positions = std::move(positions);
    auto& hints = frame.hints;
    hints.erase(std::remove(hints.begin(), hints.end(), uncheckedHint(frame)), hints.end());
    setPolygons({weld.vertexOfCorner(), std::move(frame.polygons.ends)}, frame);
    hintAtUnchecked(std::move(frame.polygon_name), frame);
  }
  return apart;
}

}  // namespace dccd
