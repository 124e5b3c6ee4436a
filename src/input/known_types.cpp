#include "input/known_types.h"

#include <deformable_ccd/ContactArray.h>
#include <octomap_msgs/Octomap.h>

#include "input/message_type.h"

namespace dccd {

std::string mapTypeProblem(const std::string& datatype, const std::string& md5) {
  namespace traits = ros::message_traits;
  if (datatype == traits::datatype<octomap_msgs::Octomap>()) {
    return md5Problem(datatype, md5, traits::md5sum<octomap_msgs::Octomap>());
  }
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
