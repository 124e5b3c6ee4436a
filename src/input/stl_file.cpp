#include "input/stl_file.h"

#include <cstring>
#include <sstream>

namespace dccd {

namespace {

constexpr std::size_t HEADER_BYTES = 80, TRIANGLE_BYTES = 50;

Positions binaryCorners(const std::string& bytes, std::size_t triangles) {
  Positions corners;
  corners.reserve(3 * triangles);
  for (std::size_t t = 0; t < triangles; ++t) {
    float values[12];  // normal, then three corners
    std::memcpy(values, bytes.data() + HEADER_BYTES + 4 + t * TRIANGLE_BYTES, sizeof values);
    for (int k = 1; k <= 3; ++k) corners.emplace_back(values[3 * k], values[3 * k + 1], values[3 * k + 2]);
  }
  return corners;
}

Positions asciiCorners(const std::string& text, const std::string& path) {
  Positions corners;
  std::istringstream words(text);
  for (std::string word; words >> word;) {
    if (word != "vertex") continue;
    Vec3 p;
    if (!(words >> p.x() >> p.y() >> p.z())) {
      throw MeshFileError(path + ": vertex " + std::to_string(corners.size()) + " is not three numbers");
    }
    corners.push_back(p);
  }
  return corners;
}

}  // namespace

MeshFile loadStlFile(const std::string& path) {
  const std::string bytes = readWholeFile(path);
  std::uint32_t triangles = 0;
  if (bytes.size() >= HEADER_BYTES + 4) std::memcpy(&triangles, bytes.data() + HEADER_BYTES, 4);
  // Binary files may begin with "solid" too; only the size tells for certain.
  const bool binary =
      bytes.size() >= HEADER_BYTES + 4 && bytes.size() == HEADER_BYTES + 4 + std::size_t{triangles} * TRIANGLE_BYTES;
  if (!binary && bytes.compare(0, 5, "solid") != 0) {
    throw MeshFileError(path + ": neither an ASCII STL nor a binary one of the size that it states");
  }
  return weldTriangles(binary ? binaryCorners(bytes, triangles) : asciiCorners(bytes, path), path);
}

}  // namespace dccd
