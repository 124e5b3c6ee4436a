#include "input/mesh_resource.h"

#include <algorithm>
#include <cctype>
#include <stdexcept>

#include <ros/package.h>

#include "input/mesh_file.h"
#include "input/stl_file.h"

namespace dccd {

namespace {

std::string pathOf(const std::string& address) {
  const std::string package = "package://", file = "file://";
  if (address.compare(0, file.size(), file) == 0) return address.substr(file.size());
  if (address.compare(0, package.size(), package) != 0) return address;
  const std::size_t slash = address.find('/', package.size());
  const std::string name = address.substr(package.size(), slash - package.size());
  const std::string root = ros::package::getPath(name);
  if (root.empty()) throw std::invalid_argument(address + ": there is no package '" + name + "'");
  return slash == std::string::npos ? root : root + address.substr(slash);
}

bool endsWith(std::string text, const std::string& end) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

MeshResource loadMeshResource(const std::string& address, double scale) {
  const std::string path = pathOf(address);
  MeshResource resource;
  try {
    MeshFile mesh = endsWith(path, ".stl") ? loadStlFile(path) : loadMeshFile(path);
    for (Vec3& p : mesh.positions) p *= scale;
    mesh.faces.erase(std::remove_if(mesh.faces.begin(), mesh.faces.end(),
                                    [](const Face& f) { return f[0] == f[1] || f[1] == f[2] || f[0] == f[2]; }),
                     mesh.faces.end());
    resource.topology = std::make_shared<const Topology>(Topology::fromTriangles(mesh.positions.size(), mesh.faces));
    resource.positions = std::move(mesh.positions);
  } catch (const MeshFileError& error) {
    throw std::invalid_argument(error.what());
  } catch (const TopologyError& error) {
    throw std::invalid_argument(path + ": " + error.what());
  }
  if (!resource.topology->hasFaces()) throw std::invalid_argument(path + ": there are no triangles");
  return resource;
}

}  // namespace dccd
