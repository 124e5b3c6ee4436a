// Mesh messages as the objects that a publisher in the same process hands over: nothing was serialised, nothing is
// copied.
#pragma once

#include <string>
#include <variant>
#include <vector>

#include <deformable_ccd/MeshStamped.h>
#include <pcl_msgs/PolygonMesh.h>
#include <sensor_msgs/PointCloud2.h>
#include <shape_msgs/Mesh.h>
#include <visualization_msgs/MarkerArray.h>

#include "input/mesh_views.h"

namespace dccd {

/// One for each of meshTypes(). The publisher must not write to what it has published, as for every message of roscpp.
using TypedMesh = std::variant<deformable_ccd::MeshStamped::ConstPtr, sensor_msgs::PointCloud2::ConstPtr,
                               pcl_msgs::PolygonMesh::ConstPtr, visualization_msgs::Marker::ConstPtr,
                               visualization_msgs::MarkerArray::ConstPtr, shape_msgs::Mesh::ConstPtr>;

/// As the ROS name, for example "sensor_msgs/PointCloud2".
std::string datatypeOf(const TypedMesh& mesh);

/// The same views as of serialised messages, with the same checks: they throw WireError. The message must outlive them.
CloudView viewOf(const sensor_msgs::PointCloud2& cloud, const std::string& extra_field = {});
IndexedView viewOf(const deformable_ccd::MeshStamped& mesh);
IndexedView viewOf(const shape_msgs::Mesh& mesh);
IndexedView viewOf(const pcl_msgs::PolygonMesh& mesh, const std::string& extra_field = {});
MarkerView viewOf(const visualization_msgs::Marker& marker);
std::vector<MarkerView> viewOf(const visualization_msgs::MarkerArray& array);

}  // namespace dccd
