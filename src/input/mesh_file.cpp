#include "input/mesh_file.h"

#include <pcl/io/ply/ply_parser.h>

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

/// PCL takes whatever a PLY header claims. So a header is read here first, strictly: known words and types only, lists
/// in faces only, no element without properties, and no more elements than the file has bytes.
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

using pcl::io::ply::ply_parser;

/// What a mesh needs of a PLY file. By PCL's parser: its reader of whole files lies in a library that brings VTK into
/// every program, which then takes twice as long to start.
class PlyReader {
 public:
  explicit PlyReader(const std::string& path) : path_(path) {}

  MeshFile read() {
    ply_parser parser;
    parser.element_definition_callback([this](const std::string& element, std::size_t count) {
      if (element != "vertex") return ply_parser::element_callbacks_type();
      vertices_ += count;
      return ply_parser::element_callbacks_type([this] { mesh_.positions.push_back(Vec3::Zero()); }, nullptr);
    });
    Scalars scalars;
    takeCoordinates<float>(scalars);
    takeCoordinates<double>(scalars);
    parser.scalar_property_definition_callbacks(scalars);
    Lists lists;
    takePolygons<std::uint8_t>(lists);
    takePolygons<std::uint16_t>(lists);
    takePolygons<std::uint32_t>(lists);
    parser.list_property_definition_callbacks(lists);
    if (!parser.parse(path_) || mesh_.positions.size() != vertices_) {
      throw MeshFileError(path_ + ": not a readable .ply mesh");
    }
    for (std::size_t axis = 0; axis < 3; ++axis) {
      if (has_axis_[axis]) continue;
      throw MeshFileError(path_ + ": the vertices have no property '" + AXES[axis] + "' of float or double");
    }
    if (vertices_ == 0) throw MeshFileError(path_ + ": no vertices");
    setPolygons(std::move(polygons_), mesh_);
    return std::move(mesh_);
  }

 private:
  using Scalars = ply_parser::scalar_property_definition_callbacks_type;
  using Lists = ply_parser::list_property_definition_callbacks_type;
  static constexpr const char* AXES[] = {"x", "y", "z"};

  template <class Real>
  void takeCoordinates(Scalars& scalars) {
    using Take = typename ply_parser::scalar_property_callback_type<Real>::type;
    scalars.get<Real>() = [this](const std::string& element, const std::string& property) -> Take {
      const auto axis = std::find(std::begin(AXES), std::end(AXES), property) - std::begin(AXES);
      if (element != "vertex" || axis == std::size(AXES)) return nullptr;
      has_axis_[static_cast<std::size_t>(axis)] = true;
      return [this, axis](Real x) { mesh_.positions.back()[axis] = x; };
    };
  }

  template <class Count>
  void takePolygons(Lists& lists) {
    takePolygonsOf<Count, std::int8_t, std::int16_t, std::int32_t, std::uint8_t, std::uint16_t, std::uint32_t>(lists);
  }
  /// The header check has left no other lists than those of the faces.
  template <class Count, class... Vertex>
  void takePolygonsOf(Lists& lists) {
    ((lists.get<Count, Vertex>() =
          [this](const std::string&, const std::string&) {
            return std::make_tuple([this](Count) { polygon_.clear(); },
                                   [this](Vertex v) { addCorner(static_cast<std::int64_t>(v)); },
                                   [this] { endPolygon(); });
          }),
     ...);
  }

  void addCorner(std::int64_t v) {
    if (v < 0 || v >= static_cast<std::int64_t>(vertices_)) {
      throw MeshFileError(path_ + ": polygon " + std::to_string(polygons_.size()) + " names vertex " +
                          std::to_string(v) + " of " + std::to_string(vertices_));
    }
    polygon_.push_back(static_cast<Index>(v));
  }
  void endPolygon() { polygons_.add(polygon_); }

  const std::string& path_;
  MeshFile mesh_;
  Polygons polygons_;
  std::size_t vertices_ = 0;  // as the header says
  bool has_axis_[3] = {false, false, false};
  std::vector<Index> polygon_;
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

std::vector<std::size_t> setPolygons(Polygons polygons, MeshFile& mesh) {
  PolygonFaces made = facesOf(polygons, mesh.positions);
  mesh.polygons = std::move(polygons);
  mesh.faces = std::move(made.faces);
  mesh.unchecked = std::move(made.unchecked);
  return std::move(made.ends);
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

MeshFile loadMeshFile(const std::string& path) {
  requireReadable(path);
  const std::string type = fileEnding(path);
  if (type == "obj") return loadObjFile(path);
  if (type != "ply") {
    throw MeshFileError(path + ": unknown mesh format '" + type + "'; .ply and .obj can be read");
  }
  PlyHeaderCheck(path).run();
  return PlyReader(path).read();
}

}  // namespace dccd
