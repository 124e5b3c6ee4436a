#include "input/known_types.h"

#include <deformable_ccd/ContactArray.h>
#include <octomap_msgs/Octomap.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>
#include <sensor_msgs/PointCloud2.h>

#include "input/message_type.h"

namespace dccd {

namespace {

template <class Message>
std::string typeProblem(const std::string& datatype, const std::string& md5, const std::string& what) {
  namespace traits = ros::message_traits;
  if (datatype == traits::datatype<Message>()) return md5Problem(datatype, md5, traits::md5sum<Message>());
  return "type " + datatype + " is not " + what + "; publish " + traits::datatype<Message>();
}

}  // namespace

std::string mapTypeProblem(const std::string& datatype, const std::string& md5) {
  return typeProblem<octomap_msgs::Octomap>(datatype, md5, "an octomap");
}

std::string cloudTypeProblem(const std::string& datatype, const std::string& md5) {
  if (isDepthPicture(datatype)) return typeProblem<sensor_msgs::Image>(datatype, md5, "a depth picture");
  return typeProblem<sensor_msgs::PointCloud2>(datatype, md5, "a cloud");
}

std::string cameraInfoProblem(const std::string& datatype, const std::string& md5) {
  return typeProblem<sensor_msgs::CameraInfo>(datatype, md5, "a CameraInfo");
}

bool isDepthPicture(const std::string& datatype) {
  return datatype == ros::message_traits::datatype<sensor_msgs::Image>();
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
