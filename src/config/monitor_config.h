// Every parameter of the monitor, read and checked once. The node reads it from the parameter server, analyze_bag from
// a YAML file; both see the same names, defaults and errors. doc/interface.md is the table for people.
#pragma once

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include <xmlrpcpp/XmlRpcValue.h>

#include "base/cloud_map.h"
#include "base/effect_plan.h"
#include "config/parameter_reader.h"
#include "config/robot_config.h"
#include "dccd/monitor_extras.h"
#include "dccd/stream.h"
#include "input/mesh_decoder.h"

namespace dccd {

enum class UnknownSpace : std::uint8_t { FREE, OCCUPIED };
enum class QueuePolicy : std::uint8_t { NEWEST, OLDEST, THIN };
struct BodyConfig {
  Body body;
  std::string topic;         ///< streams and static meshes
  bool topic_named = false;  ///< by a parameter; the node knows of remappings, too (node/named_inputs.h)
  MeshInputConfig input;
  std::string topology_file;
  /// Vertices by name: topology/sets, and, once files are loaded, the groups of an OBJ.
  std::map<std::string, std::vector<Index>> sets;
  // Rigid bodies: no topic, but a mesh file that a tf frame carries.
  std::string mesh_file;
  std::string tf_frame;
  double mesh_scale = 1;
  SpeedBound speed;                               ///< after a step; of a static body 0
  std::string carried_by;                         ///< the frame that does; empty: none is named
  double max_acceleration_m_s2 = 0;               ///< between two frames no vertex has more; 0: nobody says
  std::shared_ptr<const MeshResource> link_mesh;  ///< of a robot's link it is made already
  bool isRigid() const { return body.rigid; }
  bool isDepthImage() const { return input.source == TopologySource::DEPTH_IMAGE; }
  bool hasNoise() const { return !input.noise_field.empty() || input.noise_radius_m > 0; }
  bool isUncertain() const { return hasNoise() || max_acceleration_m_s2 > 0; }
};

/// A topic of clouds, or of depth pictures, that become part of the map. More than one view may be on it: a sensor is
/// told by the topic and the frame_id of its messages.
struct CloudSource {
  std::string topic;
  std::string camera_info;   ///< topic of a depth picture's CameraInfo; empty: camera_info beside the picture's
  std::string sensor_frame;  ///< where the sensor is whose clouds come in the map's own frame; empty: nobody says
};

/// The parameters under `intent`: of ~intended.
struct IntentConfig {
  double horizon_s = 0;  ///< how long a twist is held, and how far ahead a trajectory is looked at
  double deviation_m = 0, deviation_rate_m_s = 0;
};

/// The parameters under `limits`: of ~limits.
struct LimitsConfig {
  double max_m = 0, horizon_s = 0;
};

struct MarkerConfig {
  double point_size_m = 0.01;
  int max_contacts = 2000;  ///< the first ones are shown
  bool mesh = false;        ///< republish the bodies as markers
  double obstacle_m = 0;    ///< show the map's voxels this close to the box around the bodies [m]; 0: none
  double normalLength() const { return 5 * point_size_m; }
  double lineWidth() const { return point_size_m / 5; }
  double clearance_max_m = ClearanceOptions().max_m;  ///< distances of this and more are green [m]
};

constexpr std::size_t NO_MAP_LIMIT = std::size_t{1} << 50;

/// Where a map is looked for that nobody named.
constexpr const char* DEFAULT_OCTOMAP_TOPIC = "octomap_binary";
/// Where a sensor's clouds are looked for that somebody named without a topic.
constexpr const char* DEFAULT_CLOUD_TOPIC = "obstacle_cloud";

/// What depth cameras send for "nothing" lies at the sensor.
constexpr double DEFAULT_MIN_RANGE_M = 0.01;

struct MonitorConfig {
  std::string fixed_frame;         ///< empty: the frame of the clock body's first message
  std::vector<BodyConfig> bodies;  ///< the robot's links come last
  bool bodies_listed = false;      ///< under bodies/, each with its own topic
  /// Bodies that effects/rigid_bodies leaves out: their files are not read, their frames not asked for.
  std::vector<std::string> rigid_off;
  Robot robot;
  RobotConfig robot_asked;                  ///< what it was made of
  std::vector<std::string> robot_excluded;  ///< what of it is left out by choice: a sentence each
  MonitorOptions monitor;
  EffectSettings effects;
  double minimum_separation_m = 0;     ///< of bodies that name none
  double own_voxels_m = 0;             ///< the same
  SpeedBound speed;                    ///< the same
  double max_acceleration_m_s2 = 0;    ///< the same
  std::optional<SpeedLaw> speed_law;   ///< of ~speed_scale; none: nobody asks for it
  std::optional<IntentConfig> intent;  ///< of ~intended; none: nobody listens to it
  std::optional<LimitsConfig> limits;  ///< of ~limits; none: it is off
  /// Of all phases. A partner's set that has a name but no vertices yet is looked up when the files are loaded.
  std::vector<Expectation> expected_contacts;
  std::vector<std::size_t> expected_entry;   ///< of each of these: which entry of the parameter it is from
  std::vector<std::string> expected_phases;  ///< that entries name, whether their bodies are there or not
  std::string phase;                         ///< of the task, in force; empty: none
  std::vector<Hold> holds;
  UnknownSpace unknown_space = UnknownSpace::FREE;
  Box unknown_box;  ///< [m], map frame: where the unknown is occupied
  std::string octomap_topic = DEFAULT_OCTOMAP_TOPIC, octomap_file, octomap_frame;
  bool octomap_topic_named = false;                                ///< as BodyConfig::topic_named
  std::vector<CloudSource> clouds{{DEFAULT_CLOUD_TOPIC, {}, {}}};  ///< that are made a map; one or more
  bool cloud_named = false;                                        ///< they are called for: by any parameter of theirs
  CloudMapOptions cloud_map;
  std::size_t max_map_bytes = std::size_t{512} << 20;     ///< see limitLive(); NO_MAP_LIMIT: none
  std::size_t max_memory_bytes = std::size_t{512} << 20;  ///< see limitLive()
  std::size_t max_queue_bytes = 0;                        ///< a quarter of it where it holds; 0: no limit
  double transform_timeout_s = 0.2;
  double answer_timeout_s = 0.5;
  std::size_t queue_size = 8;
  QueuePolicy queue_policy = QueuePolicy::NEWEST;
  std::size_t record_steps = 1;  ///< steps that the flight recorder keeps; 0: off
  MarkerConfig markers;
  std::uint64_t given_hash = 0;  ///< of the parameters as they were given, without ~live, which the node writes back
  /// The bodies as the monitor is given them.
  std::vector<Body> monitorBodies() const;
  /// Those of expected_phases, each once, in order.
  std::vector<std::string> phases() const;
  /// "known phases are 'carry' and 'grasp', and '' for none".
  std::string phasesInWords() const;
  /// What is expected in that phase, and of what hands hold now.
  std::vector<Expectation> expectedIn(const std::string& some_phase) const;
  std::vector<Expectation> held() const;  ///< of what is expected, what closed hands hold
  /// The map is made of clouds.
  bool takesClouds() const { return cloud_named; }
  /// octomap_file in the place of a live map, not beside it.
  bool takesMapFileAlone() const { return !octomap_file.empty() && !octomap_topic_named && !cloud_named; }
  /// Its file, or the topics of its messages or of its clouds, as the parameters have it.
  std::string mapName() const;
  std::vector<std::string> liveMapNames() const;  ///< topics
  /// Throws ParameterError where both a map and clouds are named: there is one map.
  void checkMapNames() const;
  /// The map is called for: a step without one lacks it. Else it is used when it is there.
  bool namesOctomap() const;
  bool ownsVoxels() const {
    return std::any_of(bodies.begin(), bodies.end(), [](const BodyConfig& b) { return dccd::ownsVoxels(b.body); });
  }
  /// Free leaves of maps are asked for, too.
  bool needsKnownSpace() const { return unknown_space != UnknownSpace::FREE || ownsVoxels(); }
  /// A separation or an uncertainty is asked for, so that only conservative will do.
  bool holdsDistance() const;
  /// Some body has a speed bound, and distances may be computed: ~safe_until is there.
  bool promises() const;
  /// By body of the monitor, behind those of the configuration what is attached: it moves with a link.
  std::vector<SpeedBound> speedBounds(std::size_t count) const;
  /// Of what was given and of the values in force that can be changed live: equal for two monitors that do the same.
  std::uint64_t hash() const;
};

/// What can be changed while the node runs: LIVE(its name in cfg/CollisionMonitor.cfg, where MonitorConfig has it).
#define DCCD_LIVE_SETTINGS(LIVE)                           \
  LIVE(accuracy, monitor.detector.accuracy.rung)           \
  LIVE(step_budget_ms, monitor.detector.step_budget_ms)    \
  LIVE(max_step_s, monitor.store.max_step_s)               \
  LIVE(max_vertex_step_m, monitor.store.max_vertex_step_m) \
  LIVE(max_contacts, monitor.detector.max_contacts)        \
  LIVE(marker_point_size_m, markers.point_size_m)          \
  LIVE(marker_mesh, markers.mesh)                          \
  LIVE(marker_obstacle_m, markers.obstacle_m)

/// Throws ParameterError naming the parameter. `path` leads the names in messages, "~" for a node.
MonitorConfig readConfig(const XmlRpc::XmlRpcValue& tree, const std::string& path = "~", const RobotLoader& load = {});
MonitorConfig readConfig(const ParameterTree& tree, const std::string& path, const RobotLoader& load = {});
/// What bounds a live node's steps, from max_memory_mb and max_map_mb, defaults included. Elsewhere a
/// limit that was not given is none, so that no answer depends on a clock.
void limitLive(MonitorConfig& config);

}  // namespace dccd
