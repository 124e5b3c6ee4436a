#include "input/silence.h"

#include <cstring>

#include <ros/time.h>

#include "input/known_types.h"
#include "input/message_type.h"

namespace dccd {

namespace {

constexpr std::size_t MAX_NAMES = 6;
constexpr const char* YET = ", nor anything else that could be a mesh, yet";

/// Published topics with a type that can be a mesh.
std::string meshTopics(const std::map<std::string, std::string>& types) {
  std::string names;
  std::size_t count = 0;
  for (const auto& [name, datatype] : types) {
    if (!findMeshType(datatype) || isMonitorsMarkers(name, types) || ++count > MAX_NAMES) continue;
    names += (names.empty() ? "" : ", ") + name + " (" + datatype + ")";
  }
  return names;
}

/// The master tells of a publisher before the two are connected, and goes on to when it was killed.
bool isPublished(const AwaitedTopic& topic, const std::map<std::string, std::string>& published) {
  return topic.publishers > 0 || (!topic.heard && published.count(topic.name) > 0);
}

/// Empty: its publisher lives, and need not say anything.
std::string whySilent(const AwaitedTopic& topic, bool is_published) {
  const std::string nobody = "nobody publishes " + topic.name + (topic.heard ? " any more" : "");
  if (!is_published) return nobody + (topic.heard ? "; start its publisher again" : "");
  if (topic.named_by.empty()) return "";
  // One that was killed stays connected.
  return topic.name + (topic.heard ? " has fallen silent" : " has a publisher, but no message has come") +
         " (see rostopic hz and rosnode ping)";
}

}  // namespace

std::string silenceHint(const std::vector<AwaitedTopic>& silent, const std::map<std::string, std::string>& published) {
  if (ros::Time::isSimTime() && ros::Time::now().isZero()) {
    return "/use_sim_time is set, but nobody publishes /clock; play the bag with --clock, or rosparam set use_sim_time "
           "false";
  }
  std::string text, given_by;
  for (const AwaitedTopic& topic : silent) {
    const bool is_published = isPublished(topic, published);
    const std::string why = whySilent(topic, is_published);
    text += (text.empty() || why.empty() ? "" : "; ") + why;
    if (is_published || topic.heard || topic.named_by.empty()) continue;
    given_by += (given_by.empty() ? "" : ", ") + topic.named_by;
  }
  if (given_by.empty()) return text;
  const std::string names = meshTopics(published);
  // Where nothing else could be meant it was given, and is waited for.
  if (names.empty()) return text + YET;
  return text + "; give the mesh's topic with " + given_by + "; published are " + names;
}

bool isYetToCome(const std::string& silence) {
  const std::size_t length = std::strlen(YET);
  return silence.size() > length && silence.compare(silence.size() - length, length, YET) == 0;
}

std::string unheardMapsHint(const std::string& listened, const std::map<std::string, std::string>& published) {
  std::string names;
  std::size_t count = 0;
  for (const auto& [name, datatype] : published) {
    if (!mapTypeProblem(datatype, "*").empty() || name == listened || ++count > MAX_NAMES) continue;
    names += (names.empty() ? "" : ", ") + name;
  }
  if (names.empty()) return "";
  return "an octomap is published on " + names + ", and this monitor listens to " + listened +
         ", where none has come; give the topic with octomap:=TOPIC, or do without with effects/octomap: off";
}

}  // namespace dccd
