#include "ros/support/meshes.h"

#include <algorithm>
#include <cstring>

namespace dccd {
namespace test {

std::vector<geometry_msgs::Point> pointsOf(const Positions& positions) {
  std::vector<geometry_msgs::Point> points(positions.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i].x = positions[i].x(), points[i].y = positions[i].y(), points[i].z = positions[i].z();
  }
  return points;
}

Mesh tipAbove(double z) {
  return {{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, z}, {0.5, 0, z + 1}, {-0.5, 0, z + 1}}, {{0, 1, 2}, {3, 4, 5}}};
}

Positions gridAt(std::size_t rows, std::size_t cols, double z) {
  Positions positions;
  for (std::size_t r = 0; r < rows; ++r) {
    for (std::size_t c = 0; c < cols; ++c) {
      positions.emplace_back(0.05 + 0.1 * static_cast<double>(c), 0.05 + 0.1 * static_cast<double>(r), z);
    }
  }
  return positions;
}

Mesh sheetAt(double z, std::size_t rows, std::size_t cols) {
  return {gridAt(rows, cols, z), Topology::grid(rows, cols).faces()};
}

std_msgs::Header header(double stamp_s, const std::string& frame) {
  std_msgs::Header out;
  out.stamp = ros::Time(stamp_s);
  out.frame_id = frame;
  return out;
}

deformable_ccd::MeshStamped meshStamped(const Mesh& mesh, double stamp_s, const std::string& frame) {
  deformable_ccd::MeshStamped out;
  out.header = header(stamp_s, frame);
  out.vertices = pointsOf(mesh.positions);
  for (const Face& face : mesh.faces) {
    shape_msgs::MeshTriangle triangle;
    std::copy(face.begin(), face.end(), triangle.vertex_indices.begin());
    out.triangles.push_back(triangle);
  }
  return out;
}

sensor_msgs::PointCloud2 cloud(const Positions& positions, double stamp_s, const std::string& frame) {
  sensor_msgs::PointCloud2 out;
  out.header = header(stamp_s, frame);
  out.height = 1;
  out.width = static_cast<std::uint32_t>(positions.size());
  for (int axis = 0; axis < 3; ++axis) {
    sensor_msgs::PointField field;
    field.name = std::string(1, static_cast<char>('x' + axis));
    field.offset = static_cast<std::uint32_t>(4 * axis);
    field.datatype = sensor_msgs::PointField::FLOAT32;
    field.count = 1;
    out.fields.push_back(field);
  }
  out.point_step = 16;
  out.row_step = 16 * out.width;
  out.data.resize(out.row_step);
  for (std::size_t i = 0; i < positions.size(); ++i) {
    const Eigen::Vector3f p = positions[i].cast<float>();
    std::memcpy(out.data.data() + 16 * i, p.data(), 12);
  }
  return out;
}

pcl_msgs::PolygonMesh polygonMesh(const Mesh& mesh, double stamp_s) {
  pcl_msgs::PolygonMesh out;
  out.header = header(stamp_s);
  out.cloud = cloud(mesh.positions, stamp_s);
  for (const Face& face : mesh.faces) {
    pcl_msgs::Vertices polygon;
    polygon.vertices.assign(face.begin(), face.end());
    out.polygons.push_back(polygon);
  }
  return out;
}

visualization_msgs::MarkerArray soup(const Mesh& mesh, double stamp_s, int id) {
  visualization_msgs::Marker marker;
  marker.header = header(stamp_s);
  marker.id = id;
  marker.type = visualization_msgs::Marker::TRIANGLE_LIST;
  marker.pose.orientation.w = 1;
  marker.scale.x = marker.scale.y = marker.scale.z = 1;
  Positions corners;
  for (const Face& face : mesh.faces) {
    for (const Index v : face) corners.push_back(mesh.positions[v]);
  }
  marker.points = pointsOf(corners);
  visualization_msgs::MarkerArray out;
  out.markers.push_back(marker);
  return out;
}

shape_msgs::Mesh shapeMesh(const Mesh& mesh) {
  const deformable_ccd::MeshStamped stamped = meshStamped(mesh, 0);
  shape_msgs::Mesh out;
  out.vertices = stamped.vertices;
  out.triangles = stamped.triangles;
  return out;
}

}  // namespace test
}  // namespace dccd
