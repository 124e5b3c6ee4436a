#include "input/mesh_file.h"

#include <pcl/PolygonMesh.h>
#include <pcl/console/print.h>
#include <pcl/io/ply_io.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstring>
#include <fstream>
#include <iterator>
#include <map>
#include <sstream>

#include "dccd/regular_file.h"
#include "input/obj_file.h"

namespace dccd {
namespace {

constexpr std::uint64_t MAX_FILE_BYTES = std::uint64_t{512} << 20;

double coordinate(const pcl::PCLPointCloud2& cloud, const pcl::PCLPointField& field, std::size_t point) {
  const std::uint8_t* at = cloud.data.data() + point * cloud.point_step + field.offset;
  if (field.datatype == pcl::PCLPointField::FLOAT64) {
    double x;
    std::memcpy(&x, at, sizeof x);
    return x;
  }
  float x;
  std::memcpy(&x, at, sizeof x);
  return x;
}

Positions positionsOf(const pcl::PCLPointCloud2& cloud, const std::string& path) {
  const pcl::PCLPointField* fields[3] = {nullptr, nullptr, nullptr};
  for (const pcl::PCLPointField& f : cloud.fields) {
    if (f.name.size() == 1 && f.name[0] >= 'x' && f.name[0] <= 'z') fields[f.name[0] - 'x'] = &f;
  }
  for (int axis = 0; axis < 3; ++axis) {
    const char name = static_cast<char>('x' + axis);
    if (!fields[axis]) throw MeshFileError(path + ": the vertices have no property '" + name + "'");
    const auto type = fields[axis]->datatype;
    if (type != pcl::PCLPointField::FLOAT32 && type != pcl::PCLPointField::FLOAT64) {
      throw MeshFileError(path + ": vertex property '" + name + "' is neither float nor double");
    }
    const std::size_t size = type == pcl::PCLPointField::FLOAT64 ? 8 : 4;
    if (fields[axis]->offset + size > cloud.point_step) {
      throw MeshFileError(path + ": the vertex layout is inconsistent");
    }
  }
  const std::size_t n = std::size_t{cloud.width} * cloud.height;
  if (n == 0) throw MeshFileError(path + ": no vertices");
  if (cloud.data.size() < n * cloud.point_step) throw MeshFileError(path + ": fewer vertices than the header says");
  Positions positions(n);
  for (std::size_t i = 0; i < n; ++i) {
    positions[i] = {coordinate(cloud, *fields[0], i), coordinate(cloud, *fields[1], i),
                    coordinate(cloud, *fields[2], i)};
  }
  return positions;
}

/// PCL allocates what a PLY header claims before it reads on, and ends the program on headers of shapes that it does
/// not expect. So a header is read here first, strictly: known words and types only, lists in faces only, no element
/// without properties, and no more elements than the file has bytes.
class PlyHeaderCheck {
 public:
  explicit PlyHeaderCheck(const std::string& path) : path_(path) {}

  void run() {
    std::ifstream file(path_, std::ios::binary | std::ios::ate);
    bytes_ = static_cast<std::uint64_t>(file.tellg());
    file.seekg(0);
    std::string line;
    bool first = true, ended = false;
    while (!ended && std::getline(file, line)) {
      if (!line.empty() && line.back() == '\r') line.pop_back();
      line_ = &line;
      if (first && line != "ply") fail("is no PLY file");
      if (!first) ended = take(line);
      first = false;
    }
    if (!ended) throw MeshFileError(path_ + ": the header has no end");
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw MeshFileError(path_ + ": header line '" + line_->substr(0, 80) + "' " + what);
  }

  /// True at the end of the header.
  bool take(const std::string& line) {
    std::istringstream words(line);
    std::string word, name, rest;
    words >> word;
    if (word == "comment" || word == "obj_info") return false;
    if (word == "end_header") {
      finishElement();
      return true;
    }
    if (word == "format") {
      if (!(words >> name) || (name != "ascii" && name != "binary_little_endian" && name != "binary_big_endian"))
        fail("names no format");
      return false;
    }
    if (word == "property") {
      takeProperty(words);
    } else if (word == "element") {
      finishElement();
      std::uint64_t count = 0;
      if (!(words >> name >> count)) fail("needs a name and a count");
      if (count > bytes_) fail("claims more than the file holds");
      in_faces_ = name == "face";
      properties_ = lists_ = 0;
      in_element_ = true;
    } else {
      fail("cannot be understood");
    }
    if (words >> rest) fail("holds too many words");
    return false;
  }

  void takeProperty(std::istringstream& words) {
    std::string type, name;
    if (!in_element_) fail("belongs to no element");
    words >> type;
    if (type == "list") {
      std::string count, item;
      if (!in_faces_) fail("is a list outside of the faces");
      if (!(words >> count >> item) || !isInteger(count) || !isInteger(item)) fail("is no list of indices");
      ++lists_;
    } else if (!isInteger(type) && !isReal(type)) {
      fail("names no type");
    }
    if (!(words >> name)) fail("has no name");
    if ((type == "list") != (name == "vertex_indices" || name == "vertex_index")) fail("is not what a mesh has");
    ++properties_;
  }

  void finishElement() const {
    if (in_element_ && properties_ == 0) fail("ends an element without properties");
    if (in_element_ && in_faces_ && lists_ != 1) fail("ends faces that do not have one list of vertices");
  }

  static bool isInteger(const std::string& type) {
    static const char* const NAMES[] = {"char", "uchar", "short", "ushort", "int",   "uint",
                                        "int8", "uint8", "int16", "uint16", "int32", "uint32"};
    return std::find(std::begin(NAMES), std::end(NAMES), type) != std::end(NAMES);
  }
  static bool isReal(const std::string& type) {
    return type == "float" || type == "double" || type == "float32" || type == "float64";
  }

  const std::string& path_;
  const std::string* line_ = nullptr;
  std::uint64_t bytes_ = 0;
  std::size_t properties_ = 0, lists_ = 0;
  bool in_element_ = false, in_faces_ = false;
};

/// While it lives PCL prints nothing: what it finds is reported here, once. The level is the process's, so that it must
/// not stay changed for whoever else uses PCL.
class QuietPcl {
 public:
  QuietPcl() { pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS); }
  ~QuietPcl() { pcl::console::setVerbosityLevel(before_); }
  QuietPcl(const QuietPcl&) = delete;
  QuietPcl& operator=(const QuietPcl&) = delete;

 private:
  const pcl::console::VERBOSITY_LEVEL before_ = pcl::console::getVerbosityLevel();
};

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
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
}

MeshFile weldTriangles(const Positions& corners, const std::string& path) {
  if (corners.empty() || corners.size() % 3 != 0) throw MeshFileError(path + ": no whole triangles");
  MeshFile mesh;
  std::map<std::array<double, 3>, Index> known;
  for (std::size_t c = 0; c < corners.size(); c += 3) {
    Face face;
    for (int k = 0; k < 3; ++k) {
      const Vec3& p = corners[c + static_cast<std::size_t>(k)];
      if (!p.allFinite()) throw MeshFileError(path + ": a coordinate is not finite");
      const auto [it, fresh] = known.try_emplace({p.x(), p.y(), p.z()}, static_cast<Index>(mesh.positions.size()));
      if (fresh) mesh.positions.push_back(p);
      face[static_cast<std::size_t>(k)] = it->second;
    }
    if (face[0] != face[1] && face[1] != face[2] && face[0] != face[2]) mesh.faces.push_back(face);
  }
  return mesh;
}

MeshFile loadMeshFile(const std::string& path) {
  requireReadable(path);
  const QuietPcl quiet;
  pcl::PolygonMesh mesh;
  const std::string type = fileEnding(path);
  int result = -1;
  if (type != "ply" && type != "obj") {
    throw MeshFileError(path + ": unknown mesh format '" + type + "'; .ply and .obj can be read");
  }
  if (type == "obj") return loadObjFile(path);
  PlyHeaderCheck(path).run();
  try {
    result = pcl::io::loadPLYFile(path, mesh);
  } catch (const std::exception& error) {
    throw MeshFileError(path + ": not a readable .ply mesh: " + error.what());
  }
  if (result < 0) throw MeshFileError(path + ": not a readable .ply mesh");
  MeshFile file;
  file.positions = positionsOf(mesh.cloud, path);
  for (std::size_t i = 0; i < mesh.polygons.size(); ++i) {
    const auto& corners = mesh.polygons[i].vertices;
    for (const auto v : corners) {
      if (static_cast<std::size_t>(v) >= file.positions.size()) {
        throw MeshFileError(path + ": polygon " + std::to_string(i) + " names vertex " + std::to_string(v) + " of " +
                            std::to_string(file.positions.size()));
      }
    }
    for (std::size_t k = 2; k < corners.size(); ++k) {
      file.faces.push_back(
          {static_cast<Index>(corners[0]), static_cast<Index>(corners[k - 1]), static_cast<Index>(corners[k])});
    }
  }
  return file;
}

}  // namespace dccd
