#include "input/obj_file.h"

#include <cstdlib>
#include <fstream>
#include <set>
#include <sstream>

namespace dccd {

namespace {

bool isBlank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

class ObjReader {
 public:
  explicit ObjReader(const std::string& path) : path_(path) {}

  MeshFile read(std::istream& in) {
    for (std::string line; std::getline(in, line);) {
      ++line_;
      if (line[0] == 'g' && (line.size() == 1 || isBlank(line[1]))) readGroups(line);
      if (line.size() < 2 || !isBlank(line[1])) continue;
      if (line[0] == 'v') readVertex(line);
      if (line[0] == 'f') readFace(line);
    }
    endGroups();
    // Faces may name vertices that come after them.
    for (const Index v : polygons_.corners) {
      if (v >= mesh_.positions.size()) {
        throw MeshFileError(path_ + ": a face names vertex " + std::to_string(std::size_t{v} + 1) + " of " +
                            std::to_string(mesh_.positions.size()));
      }
    }
    if (mesh_.positions.empty()) throw MeshFileError(path_ + ": no vertices");
    nameGroups(setPolygons(std::move(polygons_), mesh_));
    return std::move(mesh_);
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw MeshFileError(path_ + ":" + std::to_string(line_) + ": " + what);
  }

  void readVertex(const std::string& line) {
    Vec3 p;
    const char* at = line.c_str() + 1;
    for (int axis = 0; axis < 3; ++axis) {
      char* end = nullptr;
      p[axis] = std::strtod(at, &end);
      if (end == at) fail("a vertex needs three numbers");
      at = end;
    }
    mesh_.positions.push_back(p);
  }

  /// Each name of the line is a group; none: the faces that follow belong to no group.
  void readGroups(const std::string& line) {
    endGroups();
    std::istringstream words(line.substr(1));
    for (std::string name; words >> name;) groups_.insert(name);
  }

  /// The polygons since the last `g` are what its groups get.
  void endGroups() {
    for (const std::string& name : groups_) {
      auto& ranges = mesh_.groups[name];
      if (polygons_.size() > begin_) ranges.emplace_back(begin_, polygons_.size());
    }
    groups_.clear();
    begin_ = polygons_.size();
  }

  /// From ranges of polygons to ranges of faces.
  void nameGroups(const std::vector<std::size_t>& ends) {
    const auto face = [&](std::size_t polygon) { return polygon == 0 ? 0 : ends[polygon - 1]; };
    for (auto& [name, ranges] : mesh_.groups) {
      for (auto& [first, last] : ranges) {
        first = face(first);
        last = face(last);
      }
    }
  }

  void readFace(const std::string& line) {
    std::vector<Index> corners;
    const char* at = line.c_str() + 1;
    while (true) {
      while (isBlank(*at)) ++at;
      if (*at == '\0') break;
      char* end = nullptr;
      const long long number = std::strtoll(at, &end, 10);
      if (end == at || number == 0) fail("a corner of a face is no vertex's number");
      corners.push_back(index(number));
      // Texture and normal of the corner.
      for (at = end; *at != '\0' && !isBlank(*at); ++at) {
      }
    }
    if (corners.size() < 3) fail("a face needs three corners");
    polygons_.add(corners);
  }

  Index index(long long number) const {
    const long long count = static_cast<long long>(mesh_.positions.size());
    const long long v = number > 0 ? number - 1 : count + number;
    if (v < 0 || v >= NO_INDEX) fail("a face names vertex " + std::to_string(number));
    return static_cast<Index>(v);
  }

  const std::string& path_;
  std::size_t line_ = 0;
  MeshFile mesh_;
  Polygons polygons_;
  std::set<std::string> groups_;  // of the faces since begin_
  std::size_t begin_ = 0;
};

}  // namespace

MeshFile loadObjFile(const std::string& path) {
  requireReadable(path);
  std::ifstream file(path, std::ios::binary);
  return ObjReader(path).read(file);
}

}  // namespace dccd
