#include "input/silence.h"

#include <map>

#include <ros/master.h>
#include <ros/this_node.h>
#include <ros/time.h>

#include "input/known_types.h"
#include "input/message_type.h"

namespace dccd {

namespace {

constexpr std::size_t MAX_NAMES = 6;

/// The type of each topic that is published; empty when the master does not answer.
std::map<std::string, std::string> publishedTypes() {
  XmlRpc::XmlRpcValue request, response, topics;
  request[0] = ros::this_node::getName();
  request[1] = "";
  std::map<std::string, std::string> types;
  // Not getTopics(), which would wait for a master that is gone.
  if (!ros::master::execute("getPublishedTopics", request, response, topics, false)) return types;
  for (int i = 0; i < topics.size(); ++i) types[topics[i][0]] = static_cast<std::string>(topics[i][1]);
  return types;
}

/// Published topics with a type that can be a mesh; empty when there are none.
std::string meshTopics() {
  const std::map<std::string, std::string> types = publishedTypes();
  std::string names;
  std::size_t count = 0;
  for (const auto& [name, datatype] : types) {
    if (!findMeshType(datatype) || isMonitorsMarkers(name, types) || ++count > MAX_NAMES) continue;
    names += (names.empty() ? "" : ", ") + name + " (" + datatype + ")";
  }
  return names;
}

}  // namespace

std::string silenceHint(const std::vector<AwaitedTopic>& silent) {
  if (ros::Time::isSimTime() && ros::Time::now().isZero()) {
    return "/use_sim_time is set, but nobody publishes /clock; play the bag with --clock, or rosparam set use_sim_time "
           "false";
  }
  std::string text;
  bool unpublished = false;
  for (const AwaitedTopic& topic : silent) {
    text += text.empty() ? "" : "; ";
    if (topic.publishers == 0) {
      unpublished = true;
      text += "nobody publishes " + topic.name;
    } else {
      text += topic.name + " has a publisher, but no message has come (see rostopic hz)";
    }
  }
  if (!unpublished) return text;
  const std::string names = meshTopics();
  return text + "; give the mesh's topic with mesh:=TOPIC; " +
         (names.empty() ? "no topic of a mesh type is published" : "published are " + names);
}

std::string unheardMapsHint(const std::string& listened) {
  std::string names;
  std::size_t count = 0;
  for (const auto& [name, datatype] : publishedTypes()) {
    if (!mapTypeProblem(datatype, "*").empty() || name == listened || ++count > MAX_NAMES) continue;
    names += (names.empty() ? "" : ", ") + name;
  }
  if (names.empty()) return "";
  return "an octomap is published on " + names + ", and this monitor listens to " + listened +
         ", where none has come; give the topic with octomap:=TOPIC, or do without with effects/octomap: off";
}

}  // namespace dccd
