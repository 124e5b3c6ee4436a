#include "scenes/messages.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include <sensor_msgs/point_cloud2_iterator.h>
#include <tf2_eigen/tf2_eigen.h>

#include "octomap/map_builder.h"
#include "scenes/physics/shapes.h"

namespace dccd {
namespace {

/// Rows of `width` points; their coordinates follow each other as they are.
template <class Point>
sensor_msgs::PointCloud2 pointCloud(const std_msgs::Header& header, const std::vector<Point>& points,
                                    std::size_t width) {
  using Scalar = typename Point::Scalar;
  sensor_msgs::PointCloud2 message;
  message.header = header;
  message.height = static_cast<std::uint32_t>(points.size() / width);
  message.width = static_cast<std::uint32_t>(width);
  message.is_dense = true;
  const int type = sizeof(Scalar) == 8 ? sensor_msgs::PointField::FLOAT64 : sensor_msgs::PointField::FLOAT32;
  sensor_msgs::PointCloud2Modifier(message).setPointCloud2Fields(3, "x", 1, type, "y", 1, type, "z", 1, type);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::memcpy(message.data.data() + i * message.point_step, points[i].data(), message.point_step);
  }
  return message;
}

}  // namespace

deformable_ccd::MeshStamped toMeshStamped(const std_msgs::Header& header, const Positions& positions,
                                          const std::vector<Face>& faces) {
  deformable_ccd::MeshStamped message;
  message.header = header;
  for (const Vec3& p : positions) message.vertices.push_back(tf2::toMsg(p));
  message.triangles.resize(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) {
    std::copy(faces[f].begin(), faces[f].end(), message.triangles[f].vertex_indices.begin());
  }
  return message;
}

sensor_msgs::PointCloud2 toPointCloud(const std_msgs::Header& header, const Positions& positions) {
  return pointCloud(header, positions, positions.size());
}

sensor_msgs::PointCloud2 toImageCloud(const std_msgs::Header& header, const std::vector<Eigen::Vector3f>& points,
                                      int width) {
  sensor_msgs::PointCloud2 message = pointCloud(header, points, static_cast<std::size_t>(width));
  message.is_dense = false;
  return message;
}

pcl_msgs::PolygonMesh toPolygonMesh(const std_msgs::Header& header, const Positions& positions,
                                    const std::vector<Face>& faces) {
  pcl_msgs::PolygonMesh message;
  message.header = header;
  message.cloud = toPointCloud(header, positions);
  message.polygons.resize(faces.size());
  for (std::size_t f = 0; f < faces.size(); ++f) message.polygons[f].vertices.assign(faces[f].begin(), faces[f].end());
  return message;
}

visualization_msgs::MarkerArray toMarkers(const std_msgs::Header& header, const Positions& positions,
                                          const std::vector<Face>& faces) {
  visualization_msgs::Marker marker;
  marker.header = header;
  marker.id = 2;
  marker.type = visualization_msgs::Marker::TRIANGLE_LIST;
  marker.action = visualization_msgs::Marker::ADD;
  marker.pose.orientation.w = 1.0;
  marker.scale.x = marker.scale.y = marker.scale.z = 1.0;
  marker.color.g = marker.color.b = 0.7f;
  marker.color.a = 1.0f;
  marker.points.reserve(3 * faces.size());
  for (const Face& face : faces) {
    for (const Index v : face) marker.points.push_back(tf2::toMsg(positions[v]));
  }
  visualization_msgs::MarkerArray message;
  message.markers.push_back(marker);
  return message;
}

octomap_msgs::Octomap toOctomap(const std_msgs::Header& header, double resolution_m, std::vector<std::int8_t> data,
                                bool binary) {
  octomap_msgs::Octomap message;
  message.header = header;
  message.binary = binary;
  message.id = "OcTree";
  message.resolution = resolution_m;
  message.data = std::move(data);
  return message;
}

octomap_msgs::Octomap toOctomap(const std_msgs::Header& header, const scene::Obstacle& obstacle, bool binary) {
  Box bounds;
  for (const scene::Solid& solid : obstacle.solids) {
    const Box one = scene::bounds(solid);
    bounds.min = bounds.min.cwiseMin(one.min);
    bounds.max = bounds.max.cwiseMax(one.max);
  }
  const auto occupied = [&obstacle](const Vec3& center) {
    return std::any_of(obstacle.solids.begin(), obstacle.solids.end(),
                       [&center](const scene::Solid& solid) { return scene::contains(solid, center); });
  };
  return toOctomap(header, obstacle.resolution_m, buildOctomap(obstacle.resolution_m, bounds, occupied, binary),
                   binary);
}

geometry_msgs::TransformStamped toTransform(const std_msgs::Header& header, const std::string& child,
                                            const Eigen::Isometry3d& pose) {
  geometry_msgs::TransformStamped message = tf2::eigenToTransform(pose);
  message.header = header;
  message.child_frame_id = child;
  return message;
}

}  // namespace dccd
