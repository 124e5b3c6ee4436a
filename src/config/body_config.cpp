#include "config/body_config.h"

#include <algorithm>
#include <map>
#include <set>

namespace dccd {

double ownVoxelsOf(ParameterReader& reader, double fallback) {
  if (const ParameterTree& given = reader.raw("own_voxels_m"); given.kind == ParameterTree::Kind::TEXT) {
    reader.choice("own_voxels_m", "auto", {"auto"});
    return ONE_VOXEL;
  }
  return reader.number("own_voxels_m", fallback, 0, LARGE);
}

SpeedBound speedBoundOf(ParameterReader& section, const SpeedBound& fallback) {
  SpeedBound speed = fallback;
  if (!section.has("max_speed_m_s")) return speed;
  if (section.raw("max_speed_m_s").kind == ParameterTree::Kind::TEXT) {
    section.choice("max_speed_m_s", "none", {"none"});
    speed.max_m_s = SpeedBound::NONE;
    return speed;
  }
  speed.max_m_s = section.number("max_speed_m_s", 0, LARGE);
  if (speed.max_m_s == 0) {  // which could be either
    section.fail("max_speed_m_s",
                 "is 0; what stands still is motion: static, or rigid in the fixed frame, and needs no bound; where "
                 "nothing is to be promised write none");
  }
  return speed;
}

double separationOf(ParameterReader& reader, double fallback) {
  return reader.number("minimum_separation_m", fallback, 0, LARGE);
}

namespace {

void readDepthImage(ParameterReader& section, MeshInputConfig& input) {
  const bool is_image = input.source == TopologySource::DEPTH_IMAGE;
  for (const char* name : {"max_edge_m", "stride", "max_range_m", "median"}) {
    if (!is_image && section.has(name)) section.fail(name, "has no meaning without source: depth_image; remove it");
  }
  DepthSurfaceOptions& depth = input.depth;
  depth.max_edge_m = section.number("max_edge_m", depth.max_edge_m, 1e-6, LARGE);
  depth.stride = section.integer("stride", depth.stride, 1, 1000);
  depth.max_range_m = section.number("max_range_m", depth.max_range_m, 0, LARGE);
  depth.median = section.integer("median", depth.median, 1, 15);
  if (depth.median % 2 == 0)
    section.fail("median", "must be odd, so that a pixel lies in the middle: 1 (off), 3, 5, …");
  if (is_image && input.rows) section.fail("rows", "has no meaning for a depth image, which brings its own; remove it");
}

void readSets(ParameterReader section, BodyConfig& body) {
  for (const std::string& name : section.names()) {
    body.sets[name] = section.indices(name);
    if (body.sets[name].empty()) section.fail(name, "is empty; list the vertices of the set, or remove it");
  }
}

void readTopology(ParameterReader section, BodyConfig& body) {
  MeshInputConfig& input = body.input;
  refuseGone(section, "bodies/topology/");
  readSets(section.section("sets"), body);
  input.source = choiceOf(section, "source", TopologySource::AUTO,
                          {"auto", "message", "grid", "polyline", "file", "first_frame_weld", "depth_image"});
  input.rows = section.integer("rows", input.rows, 0, 100000);
  input.cols = section.integer("cols", input.cols, 0, 100000);
  body.topology_file = section.get("file", std::string());
  readDepthImage(section, input);
  section.finish();
  if ((input.rows == 0) != (input.cols == 0)) section.fail("rows", "and cols go together: set both or neither");
  if (input.rows == 1 || input.cols == 1)
    section.fail("rows", "and cols must be 2 or more; for a rope set source to polyline");
  if (input.source == TopologySource::AUTO && !body.topology_file.empty()) input.source = TopologySource::FILE;
  if (input.source == TopologySource::DEPTH_IMAGE && !body.topology_file.empty())
    section.fail("file", "has no meaning for a depth image, whose surface is made anew; remove it");
  if (input.source == TopologySource::FILE && body.topology_file.empty())
    section.fail("file", "is needed for source 'file'");
  if (input.source == TopologySource::POLYLINE && input.rows)
    section.fail("rows", "has no meaning for a polyline; remove rows and cols");
}

void readRigid(ParameterReader section, BodyConfig& body) {
  body.mesh_file = section.get("mesh", std::string());
  body.tf_frame = section.frame("frame");
  body.mesh_scale = section.number("scale", 1.0, 1e-6, 1e6);
  section.finish();
  if (body.mesh_file.empty()) section.fail("mesh", "is needed: a file (STL, OBJ, PLY, DAE) or a package:// path");
  if (body.tf_frame.empty()) section.fail("frame", "is needed: the tf frame that carries the mesh");
  body.body.rigid = true;
}

void readUncertainty(ParameterReader section, BodyConfig& body) {
  MeshInputConfig& input = body.input;
  refuseGone(section, "bodies/uncertainty/");
  input.noise_radius_m = section.number("radius_m", 0.0, 0, MAX_NOISE_M);
  input.noise_field = section.get("field", std::string());
  section.finish();
  if (!input.noise_field.empty() && body.isRigid()) {
    section.fail("field", "has no meaning for a rigid body, which sends no points; write radius_m instead");
  }
}

void readSource(ParameterReader& reader, const std::string& default_topic, BodyConfig& body) {
  refuseGone(reader, "bodies/");
  body.topic_named = reader.has("topic");
  body.topic = reader.get("topic", default_topic);
  std::vector<std::string> types{"auto"};
  for (const MeshType& type : meshTypes()) types.push_back(type.name);
  body.input.type = reader.choice("type", "auto", types);
  body.input.frame_id = reader.frame("frame_id");
  readTopology(reader.section("topology"), body);
  if (reader.has("marker")) {
    ParameterReader marker = reader.section("marker");
    if (marker.has("namespace")) body.input.marker_namespace = marker.get("namespace", std::string());
    if (marker.has("id")) body.input.marker_id = marker.integer("id", 0, -2147483647, 2147483647);
    marker.finish();
  }
  body.body.motion = choiceOf(reader, "motion", BodyMotionKind::STREAM, {"stream", "static"});
  body.input.is_static = body.body.motion == BodyMotionKind::STATIC;
  body.body.vertex_mask = reader.indices("vertex_mask");
  if (body.isDepthImage()) {
    // No vertex of one cloud is a vertex of the next, so there is no path between two, nor a number to mask.
    if (body.body.motion != BodyMotionKind::STATIC) {
      reader.fail("motion",
                  "must be static with topology/source depth_image: no point of a cloud has a path to the next");
    }
    if (!body.body.vertex_mask.empty()) reader.fail("vertex_mask", "has no meaning for a depth image; remove it");
    if (!body.sets.empty()) reader.fail("topology/sets", "have no meaning for a depth image; remove them");
  }
  if (reader.has("rigid")) readRigid(reader.section("rigid"), body);
  readUncertainty(reader.section("uncertainty"), body);
}

void readBodyEffects(ParameterReader& reader, const MonitorConfig& config, BodyConfig& body) {
  const bool self_asked = reader.has("self_collision");
  body.body.self_collision = reader.get("self_collision", !body.body.rigid && !body.isDepthImage());
  if (body.body.rigid && self_asked && body.body.self_collision) {
    reader.fail("self_collision", "is true, but the body is rigid and cannot meet itself; remove it");
  }
  if (body.isDepthImage() && body.body.self_collision) {
    reader.fail("self_collision",
                "is true, but a depth image is one view of a surface and cannot meet itself; remove it");
  }
  body.body.against_bodies = reader.get("against_bodies", true);
  body.body.against_obstacle = reader.get("against_obstacle", !body.isDepthImage());
  body.body.shell = reader.get("shell", false);
  body.body.minimum_separation_m = separationOf(reader, config.minimum_separation_m);
  body.body.own_voxels_m = ownVoxelsOf(reader, config.own_voxels_m);
}

void readBodySpeed(ParameterReader& reader, const MonitorConfig& config, BodyConfig& body) {
  const bool is_static = body.body.motion == BodyMotionKind::STATIC;
  body.speed = speedBoundOf(reader, config.speed);
  if (is_static) {
    if (reader.has("max_speed_m_s") && config.bodies_listed) {
      reader.fail("max_speed_m_s",
                  "has no meaning for a static body, which stands still until its next frame; remove it");
    }
    body.speed.max_m_s = 0;
  }
  body.speed.slows_down = reader.get("slows_down", true);
  const bool straight = !is_static && !body.isRigid();
  if (reader.has("carried_by") || reader.has("max_relative_speed_m_s")) {
    if (!straight) reader.fail("carried_by", "is for what deforms: tf says how fast a rigid body or a static one is");
    body.carried_by = reader.get("carried_by", std::string());
    body.speed.relative_m_s = reader.number("max_relative_speed_m_s", 0, LARGE);
  }
  if (!straight && reader.has("max_acceleration_m_s2") && config.bodies_listed) {
    reader.fail("max_acceleration_m_s2", std::string("has no meaning for a ") + (is_static ? "static" : "rigid") +
                                             " body, which does not go straight between two frames; remove it");
  }
  body.max_acceleration_m_s2 =
      straight ? reader.number("max_acceleration_m_s2", config.max_acceleration_m_s2, 0, LARGE) : 0;
}

void readBody(ParameterReader& reader, const std::string& name, const std::string& default_topic,
              MonitorConfig& config) {
  BodyConfig& body = config.bodies.emplace_back();
  body.body.name = name;
  readSource(reader, default_topic, body);
  readBodyEffects(reader, config, body);
  readBodySpeed(reader, config, body);
}

std::vector<std::string> namesOfBodies(const MonitorConfig& config) {
  std::vector<std::string> names{"octomap", "self"};
  for (const BodyConfig& body : config.bodies) names.push_back(body.body.name);
  for (std::string& name : namesOf(config.robot)) names.push_back(std::move(name));
  return names;
}

/// Two bodies, in either order, of an entry of minimum_separation_pairs.
using NamedPair = std::pair<std::uint16_t, std::uint16_t>;
using PairsBefore = std::map<NamedPair, std::size_t>;  // with the number of the entry

/// One entry of minimum_separation_pairs: {between: [felt, finger], separation_m: 0.004}; "octomap" is the map.
/// `before` are the pairs of the entries before it.
void readSeparationPair(ParameterReader entry, std::size_t number, MonitorConfig& config, PairsBefore& before) {
  const std::vector<Partners> pairs = readPartners(entry, config);
  if (!entry.has("separation_m")) entry.fail("separation_m", "is needed");
  const double separation_m = entry.number("separation_m", 0.0, 0, LARGE);
  entry.finish();
  for (const Partners& pair : pairs) {
    const auto [twice, is_new] = before.try_emplace(std::minmax(pair[0], pair[1]), number);
    if (!is_new) {
      const auto nameOf = [&](std::uint16_t body) {
        return body == OBSTACLE_BODY ? "octomap" : config.bodies[body].body.name;
      };
      entry.fail("between", "names " + nameOf(pair[0]) + " and " + nameOf(pair[1]) + ", as minimum_separation_pairs[" +
                                std::to_string(twice->second) + "] does; remove one of the two");
    }
    config.bodies[pair[0]].body.separations.push_back({pair[1], separation_m});
  }
}

}  // namespace

std::vector<Partners> readPartners(ParameterReader& entry, const MonitorConfig& config) {
  constexpr std::uint16_t SELF = OBSTACLE_BODY - 1;
  std::vector<std::vector<std::uint16_t>> sides;
  for (const ParameterTree& name : entry.list("between")) {
    const bool is_map = name.text == "octomap", is_self = name.text == "self";
    const auto bodies = is_map || is_self ? std::vector{is_map ? OBSTACLE_BODY : SELF} : bodiesNamed(name.text, config);
    if (!bodies) {
      entry.fail("between", "names '" + name.text + "', which is no body and not octomap; nearest is '" +
                                nearestName(name.text, namesOfBodies(config)) + "'");
    }
    sides.push_back(*bodies);
  }
  if (sides.size() != 2) {
    entry.fail("between", "must name two bodies, or one body and octomap; a body twice for itself");
  }
  const auto isNoBody = [&](std::size_t side) { return !sides[side].empty() && sides[side][0] >= SELF; };
  if (isNoBody(0)) std::swap(sides[0], sides[1]);
  if (isNoBody(0)) {
    const bool only_map = sides[0][0] == OBSTACLE_BODY && sides[1][0] == OBSTACLE_BODY;
    entry.fail("between", only_map ? "names octomap twice; name a body and octomap"
                                   : "names self without a body; name the body first");
  }
  std::vector<Partners> pairs;
  std::set<NamedPair> named;  // of a group with itself each pair comes twice
  for (const std::uint16_t one : sides[0]) {
    for (const std::uint16_t name : sides[1]) {
      const std::uint16_t other = name == SELF ? one : name;
      if (named.insert(std::minmax(one, other)).second) pairs.push_back({one, other});
    }
  }
  return pairs;
}

void readSeparationPairs(ParameterReader& reader, MonitorConfig& config) {
  PairsBefore before;
  std::size_t number = 0;
  for (const ParameterReader& entry : reader.sections("minimum_separation_pairs")) {
    readSeparationPair(entry, number++, config, before);
  }
}

void readBodies(ParameterReader& reader, MonitorConfig& config) {
  const std::string clock = reader.get("clock_body", std::string());
  const std::string default_topic = reader.get("default_topic", std::string("mesh"));  // no contradiction to bodies
  if (!reader.has("bodies")) {
    readBody(reader, "mesh", default_topic, config);
    if (config.bodies[0].isRigid()) reader.fail("rigid", "cannot be the only body; list bodies under ~bodies");
  } else {
    config.bodies_listed = true;
    if (reader.has("topic")) {
      reader.fail("topic", "has no place beside bodies; set bodies/NAME/topic instead");
    }
    if (reader.has("topology")) {
      reader.fail("topology",
                  "(topology:=, rows:= and cols:= of the launch files) has no place beside bodies; set "
                  "bodies/NAME/topology instead");
    }
    ParameterReader section = reader.section("bodies");
    for (const std::string& name : section.names()) {
      if (name == "octomap" || name == "self") {
        section.fail(name,
                     "is no name for a body: where pairs are named (between), octomap is the map, and self is "
                     "the body itself; give it another one");
      }
      ParameterReader one = section.section(name);
      readBody(one, name, name, config);
      one.finish();
      const bool rigid_off = settingOf(config.effects, Effect::RIGID_BODIES) == EffectSetting::OFF;
      if (!rigid_off || !config.bodies.back().isRigid()) continue;
      config.rigid_off.push_back(name);
      config.bodies.pop_back();
    }
    if (section.names().empty()) reader.fail("bodies", "is empty");
  }
  const auto has_clock = [&](const BodyConfig& body) {
    return !body.isRigid() && body.body.motion == BodyMotionKind::STREAM && (clock.empty() || clock == body.body.name);
  };
  const auto found = std::find_if(config.bodies.begin(), config.bodies.end(), has_clock);
  if (found == config.bodies.end()) {
    reader.fail("clock_body", clock.empty() ? "cannot be chosen: no body is a stream of meshes"
                                            : "is '" + clock + "', which is not a body with a stream of meshes");
  }
  config.monitor.clock_body = static_cast<std::size_t>(found - config.bodies.begin());
}

}  // namespace dccd
