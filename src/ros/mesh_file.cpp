#include "ros/mesh_file.h"

#include <pcl/PolygonMesh.h>
#include <pcl/console/print.h>
#include <pcl/io/obj_io.h>
#include <pcl/io/ply_io.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <fstream>
#include <sstream>

namespace deformable_ccd {
namespace {

std::string extension(const std::string& path) {
  const std::size_t dot = path.find_last_of("./");
  std::string e = dot == std::string::npos || path[dot] == '/' ? "" : path.substr(dot + 1);
  std::transform(e.begin(), e.end(), e.begin(), [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return e;
}

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

/// PCL allocates what a PLY header claims before it reads on. An element takes a byte at least.
void checkClaims(const std::string& path) {
  std::ifstream file(path, std::ios::binary | std::ios::ate);
  const std::uint64_t bytes = static_cast<std::uint64_t>(file.tellg());
  file.seekg(0);
  for (std::string line; std::getline(file, line) && line.compare(0, 10, "end_header") != 0;) {
    std::istringstream words(line);
    std::string word, name;
    std::uint64_t count = 0;
    if (!(words >> word) || word != "element") continue;
    if (!(words >> name >> count) || count > bytes) {
      throw MeshFileError(path + ": '" + line.substr(0, 80) + "' claims more than the file holds");
    }
  }
}

}  // namespace

MeshFile loadMeshFile(const std::string& path) {
  if (!std::ifstream(path)) throw MeshFileError(path + ": cannot be opened");
  pcl::console::setVerbosityLevel(pcl::console::L_ALWAYS);  // errors are reported below, once
  pcl::PolygonMesh mesh;
  const std::string type = extension(path);
  int result = -1;
  if (type != "ply" && type != "obj") {
    throw MeshFileError(path + ": unknown mesh format '" + type + "'; .ply and .obj can be read");
  }
  if (type == "ply") checkClaims(path);
  try {
    result = type == "ply" ? pcl::io::loadPLYFile(path, mesh) : pcl::io::loadOBJFile(path, mesh);
  } catch (const std::exception& error) {
    throw MeshFileError(path + ": not a readable ." + type + " mesh: " + error.what());
  }
  if (result < 0) throw MeshFileError(path + ": not a readable ." + type + " mesh");
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

}  // namespace deformable_ccd
