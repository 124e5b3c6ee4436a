// What a topic carries besides meshes (message_type.h): octomaps, and a monitor's own markers.
#pragma once

#include <map>
#include <string>

namespace dccd {

/// Empty when messages of this type can be read as an octomap; else one sentence. md5 "*" stands for any.
std::string mapTypeProblem(const std::string& datatype, const std::string& md5);

/// The same of a sensor's cloud, or of a depth picture.
std::string cloudTypeProblem(const std::string& datatype, const std::string& md5);
/// The same of a camera's CameraInfo.
std::string cameraInfoProblem(const std::string& datatype, const std::string& md5);
/// Whether messages of this type, which is one of the two, are depth pictures.
bool isDepthPicture(const std::string& datatype);

/// Where a monitor publishes unless it is renamed, and analyze_bag.
constexpr const char* MONITOR_NAMESPACE = "/collision_monitor";

/// Whether the topic carries what a monitor shows, which is of a mesh type, too: `markers` beside a monitor's
/// `contacts`, or under a monitor's usual name. `types`: datatype of each topic that there is.
bool isMonitorsMarkers(const std::string& topic, const std::map<std::string, std::string>& types);

}  // namespace dccd
