#include "input/known_types.h"

#include <deformable_ccd/ContactArray.h>
#include <deformable_ccd/MeshStamped.h>
#include <octomap_msgs/Octomap.h>
#include <pcl_msgs/PolygonMesh.h>
#include <sensor_msgs/PointCloud2.h>
#include <shape_msgs/Mesh.h>
#include <visualization_msgs/MarkerArray.h>

namespace dccd {

namespace {

template <typename Message>
bool is(const std::string& datatype, const std::string& md5, std::string& problem) {
  if (datatype != ros::message_traits::datatype<Message>()) return false;
  if (md5 != ros::message_traits::md5sum<Message>() && md5 != "*") {
    problem = "type " + datatype + " has md5 " + md5 + ", known is " + ros::message_traits::md5sum<Message>() +
              ": publisher and monitor were built with different definitions";
  }
  return true;
}

}  // namespace

std::string meshTypeProblem(const std::string& datatype, const std::string& md5) {
  std::string problem;
  const bool known =
      is<deformable_ccd::MeshStamped>(datatype, md5, problem) || is<sensor_msgs::PointCloud2>(datatype, md5, problem) ||
      is<pcl_msgs::PolygonMesh>(datatype, md5, problem) || is<visualization_msgs::Marker>(datatype, md5, problem) ||
      is<visualization_msgs::MarkerArray>(datatype, md5, problem) || is<shape_msgs::Mesh>(datatype, md5, problem);
  if (known) return problem;
  return "type " + datatype +
         " is not a mesh; publish deformable_ccd/MeshStamped, sensor_msgs/PointCloud2, "
         "pcl_msgs/PolygonMesh, visualization_msgs/Marker or MarkerArray, or shape_msgs/Mesh";
}

std::string mapTypeProblem(const std::string& datatype, const std::string& md5) {
  std::string problem;
  if (is<octomap_msgs::Octomap>(datatype, md5, problem)) return problem;
  return "type " + datatype + " is not an octomap; publish octomap_msgs/Octomap";
}

bool isMonitorsMarkers(const std::string& topic, const std::map<std::string, std::string>& types) {
  const std::string name = "/markers";
  if (topic.size() < name.size() || topic.compare(topic.size() - name.size(), name.size(), name) != 0) return false;
  const std::string monitor = topic.substr(0, topic.size() - name.size());
  const auto contacts = types.find(monitor + "/contacts");
  return monitor == MONITOR_NAMESPACE ||
         (contacts != types.end() && contacts->second == ros::message_traits::datatype<deformable_ccd::ContactArray>());
}

}  // namespace dccd
