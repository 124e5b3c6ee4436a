#include "support/scene_data.h"

#include <zlib.h>

#include <algorithm>
#include <cstring>
#include <fstream>
#include <functional>
#include <regex>
#include <sstream>
#include <stdexcept>

#include "support/data.h"

namespace dccd {
namespace test {
namespace {

[[noreturn]] void fail(const std::string& path, const std::string& what) {
  throw std::runtime_error(path + ": " + what);
}

/// What the header of a PLY file says; only what these scenes have: float x, y, z first, then lists of int.
struct PlyHeader {
  bool big_endian = false;
  std::size_t vertices = 0, faces = 0, vertex_bytes = 0;
};

PlyHeader readHeader(std::istream& in, const std::string& path) {
  PlyHeader header;
  std::string line, word, type;
  bool in_vertex = false;
  while (std::getline(in, line) && line.rfind("end_header", 0) != 0) {
    std::istringstream words(line);
    words >> word >> type;
    if (word == "format") {
      header.big_endian = type == "binary_big_endian";
      if (type == "ascii") fail(path, "not a binary PLY file");
    } else if (word == "element") {
      in_vertex = type == "vertex";
      words >> (in_vertex ? header.vertices : header.faces);
    } else if (word == "property" && in_vertex) {
      if (type != "float" && type != "uchar") fail(path, "vertex property of type " + type);
      header.vertex_bytes += type == "float" ? 4 : 1;
    }
  }
  if (!in || header.vertex_bytes < 12) fail(path, "not a PLY file with vertices");
  return header;
}

template <typename T>
T decode(const char* bytes, bool big_endian) {
  char ordered[sizeof(T)];
  std::copy(bytes, bytes + sizeof(T), ordered);
  if (big_endian) std::reverse(ordered, ordered + sizeof(T));  // all machines that this runs on are little endian
  T value;
  std::memcpy(&value, ordered, sizeof value);
  return value;
}

/// Hands each line of a gzipped text to `read`, but for comments and empty ones; `read` says whether it is `expected`.
void forEachLine(const std::string& path, const std::string& expected, const std::function<bool(std::istream&)>& read) {
  gzFile file = gzopen(path.c_str(), "rb");
  if (file == nullptr) fail(path, "cannot be opened");
  char line[256];
  std::size_t number = 0;
  bool good = true;
  while (good && gzgets(file, line, sizeof line) != nullptr) {
    ++number;
    if (line[0] == '#' || line[0] == '\n') continue;
    std::istringstream words(line);
    good = read(words);
  }
  gzclose(file);
  if (!good) fail(path, "line " + std::to_string(number) + " is not " + expected);
}

}  // namespace

PlyMesh readPly(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) fail(path, "cannot be opened");
  const PlyHeader header = readHeader(in, path);
  PlyMesh mesh;
  std::vector<char> bytes(header.vertex_bytes);
  const auto stride = static_cast<std::streamsize>(bytes.size());
  for (std::size_t i = 0; i < header.vertices && in.read(bytes.data(), stride); ++i) {
    const auto coordinate = [&](int axis) { return decode<float>(bytes.data() + 4 * axis, header.big_endian); };
    mesh.vertices.emplace_back(coordinate(0), coordinate(1), coordinate(2));
  }
  char face[13];
  for (std::size_t i = 0; i < header.faces && in.read(face, sizeof face); ++i) {
    if (face[0] != 3) fail(path, "a face that is no triangle");
    const auto corner = [&](int k) { return decode<Index>(face + 1 + 4 * k, header.big_endian); };
    mesh.faces.push_back({corner(0), corner(1), corner(2)});
  }
  if (mesh.vertices.size() != header.vertices || mesh.faces.size() != header.faces) fail(path, "ends too early");
  return mesh;
}

std::vector<TruthPair> readTruthPairs(const std::string& path) {
  std::vector<TruthPair> pairs;
  forEachLine(path, "four indices and a verdict", [&](std::istream& words) {
    TruthPair pair{};
    for (Index& index : pair.pair) words >> index;
    words >> pair.contact;
    pairs.push_back(pair);
    return !words.fail();
  });
  return pairs;
}

std::vector<TruthTime> readTruthTimes(const std::string& path) {
  std::vector<TruthTime> times;
  forEachLine(path, "four indices and a time from 0 to 1 in decimal digits", [&](std::istream& words) {
    TruthTime time{};
    for (Index& index : time.pair) words >> index;
    words >> time.decimal;
    times.push_back(time);
    static const std::regex WITHIN_THE_STEP("0(\\.[0-9]+)?|1(\\.0+)?");
    return !words.fail() && std::regex_match(time.decimal, WITHIN_THE_STEP);
  });
  return times;
}

SceneData readScene(const std::string& name) {
  const std::string folder = dataDir() + "/scenes/" + name + "/";
  const PlyMesh t0 = readPly(folder + "frame_0.ply"), t1 = readPly(folder + "frame_1.ply");
  if (t0.vertices.size() != t1.vertices.size()) fail(folder, "the frames have different numbers of vertices");
  SceneData scene;
  scene.vertices.resize(t0.vertices.size());
  for (std::size_t i = 0; i < scene.vertices.size(); ++i) {
    scene.vertices[i] = {};
    std::copy_n(t0.vertices[i].data(), 3, scene.vertices[i].t0);
    std::copy_n(t1.vertices[i].data(), 3, scene.vertices[i].t1);
  }
  scene.faces = t0.faces;
  scene.vertex_face = readTruthPairs(folder + "vf.txt.gz");
  scene.edge_edge = readTruthPairs(folder + "ee.txt.gz");
  return scene;
}

}  // namespace test
}  // namespace dccd
