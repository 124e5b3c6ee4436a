// A scene's state as the messages that publishers of meshes, maps and transforms send.
#pragma once

#include <vector>

#include <deformable_ccd/MeshStamped.h>
#include <octomap_msgs/Octomap.h>
#include <pcl_msgs/PolygonMesh.h>
#include <sensor_msgs/PointCloud2.h>
#include <tf2_msgs/TFMessage.h>
#include <visualization_msgs/MarkerArray.h>

#include "scenes/physics/scene_spec.h"

namespace dccd {

deformable_ccd::MeshStamped toMeshStamped(const std_msgs::Header& header, const Positions& positions,
                                          const std::vector<Face>& faces);
/// A row-major grid, height 1 like the cloth trackers send it, coordinates in float64 as they are.
sensor_msgs::PointCloud2 toPointCloud(const std_msgs::Header& header, const Positions& positions);
/// Rows of `width` points in float32, as a depth camera sends them; not dense: what is not seen is NaN.
sensor_msgs::PointCloud2 toImageCloud(const std_msgs::Header& header, const std::vector<Eigen::Vector3f>& points,
                                      int width);
pcl_msgs::PolygonMesh toPolygonMesh(const std_msgs::Header& header, const Positions& positions,
                                    const std::vector<Face>& faces);
/// A triangle soup: three points per face, in the order of the faces.
visualization_msgs::MarkerArray toMarkers(const std_msgs::Header& header, const Positions& positions,
                                          const std::vector<Face>& faces);
/// `data`: a tree as CloudMap and buildOctomap() serialize it.
octomap_msgs::Octomap toOctomap(const std_msgs::Header& header, double resolution_m, std::vector<std::int8_t> data,
                                bool binary);
/// The map of the obstacle's solids.
octomap_msgs::Octomap toOctomap(const std_msgs::Header& header, const scene::Obstacle& obstacle, bool binary);
geometry_msgs::TransformStamped toTransform(const std_msgs::Header& header, const std::string& child,
                                            const Eigen::Isometry3d& pose);

}  // namespace dccd
