// Meshes with known times of contact, as each message type that the monitor takes.
#pragma once

#include <string>

#include <deformable_ccd/MeshStamped.h>
#include <pcl_msgs/PolygonMesh.h>
#include <sensor_msgs/PointCloud2.h>
#include <shape_msgs/Mesh.h>
#include <visualization_msgs/MarkerArray.h>

#include "dccd/topology.h"

namespace dccd {
namespace test {

struct Mesh {
  Positions positions;
  std::vector<Face> faces;
};

/// A triangle in the plane z = 0 about the origin, and one whose lowest corner (vertex 3) is at (0, 0, z).
Mesh tipAbove(double z);
/// rows x cols points, 0.1 m apart, row by row in the plane at height z, first corner at (0.05, 0.05).
Positions gridAt(std::size_t rows, std::size_t cols, double z);
/// The same with triangles: as large as trackers send.
Mesh sheetAt(double z, std::size_t rows = 30, std::size_t cols = 30);

std::vector<geometry_msgs::Point> pointsOf(const Positions& positions);
std_msgs::Header header(double stamp_s, const std::string& frame = "world");
deformable_ccd::MeshStamped meshStamped(const Mesh& mesh, double stamp_s, const std::string& frame = "world");
sensor_msgs::PointCloud2 cloud(const Positions& positions, double stamp_s, const std::string& frame = "world");
pcl_msgs::PolygonMesh polygonMesh(const Mesh& mesh, double stamp_s);
visualization_msgs::MarkerArray soup(const Mesh& mesh, double stamp_s, int id = 2);
shape_msgs::Mesh shapeMesh(const Mesh& mesh);

}  // namespace test
}  // namespace dccd
