#include "input/mesh_resource.h"

#include <algorithm>
#include <cctype>
#include <filesystem>
#include <stdexcept>

#include <ros/package.h>

#include "input/mesh_file.h"
#include "input/mesh_formats.h"

namespace dccd {

namespace {

/// %20 as a blank and so on, where there is no file of the name as it stands: RViz takes addresses so.
std::string unescaped(const std::string& path) {
  std::error_code ignored;
  if (path.find('%') == std::string::npos || std::filesystem::exists(path, ignored)) return path;
  std::string plain;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const bool escaped = path[i] == '%' && i + 2 < path.size() &&
                         std::isxdigit(static_cast<unsigned char>(path[i + 1])) &&
                         std::isxdigit(static_cast<unsigned char>(path[i + 2]));
    plain += escaped ? static_cast<char>(std::stoi(path.substr(i + 1, 2), nullptr, 16)) : path[i];
    if (escaped) i += 2;
  }
  return plain;
}

}  // namespace

std::string pathOf(const std::string& address) {
  const std::string package = "package://", file = "file://";
  if (address.compare(0, file.size(), file) == 0) return unescaped(address.substr(file.size()));
  std::error_code ignored;
  if (address.compare(0, package.size(), package) != 0) return std::filesystem::absolute(address, ignored).string();
  const std::size_t slash = address.find('/', package.size());
  const std::string name = address.substr(package.size(), slash - package.size());
  const std::string root = ros::package::getPath(name);
  if (root.empty()) throw std::invalid_argument(address + ": there is no package '" + name + "'");
  return slash == std::string::npos ? root : unescaped(root + address.substr(slash));
}

namespace {

MeshResource resourceOf(const std::string& path, double scale) {
  MeshResource resource;
  try {
    MeshFile mesh = loadMeshFile(path);
    for (Vec3& p : mesh.positions) {
      p *= scale;
      if (!p.allFinite()) throw MeshFileError(path + ": a coordinate is not finite");
    }
    resource.topology =
        std::make_shared<const Topology>(mesh.edges.empty() ? Topology::fromTriangles(mesh.positions.size(), mesh.faces)
                                                            : Topology::fromEdges(mesh.positions.size(), mesh.edges));
    resource.dropped_faces = mesh.uncheckedCount();
    resource.positions = std::move(mesh.positions);
    resource.file_faces = std::move(mesh.faces);
    resource.groups = std::move(mesh.groups);
    resource.hints = std::move(mesh.hints);
  } catch (const MeshFileError& error) {
    throw std::invalid_argument(error.what());
  } catch (const TopologyError& error) {
    throw std::invalid_argument(path + ": " + error.what());
  }
  return resource;
}

}  // namespace

MeshResource loadMeshResource(const std::string& address, double scale) {
  const std::string path = pathOf(address);
  MeshResource resource = resourceOf(path, scale);
  if (!resource.topology->hasFaces()) throw std::invalid_argument(path + ": there are no triangles");
  return resource;
}

std::vector<Index> MeshResource::verticesOf(const std::string& group) const {
  std::vector<Index> vertices;
  const auto found = groups.find(group);
  if (found == groups.end()) return vertices;
  for (const auto& range : found->second) {
    for (std::size_t f = range.first; f < range.second; ++f) {
      vertices.insert(vertices.end(), file_faces[f].begin(), file_faces[f].end());
    }
  }
  std::sort(vertices.begin(), vertices.end());
  vertices.erase(std::unique(vertices.begin(), vertices.end()), vertices.end());
  return vertices;
}

MeshResource loadTopologyFile(const std::string& address) {
  if (fileEnding(address) == "dae") {
    throw std::invalid_argument(address + ": a DAE does not number its vertices as a tracker does");
  }
  const std::string path = pathOf(address);
  MeshResource resource = resourceOf(path, 1);
  if (resource.topology->edges().empty()) throw std::invalid_argument(path + ": there are no triangles and no lines");
  return resource;
}

}  // namespace dccd
