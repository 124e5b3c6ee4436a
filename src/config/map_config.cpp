// The parameters of the map: where it comes from, what it may cost, and what of it is a body's own or not known.
#include <set>
#include <sstream>

#include "config/body_config.h"
#include "input/short_text.h"

namespace dccd {
namespace {

// Each has a place to wait, and all that wait share an eighth of max_map_mb.
constexpr std::size_t MOST_CLOUD_TOPICS = 16;

CloudSource readCloudSource(ParameterReader entry) {
  CloudSource source;
  source.topic = entry.text("topic");
  source.camera_info = entry.text("camera_info", std::string());
  source.sensor_frame = entry.frame("sensor_frame");
  entry.finish();
  return source;
}

/// Of each sensor the topic alone, or with what else there is to say of it.
void readCloudTopics(ParameterReader& reader, MonitorConfig& config) {
  const char* const name = "obstacle_cloud_topics";
  const std::vector<ParameterTree> items = reader.list("obstacle_cloud_topics");
  if (items.empty()) return;
  if (reader.has("obstacle_cloud_topic")) {
    reader.fail("obstacle_cloud_topic", std::string("has no place beside ") + name +
                                            "; write {topic: …, camera_info: …, sensor_frame: …} there, and remove it");
  }
  config.clouds.clear();
  std::set<std::string> topics;
  for (const ParameterTree& item : items) {
    const std::string path = reader.path() + name + "/" + std::to_string(config.clouds.size()) + "/";
    ParameterTree entry = item;
    if (item.kind == ParameterTree::Kind::TEXT) {
      entry = ParameterTree();
      entry.put("topic", item);
    }
    config.clouds.push_back(readCloudSource(ParameterReader(entry, path)));
    const std::string& topic = config.clouds.back().topic;
    if (!topics.insert(topic).second) reader.fail(name, "has '" + topic + "' twice; remove one of the two");
  }
  if (config.clouds.size() > MOST_CLOUD_TOPICS) {
    reader.fail(name, "has " + std::to_string(config.clouds.size()) + " entries, more than " +
                          std::to_string(MOST_CLOUD_TOPICS));
  }
}

void readClouds(ParameterReader& reader, MonitorConfig& config) {
  // What is said of clouds is said by somebody who has them.
  for (const char* name : {"obstacle_cloud_topic", "obstacle_cloud_topics", "obstacle_resolution_m",
                           "obstacle_min_range_m", "obstacle_max_range_m", "obstacle_no_return", "obstacle_box"}) {
    config.cloud_named = config.cloud_named || reader.has(name);
  }
  CloudSource& single = config.clouds.front();
  single.topic = reader.get("obstacle_cloud_topic", single.topic);
  if (single.topic.empty()) reader.fail("obstacle_cloud_topic", "is empty; remove it, or name the clouds' topic");
  readCloudTopics(reader, config);
  CloudMapOptions& map = config.cloud_map;
  map.resolution_m = reader.number("obstacle_resolution_m", map.resolution_m, 1e-4, 1e3);
  map.max_range_m = reader.number("obstacle_max_range_m", map.max_range_m, 0, LARGE);
  if (map.max_range_m > CloudMap::MOST_RAY_VOXELS * map.resolution_m) {
    std::ostringstream text;
    text << "is " << map.resolution_m << ", too fine for obstacle_max_range_m " << map.max_range_m << ": a ray has "
         << CloudMap::MOST_RAY_VOXELS << " voxels at most; write at least "
         << map.max_range_m / CloudMap::MOST_RAY_VOXELS << ", or a shorter range";
    reader.fail("obstacle_resolution_m", text.str());
  }
  map.min_range_m = reader.number("obstacle_min_range_m", DEFAULT_MIN_RANGE_M, 0, LARGE);
  if (map.max_range_m > 0 && map.min_range_m >= map.max_range_m) {
    std::ostringstream text;
    text << "is " << map.min_range_m << ", which leaves nothing of obstacle_max_range_m " << map.max_range_m;
    reader.fail("obstacle_min_range_m", text.str());
  }
  map.no_return_clears = reader.choice("obstacle_no_return", "stays", {"stays", "clears"}) == "clears";
  if (const ParameterTree& box = reader.raw("obstacle_box"); box.isSet()) {
    const auto n = reader.numbers(box, "obstacle_box", 6);
    map.box = Box{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
    if (map.box->empty()) {
      reader.fail("obstacle_box", "is empty; [x0, y0, z0, x1, y1, z1] in the map's frame, the smaller corner first");
    }
  }
}

}  // namespace

void readMap(ParameterReader& reader, MonitorConfig& config) {
  config.octomap_topic_named = reader.has("octomap_topic");
  config.octomap_topic = reader.get("octomap_topic", config.octomap_topic);
  if (config.octomap_topic.empty()) {
    reader.fail("octomap_topic", "is empty; remove it, or write effects/octomap: off where there is no map");
  }
  config.octomap_file = reader.get("octomap_file", std::string());
  config.octomap_frame = reader.frame("octomap_frame");
  config.max_map_bytes = reader.integer("max_map_mb", config.max_map_bytes >> 20, 1, 1 << 20) << 20;
  if (!reader.has("max_map_mb")) config.max_map_bytes = NO_MAP_LIMIT;
  readClouds(reader, config);
  config.monitor.octomap_timeout_s = reader.number("octomap_timeout_s", 0.0, 0, LARGE);
  config.own_voxels_m = ownVoxelsOf(reader, 0);
  config.monitor.own_voxels_lag_s =
      reader.number("own_voxels_lag_s", config.monitor.own_voxels_lag_s, 0, tolerance::OWN_PATH_S);
  config.monitor.own_voxels_trust = reader.choice("own_voxels_doubt", "unproved", {"unproved", "trust"}) == "trust";
  config.unknown_space = choiceOf(reader, "unknown_space", UnknownSpace::FREE, {"free", "occupied"});
  const ParameterTree& box = reader.raw("unknown_box");
  if (box.isSet()) {
    const auto n = reader.numbers(box, "unknown_box", 6);
    config.unknown_box = Box{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
  }
  if (config.unknown_space == UnknownSpace::OCCUPIED && config.unknown_box.empty()) {
    reader.fail("unknown_box",
                "is needed for unknown_space 'occupied': [x0, y0, z0, x1, y1, z1] in the map's frame, "
                "the workspace within which the unknown is an obstacle");
  }
}

void checkOwnVoxels(const ParameterReader& reader, const MonitorConfig& config) {
  if (!config.ownsVoxels() || config.unknown_space != UnknownSpace::OCCUPIED) return;
  reader.fail("own_voxels_m",
              "is above 0, but with unknown_space: occupied a body's own voxels cannot be told from what "
              "is unknown; write unknown_space: free, or own_voxels_m: 0");
}

std::vector<std::string> MonitorConfig::liveMapNames() const {
  if (!cloud_named) return {octomap_topic};
  std::vector<std::string> names;
  for (const CloudSource& source : clouds) names.push_back(source.topic);
  return names;
}

std::string MonitorConfig::mapName() const { return takesMapFileAlone() ? octomap_file : listOf(liveMapNames()); }

void MonitorConfig::checkMapNames() const {
  if (!cloud_named || !octomap_topic_named) return;
  throw ParameterError("the map is to come both from the clouds on obstacle_cloud_topic '" + clouds.front().topic +
                       "' and from octomap_topic '" + octomap_topic +
                       "' (obstacle_cloud:= and octomap:= of the launch files); remove one of the two");
}

bool MonitorConfig::namesOctomap() const {
  const EffectSetting setting = settingOf(effects, Effect::OCTOMAP);
  if (setting != EffectSetting::AUTO) return setting == EffectSetting::ON;
  return octomap_topic_named || cloud_named || !octomap_file.empty();
}

}  // namespace dccd
