#include "config/monitor_config.h"

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <utility>

#include "base/accuracy.h"
#include "config/body_config.h"

namespace dccd {

using XmlRpc::XmlRpcValue;
using Kind = ParameterTree::Kind;

namespace {

/// What a live node's step may take without a budget of its own.
constexpr double MAX_COMPUTE_MS = 500;

/// What once was a parameter, and what to write instead. Those of a body are below bodies/.
constexpr std::pair<const char*, const char*> GONE[] = {
    {"earliest_only", "a monitor looks for all contacts; remove it, or ask the library or Python for the first alone"},
    {"tolerance_m", "it is 1e-6 m, as for whoever did not write it; remove it"},
    {"toc_bits", "a time of contact is known to 2^-32 of a step; remove it"},
    {"max_subdivisions", "what 4096 subdivisions do not decide is undecided; remove it"},
    {"max_substeps", "a turn is cut into at most 64 parts; remove it, or raise rigid_tolerance_m"},
    {"simd_target", "no answer depends on it, and the best one is taken; remove it"},
    {"max_compute_s", "write step_budget_ms, in milliseconds; without it a step of a live node ends after 500"},
    {"initial_contacts", "contacts are listed all; own_voxels_m takes a body's own voxels out of the map"},
    {"obstacle_camera_info_topic", "write obstacle_cloud_topics: [{topic: …, camera_info: …}]"},
    {"obstacle_sensor_frame", "write obstacle_cloud_topics: [{topic: …, sensor_frame: …}]"},
    {"sensor_model", "its numbers are octomap_server's defaults (hit 0.7, miss 0.4, min 0.12, max 0.97); remove it"},
    {"patch_gap_s", "a patch that comes back within 0.25 s is the same; remove it, or ask the library or Python"},
    {"markers/normal_length_m", "a normal is five points long; write markers/point_size_m"},
    {"markers/line_width_m", "a line is a fifth of a point wide; write markers/point_size_m"},
    {"markers/max_contacts", "the first 2000 are shown, as RViz can hold them; remove it"},
    {"markers/swept", "markers/mesh shows bodies; remove it"},
    {"clearance/tolerance_m", "distances are known to 1e-4 m; remove it, or ask the library or Python"},
    {"record_folder", "steps are recorded to deformable_ccd in $ROS_HOME; set ROS_HOME of the node"},
    {"robot/scale", "scale single links by robot/links, or widen all of them by robot/padding_m"},
    {"robot/timeout_s", "the start waits for the description for 10 s; remove it"},
    {"robot/speed_factor", "a link's speed in the last step promises nothing of the next; write robot/max_speed_m_s"},
    {"bodies/topology/min_range_m", "pixels within 0.01 m of the sensor are no measurement; remove it"},
    {"bodies/uncertainty/scale", "the field is a radius in metres; let its publisher scale it, and remove it"},
    {"bodies/weld", "corners of triangles that coincide are one vertex; remove it"},
    {"bodies/max_vertices", "a mesh has at most 1000000 vertices; remove it"},
};

Accuracy readRung(ParameterReader& reader) {
  std::vector<std::string> names;
  for (const Accuracy rung : allRungs()) names.push_back(toString(rung));
  return accuracyFromString(reader.choice("accuracy", "exact", names).c_str());
}

void readAccuracy(ParameterReader& reader, MonitorConfig& config) {
  Options& detector = config.monitor.detector;
  detector.accuracy.rung = readRung(reader);
  detector.num_threads = reader.integer("num_threads", detector.num_threads, 1, 256);
  detector.step_budget_ms = reader.number("step_budget_ms", 0.0, 0, 1e4);  // while a step runs nothing else is answered
  config.minimum_separation_m = separationOf(reader, 0.0);
}

/// Which parameter asks for a distance, and how to do without; empty when none does.
std::string distanceAskedBy(const std::string& path, const MonitorConfig& config, bool listed) {
  const auto distance = [](const std::string& name, const std::string& what) {
    return "parameter " + name + " asks for " + what + ": write accuracy: conservative, or set it to 0";
  };
  const auto pads = [](const BodyConfig& body) {
    return !body.body.link.empty() && body.body.minimum_separation_m > 0;
  };
  if (config.minimum_separation_m > 0) return distance(path + "minimum_separation_m", "a minimum separation");
  if (std::any_of(config.bodies.begin(), config.bodies.end(), pads)) {
    return distance(path + "robot/padding_m", "a minimum separation");
  }
  for (const BodyConfig& body : config.bodies) {
    const std::string own = listed ? path + "bodies/" + body.body.name + "/" : path;
    if (body.body.minimum_separation_m > 0) return distance(own + "minimum_separation_m", "a minimum separation");
    for (const SeparationFrom& from : body.body.separations) {
      if (from.separation_m > 0) return distance(path + "minimum_separation_pairs", "a minimum separation");
    }
    if (body.max_acceleration_m_s2 > 0) return distance(own + "max_acceleration_m_s2", "room beside straight paths");
    if (body.isUncertain()) return distance(own + "uncertainty", "an uncertainty radius");
  }
  return "";
}

/// Only conservative holds a distance. Without a choice by the user it is that.
void settleAccuracy(ParameterReader& reader, MonitorConfig& config) {
  Accuracy& rung = config.monitor.detector.accuracy.rung;
  if (!config.holdsDistance() || dccd::holdsDistance(rung)) return;
  if (reader.has("accuracy")) {
    reader.fail("accuracy", std::string("is '") + toString(rung) + "', which cannot hold a distance above 0; " +
                                distanceAskedBy(reader.path(), config, reader.has("bodies")));
  }
  rung = Accuracy::CONSERVATIVE;
}

void readThresholds(ParameterReader& reader, MonitorConfig& config) {
  MonitorOptions& monitor = config.monitor;
  monitor.store.max_step_s = reader.number("max_step_s", monitor.store.max_step_s, 1e-6, LARGE);
  monitor.store.max_vertex_step_m = reader.number("max_vertex_step_m", monitor.store.max_vertex_step_m, 0, LARGE);
  monitor.sync_timeout_s = reader.number("sync_timeout_s", monitor.sync_timeout_s, 0, LARGE);
  monitor.detector.max_contacts = reader.integer("max_contacts", monitor.detector.max_contacts, 1, MANY);
  for (const ParameterTree& item : reader.list("exclude_boxes")) {
    const auto n = reader.numbers(item, "exclude_boxes", 6);
    const Box box{{n[0], n[1], n[2]}, {n[3], n[4], n[5]}};
    if (box.empty())
      reader.fail("exclude_boxes", "holds a box whose min exceeds its max; write [x0, y0, z0, x1, y1, z1]");
    monitor.detector.exclude_boxes.push_back(box);
  }
  monitor.detector.rigid_tolerance_m =
      reader.number("rigid_tolerance_m", monitor.detector.rigid_tolerance_m, 1e-9, LARGE);
  monitor.look_ahead_s = reader.number("look_ahead_s", monitor.look_ahead_s, 0, 3600);
  config.transform_timeout_s = reader.number("transform_timeout_s", config.transform_timeout_s, 0, LARGE);
  config.answer_timeout_s = reader.number("answer_timeout_s", config.answer_timeout_s, 1e-3, LARGE);
  config.queue_size = reader.integer("queue_size", config.queue_size, 1, 100000);
  config.queue_policy = choiceOf(reader, "queue_policy", QueuePolicy::NEWEST, {"newest", "oldest", "thin"});
  config.record_steps = reader.integer("record_steps", config.record_steps, 0, 10000);
}

/// A quarter for what waits in queues, a quarter for what a step finds, half for frames as they are used.
void limitMemory(MonitorConfig& config) {
  Options& detector = config.monitor.detector;
  const std::size_t quarter = config.max_memory_bytes / 4;
  detector.max_found = quarter / tolerance::BYTES_PER_CONTACT;
  detector.max_found_per_feature =
      config.holdsDistance() ? tolerance::CONTACTS_PER_FEATURE_WITH_DISTANCE : tolerance::CONTACTS_PER_FEATURE;
  config.max_queue_bytes = quarter;
  for (BodyConfig& body : config.bodies) body.input.max_faces = 2 * quarter / tolerance::BYTES_PER_FACE;
}

/// A tool has the limits that it is given, the node all of them (limitLive).
void readLimits(ParameterReader& reader, MonitorConfig& config) {
  config.max_memory_bytes = reader.integer("max_memory_mb", config.max_memory_bytes >> 20, 16, 1 << 20) << 20;
  if (reader.has("max_memory_mb")) limitMemory(config);
}

void readEffects(ParameterReader section, MonitorConfig& config) {
  for (int e = 0; e < static_cast<int>(Effect::COUNT); ++e) {
    const Effect effect = static_cast<Effect>(e);
    config.effects[effect] = choiceOf(section, toString(effect), EffectSetting::AUTO, {"auto", "on", "off"});
  }
  section.finish();
}

void readMarkers(ParameterReader section, MarkerConfig& markers) {
  refuseGone(section, "markers/");
  markers.point_size_m = section.number("point_size_m", markers.point_size_m, 1e-6, LARGE);
  markers.mesh = section.get("mesh", markers.mesh);
  markers.obstacle_m = section.number("obstacle_m", markers.obstacle_m, 0, LARGE);
  section.finish();
}

void readClearance(ParameterReader section, MonitorConfig& config) {
  ClearanceOptions& clearance = config.monitor.detector.clearance;
  refuseGone(section, "clearance/");
  clearance.max_m = section.number("max_m", clearance.max_m, 1e-6, LARGE);
  clearance.self_m = section.number("self_m", clearance.self_m, 0, LARGE);
  config.markers.clearance_max_m = clearance.max_m;
  section.finish();
}

/// What of clouds and depth pictures nobody looks at, by their limits.
std::vector<std::string> beyondLimits(const MonitorConfig& config) {
  std::vector<std::string> sentences;
  const auto add = [&](const std::string& what, double limit_m, const std::string& parameter) {
    std::ostringstream text;
    text << what << limit_m << " m by " << parameter;
    sentences.push_back(text.str());
  };
  const CloudMapOptions& clouds = config.cloud_map;
  if (config.takesClouds()) {
    if (clouds.max_range_m > 0) add("what clouds show farther than ", clouds.max_range_m, "obstacle_max_range_m");
    if (clouds.min_range_m > DEFAULT_MIN_RANGE_M)
      add("what clouds show nearer than ", clouds.min_range_m, "obstacle_min_range_m");
    if (clouds.box) sentences.emplace_back("what clouds show outside of obstacle_box");
  }
  for (const BodyConfig& body : config.bodies) {
    if (body.input.source != TopologySource::DEPTH_IMAGE) continue;
    const DepthSurfaceOptions& depth = body.input.depth;
    const std::string what = "what the picture of body '" + body.body.name + "' shows ";
    if (depth.max_range_m > 0) add(what + "farther than ", depth.max_range_m, "topology/max_range_m");
    std::ostringstream text;
    text << what << "in points that have no neighbours within topology/max_edge_m, " << depth.max_edge_m << " m";
    if (depth.stride > 1) text << ", and between each pixel and the next one by topology/stride, " << depth.stride;
    sentences.push_back(text.str());
  }
  return sentences;
}

/// What an effect that is off takes away before a step is made, so that no body of a step tells of it. What bodies tell
/// of (self_collision, body_body, octomap) is not named twice.
std::vector<std::string> takenAway(const MonitorConfig& config) {
  std::vector<std::string> sentences = config.robot_excluded;
  const auto add = [&](Effect effect, const std::string& what) {
    if (settingOf(config.effects, effect) != EffectSetting::OFF || what.empty()) return;
    sentences.push_back(what + " by effects/" + toString(effect) + ": off");
  };
  std::string rigid;
  for (const std::string& name : config.rigid_off) rigid += (rigid.empty() ? "rigid body '" : "', '") + name;
  const auto uncertain = [](const BodyConfig& body) { return body.isUncertain(); };
  const bool any_uncertain = std::any_of(config.bodies.begin(), config.bodies.end(), uncertain);
  add(Effect::RIGID_BODIES, rigid.empty() ? "" : rigid + "'");
  add(Effect::MINIMUM_SEPARATION, largestSeparation(config.monitorBodies()) > 0 ? "the minimum separation" : "");
  add(Effect::TRACKER_NOISE, any_uncertain ? "the uncertainty of positions" : "");
  add(Effect::UNKNOWN_SPACE, config.unknown_space != UnknownSpace::FREE ? "unknown_space" : "");
  return sentences;
}

/// What is switched off is off everywhere: no later stage asks again.
void applyEffects(MonitorConfig& config) {
  std::vector<std::string>& excluded = config.monitor.detector.excluded;
  excluded = takenAway(config);
  for (std::string& sentence : beyondLimits(config)) excluded.push_back(std::move(sentence));
  const auto off = [&](Effect effect) { return settingOf(config.effects, effect) == EffectSetting::OFF; };
  if (off(Effect::MINIMUM_SEPARATION)) config.minimum_separation_m = 0;
  for (BodyConfig& body : config.bodies) {
    if (off(Effect::SELF_COLLISION)) body.body.self_collision = false;
    if (off(Effect::BODY_BODY)) body.body.against_bodies = false;
    if (off(Effect::OCTOMAP)) body.body.against_obstacle = false;
    if (off(Effect::MINIMUM_SEPARATION)) {
      body.body.minimum_separation_m = 0;
      body.body.separations.clear();
    }
    if (off(Effect::TRACKER_NOISE)) {
      body.input.noise_field.clear();
      body.input.noise_radius_m = 0;
      body.max_acceleration_m_s2 = 0;
    }
  }
  if (off(Effect::OWN_VOXELS)) {
    for (BodyConfig& body : config.bodies) body.body.own_voxels_m = 0;
  }
  if (off(Effect::START_STATE)) config.monitor.detector.check_start_state = false;
  if (off(Effect::LOOK_AHEAD)) config.monitor.look_ahead_s = 0;
  config.monitor.detector.patches = !off(Effect::PATCHES);
  if (off(Effect::UNKNOWN_SPACE)) config.unknown_space = UnknownSpace::FREE;
}

/// The same text for the same values, wherever they were read from.
void write(const ParameterTree& value, std::ostream& text) {
  text << static_cast<int>(value.kind) << ' ' << value.truth << ' ' << value.integer << ' ' << value.number << ' '
       << value.text.size() << ' ' << value.text << ' ' << value.items.size() << ' ' << value.members.size() << ' ';
  for (const ParameterTree& item : value.items) write(item, text);
  for (const auto& member : value.members) {
    text << member.first.size() << ' ' << member.first << ' ';
    write(member.second, text);
  }
}

/// The parameters proper as text. What dynamic_reconfigure writes back under ~live is not what was given.
std::string givenText(ParameterTree tree) {
  tree.members.erase("live");
  std::ostringstream text;
  text << std::setprecision(17);
  write(tree, text);
  return text.str();
}

ParameterTree treeOf(XmlRpcValue value) {
  ParameterTree tree;
  switch (value.getType()) {
    case XmlRpcValue::TypeInvalid:
      break;
    case XmlRpcValue::TypeBoolean:
      return static_cast<bool>(value);
    case XmlRpcValue::TypeInt:
      return static_cast<int>(value);
    case XmlRpcValue::TypeDouble:
      return static_cast<double>(value);
    case XmlRpcValue::TypeString:
      return static_cast<std::string>(value);
    case XmlRpcValue::TypeArray:
      tree.kind = Kind::LIST;
      for (int i = 0; i < value.size(); ++i) tree.items.push_back(treeOf(value[i]));
      break;
    case XmlRpcValue::TypeStruct:
      tree.kind = Kind::SECTION;
      for (auto& member : value) tree.members[member.first] = treeOf(member.second);
      break;
    default:
      tree.kind = Kind::OTHER;
  }
  return tree;
}

std::uint64_t hashOf(const std::string& text) {  // FNV-1a: the same on every machine
  std::uint64_t hash = 1469598103934665603ull;
  for (const char c : text) hash = (hash ^ static_cast<unsigned char>(c)) * 1099511628211ull;
  return hash;
}

}  // namespace

void refuseGone(ParameterReader& reader, const std::string& section) {
  const std::vector<std::string> given = reader.names();  // has() would have them suggested for others
  for (const auto& [name, instead] : GONE) {
    const std::string path = name;
    if (path.compare(0, section.size(), section) != 0) continue;
    const std::string own = path.substr(section.size());
    if (std::find(given.begin(), given.end(), own) != given.end()) reader.fail(own, std::string("is gone: ") + instead);
  }
}

void limitLive(MonitorConfig& config) {
  limitMemory(config);
  config.monitor.detector.max_compute_ms = MAX_COMPUTE_MS;
  if (config.max_map_bytes == NO_MAP_LIMIT) config.max_map_bytes = MonitorConfig().max_map_bytes;
}

std::vector<Body> MonitorConfig::monitorBodies() const {
  std::vector<Body> found;
  for (const BodyConfig& body : bodies) found.push_back(body.body);
  return found;
}

bool MonitorConfig::holdsDistance() const {
  return std::any_of(bodies.begin(), bodies.end(),
                     [](const BodyConfig& body) { return body.isUncertain() || largestSeparation({body.body}) > 0; });
}

std::uint64_t MonitorConfig::hash() const {
  std::string bits = phase;  // no text of the numbers: this is asked for in each step
  const auto add = [&](auto value) { bits.append(reinterpret_cast<const char*>(&value), sizeof value); };
  add(given_hash);
  for (const Hold& hold : holds) add(hold.closed);
#define DCCD_HASH_SETTING(name, value) add(static_cast<double>(value));
  DCCD_LIVE_SETTINGS(DCCD_HASH_SETTING)
#undef DCCD_HASH_SETTING
  return hashOf(bits);
}

MonitorConfig readConfig(const XmlRpcValue& tree, const std::string& path, const RobotLoader& load) {
  return readConfig(treeOf(tree), path, load);
}

MonitorConfig readConfig(const ParameterTree& tree, const std::string& path, const RobotLoader& load) {
  ParameterReader reader(tree, path);
  MonitorConfig config;
  refuseGone(reader, "");
  config.fixed_frame = reader.frame("fixed_frame");
  readAccuracy(reader, config);
  readThresholds(reader, config);
  readMap(reader, config);
  readEffects(reader.section("effects"), config);
  readSpeeds(reader, config);
  readMarkers(reader.section("markers"), config.markers);
  readClearance(reader.section("clearance"), config);
  readBodies(reader, config);
  readRobot(reader, load, config);
  readSeparationPairs(reader, config);
  readExpectedContacts(reader, config);
  readLimits(reader, config);
  reader.raw("live");  // dynamic_reconfigure's own (reconfigure.h); not read, but no mistake either
  reader.finish();
  config.checkMapNames();
  applyEffects(config);
  checkOwnVoxels(reader, config);
  settleAccuracy(reader, config);
  findCarriers(reader, config);
  checkSpeeds(reader, config);
  config.given_hash = hashOf(givenText(tree) + config.robot.text);
  return config;
}

}  // namespace dccd
