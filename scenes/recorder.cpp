#include "scenes/recorder.h"

#include <algorithm>
#include <cmath>
#include <fstream>
#include <limits>
#include <optional>
#include <set>
#include <sstream>
#include <stdexcept>

#include <sensor_msgs/JointState.h>
#include <boost/make_shared.hpp>

#include "apps/output_bag.h"
#include "base/cloud_map.h"
#include "report/progress_bar.h"
#include "scenes/messages.h"
#include "scenes/physics/depth_camera.h"
#include "scenes/physics/shapes.h"
#include "scenes/physics/simulation.h"

namespace dccd {
namespace {

// Stamps count from here, not from the day of the recording, so that equal seeds give equal bags. Not zero, since a
// zero stamp means "unset" in ROS.
constexpr double START_STAMP_S = 1000.0;

/// Writes messages to a bag; latched topics carry the header that makes rosbag play latch them.
class SceneBag {
 public:
  explicit SceneBag(const std::string& path) : bag_(path) {}
  template <class Message>
  void write(const std::string& topic, const ros::Time& stamp, const Message& message, bool latched = false) {
    if (!latched) {
      bag_.write(topic, stamp, message);
      return;
    }
    auto header = boost::make_shared<ros::M_string>();
    (*header)["topic"] = topic;
    (*header)["type"] = ros::message_traits::datatype(message);
    (*header)["md5sum"] = ros::message_traits::md5sum(message);
    (*header)["message_definition"] = ros::message_traits::definition(message);
    (*header)["callerid"] = "/make_scene_bag";
    (*header)["latching"] = "1";
    bag_.write(topic, stamp, message, header);
  }
  void close() { bag_.close(); }

 private:
  OutputBag bag_;
};

std_msgs::Header header(const std::string& frame, const ros::Time& stamp, std::uint32_t seq) {
  std_msgs::Header result;
  result.frame_id = frame;
  result.stamp = stamp;
  result.seq = seq;
  return result;
}

/// As robot_state_publisher has them: of the links that joints move, or of all others.
void addLinks(const scene::Robot& robot, const std::string& fixed_frame, double time_s, bool moved, std_msgs::Header at,
              tf2_msgs::TFMessage& message) {
  const std::vector<Eigen::Isometry3d> poses = scene::posesInParents(robot, time_s);
  for (std::size_t l = 0; l < poses.size(); ++l) {
    const scene::Link& link = robot.links[l];
    if ((link.joint != scene::Link::Joint::FIXED) != moved) continue;
    at.frame_id = link.parent < 0 ? fixed_frame : robot.links[static_cast<std::size_t>(link.parent)].name;
    message.transforms.push_back(toTransform(at, link.name, poses[l]));
  }
}

/// Frames that the scene names beside the fixed one rest at its origin; rigid bodies' frames move.
void writeStaticTransforms(SceneBag& bag, const scene::SceneSpec& spec, const ros::Time& stamp) {
  std::set<std::string> frames;
  for (const scene::Body& body : spec.bodies) frames.insert(body.frame);
  if (spec.obstacle) frames.insert(spec.obstacle->frame);
  frames.erase(spec.fixed_frame);
  tf2_msgs::TFMessage message;
  for (const std::string& frame : frames) {
    message.transforms.push_back(toTransform(header(spec.fixed_frame, stamp, 0), frame, Eigen::Isometry3d::Identity()));
  }
  if (spec.camera) {
    message.transforms.push_back(
        toTransform(header(spec.fixed_frame, stamp, 0), spec.camera->frame, spec.camera->pose));
  }
  if (spec.robot) addLinks(*spec.robot, spec.fixed_frame, 0.0, false, header("", stamp, 0), message);
  if (!message.transforms.empty()) bag.write("/tf_static", stamp, message, true);
}

/// As joint_state_publisher has it.
void writeJointStates(SceneBag& bag, const scene::Robot& robot, double time_s, const std_msgs::Header& at) {
  sensor_msgs::JointState message;
  message.header = at;
  for (const scene::Link& link : robot.links) {
    if (link.joint == scene::Link::Joint::FIXED) continue;
    message.name.push_back(link.joint_name);
    message.position.push_back(scene::jointAt(link.keys, time_s));
  }
  bag.write("/joint_states", at.stamp, message);
}

void writeBody(SceneBag& bag, const scene::Body& body, const std_msgs::Header& at, const Positions& positions,
               const std::vector<Face>& faces) {
  switch (body.output) {
    case scene::MeshOutput::MESH_STAMPED:
      return bag.write(body.topic, at.stamp, toMeshStamped(at, positions, faces));
    case scene::MeshOutput::POINT_CLOUD_GRID:
      return bag.write(body.topic, at.stamp, toPointCloud(at, positions));
    case scene::MeshOutput::POLYGON_MESH:
      return bag.write(body.topic, at.stamp, toPolygonMesh(at, positions, faces));
    case scene::MeshOutput::MARKER:
      return bag.write(body.topic, at.stamp, toMarkers(at, positions, faces));
  }
}

/// Writes what the scene's camera sees, and the map of all that it saw.
class CameraRecorder {
 public:
  CameraRecorder(SceneBag& bag, const scene::SceneSpec& spec, bool binary)
      : bag_(bag), spec_(spec), binary_(binary), camera_(spec), map_({spec.obstacle->resolution_m}) {}

  /// Takes the clouds of the solids alone.
  void seeSolids(const ros::Time& start) {
    for (int i = spec_.camera->empty_clouds; i > 0; --i) {
      take(scene::SceneState{}, start - ros::Duration(i / spec_.camera->rate_hz));
    }
  }
  /// Takes a cloud of the frame if one is due.
  void see(const scene::Simulation& simulation, const ros::Time& stamp) {
    // Half a microsecond: what is due with a frame is not late by rounding.
    const double due = (simulation.time_s() + 5e-7) * spec_.camera->rate_hz;
    if (due < next_) return;
    scene::SceneState state;
    for (std::size_t b = 0; b < spec_.bodies.size(); ++b) state.bodies.push_back(simulation.positions(b));
    for (std::size_t r = 0; r < spec_.rigid_bodies.size(); ++r) state.rigid_bodies.push_back(simulation.rigidPose(r));
    if (spec_.robot) state.links = scene::linkPoses(*spec_.robot, simulation.time_s());
    take(state, stamp);
    next_ = static_cast<int>(std::floor(due)) + 1;
  }

 private:
  void take(const scene::SceneState& state, const ros::Time& stamp) {
    const scene::Camera& camera = *spec_.camera;
    const std::vector<Eigen::Vector3f> points = camera_.look(state);
    const ros::Time told = stamp + ros::Duration(camera.lag_s);
    const auto seq = static_cast<std::uint32_t>(clouds_++);
    bag_.write(camera.topic, told, toImageCloud(header(camera.frame, stamp, seq), points, camera.width));
    SensorView view;
    view.map_from_sensor = camera.pose;
    view.width = static_cast<std::size_t>(camera.width);
    view.height = points.size() / view.width;
    view.xyz = points.data()->data();
    map_.insert(view, std::numeric_limits<std::size_t>::max());
    bag_.write(spec_.obstacle->topic, told,
               toOctomap(header(spec_.obstacle->frame, stamp, seq), spec_.obstacle->resolution_m,
                         map_.serialized(binary_), binary_));
  }

  SceneBag& bag_;
  const scene::SceneSpec& spec_;
  bool binary_;
  scene::DepthCamera camera_;
  CloudMap map_;
  int next_ = 0;    // cloud of the scene, counted at the camera's rate
  int clouds_ = 0;  // taken
};

/// The same time in frames of another length; physics takes no longer steps than before.
void overrideRate(scene::SceneSpec& spec, double rate_hz) {
  const double steps_hz = spec.frame_rate_hz * spec.substeps, duration_s = (spec.frames - 1) / spec.frame_rate_hz;
  const double steps = std::round(duration_s * rate_hz);
  if (!(steps >= 1 && steps < 1e6)) {
    throw std::runtime_error("--rate is too " + std::string(steps < 1 ? "low" : "high") + " for a scene of " +
                             std::to_string(duration_s) + " s");
  }
  spec.frames = static_cast<int>(steps) + 1;
  spec.substeps = static_cast<int>(std::ceil(steps_hz / rate_hz));
  spec.frame_rate_hz = rate_hz;
}

void overrideOutput(scene::SceneSpec& spec, const std::string& output) {
  if (output.empty()) return;
  const auto named = std::find(scene::MESH_OUTPUTS.begin(), scene::MESH_OUTPUTS.end(), output);
  for (scene::Body& body : spec.bodies) {
    body.output = static_cast<scene::MeshOutput>(named - scene::MESH_OUTPUTS.begin());
    if (body.shape.kind == scene::Shape::Kind::ROPE && body.output != scene::MeshOutput::POINT_CLOUD_GRID) {
      throw std::runtime_error("--output " + output + ": body '" + body.name +
                               "' is a rope and has no faces; use point_cloud_grid");
    }
  }
}

std::string summary(const scene::SceneSpec& spec, const scene::Simulation& simulation, const std::string& bag_path) {
  std::ostringstream text;
  text << spec.name << ": " << spec.frames << " frames at " << spec.frame_rate_hz << " Hz in " << bag_path << "\n";
  for (const scene::Body& body : spec.bodies) {
    text << "  " << body.topic << ": " << body.shape.rows * body.shape.cols << " vertices\n";
  }
  if (spec.camera) {
    text << "  " << spec.camera->topic << ": clouds of " << spec.camera->width << " x " << spec.camera->height << " at "
         << spec.camera->rate_hz << " Hz, their map on " << spec.obstacle->topic << ", the true one on "
         << spec.camera->truth_topic << "\n";
  }
  text << "  physics:";
  for (const std::string& effect : simulation.effects()) {
    text << " " << effect << (&effect == &simulation.effects().back() ? "" : ",");
  }
  text << "\n";
  return text.str();
}

}  // namespace

std::string recordScene(const scene::SceneSpec& scene_spec, const std::string& bag_path,
                        const RecorderOptions& options) {
  scene::SceneSpec spec = scene_spec;
  if (options.rate_hz > 0) overrideRate(spec, options.rate_hz);
  if (options.frames > 0) spec.frames = options.frames;
  overrideOutput(spec, options.output);
  scene::Simulation simulation(spec, options.seed);
  std::vector<std::vector<Face>> faces;
  for (const scene::Body& body : spec.bodies) faces.push_back(scene::shapeFaces(body.shape));

  SceneBag bag(bag_path);
  const ros::Time start(START_STAMP_S);
  // The first thing in the bag, though a camera may have been there before the bodies.
  const ros::Time begin = start - ros::Duration(spec.camera ? spec.camera->empty_clouds / spec.camera->rate_hz : 0.0);
  writeStaticTransforms(bag, spec, begin);
  const bool binary = spec.obstacle && spec.obstacle->binary && !options.full_octomap;
  if (spec.obstacle) {
    bag.write(spec.camera ? spec.camera->truth_topic : spec.obstacle->topic, begin,
              toOctomap(header(spec.obstacle->frame, begin, 0), *spec.obstacle, binary), true);
  }
  std::optional<CameraRecorder> camera;
  if (spec.camera) camera.emplace(bag, spec, binary).seeSolids(start);
  ProgressBar progress(spec.name, static_cast<std::size_t>(spec.frames), !options.quiet);
  for (int frame = 0; frame < spec.frames; ++frame) {
    if (frame > 0) simulation.step();
    const ros::Time stamp(START_STAMP_S + frame / spec.frame_rate_hz);
    tf2_msgs::TFMessage transforms;
    for (std::size_t r = 0; r < spec.rigid_bodies.size(); ++r) {
      transforms.transforms.push_back(
          toTransform(header(spec.fixed_frame, stamp, frame), spec.rigid_bodies[r].frame, simulation.rigidPose(r)));
    }
    if (spec.robot) {
      const std_msgs::Header at = header("", stamp, frame);
      writeJointStates(bag, *spec.robot, simulation.time_s(), at);
      addLinks(*spec.robot, spec.fixed_frame, simulation.time_s(), true, at, transforms);
    }
    if (!transforms.transforms.empty()) bag.write("/tf", stamp, transforms);
    for (std::size_t b = 0; b < spec.bodies.size(); ++b) {
      writeBody(bag, spec.bodies[b], header(spec.bodies[b].frame, stamp, frame), simulation.positions(b), faces[b]);
    }
    if (camera) camera->see(simulation, stamp);
    progress.advance();
  }
  bag.close();
  if (!options.monitor_config_path.empty()) {
    std::ofstream config(options.monitor_config_path);
    config << "# Parameters of the monitor for the scene " << spec.name << "\n" << spec.monitor_yaml << "\n";
    config.close();
    if (!config) throw std::runtime_error(options.monitor_config_path + ": cannot be written");
  }
  return summary(spec, simulation, bag_path);
}

std::string recordMap(const scene::Obstacle& obstacle, const std::string& path) {
  const octomap_msgs::Octomap map = toOctomap({}, obstacle, true);
  std::size_t nodes = 1;  // the root, and two bits for each child of a node that has children; 0: there is none
  for (const std::int8_t byte : map.data) {
    for (int shift = 0; shift < 8; shift += 2) nodes += ((byte >> shift) & 3) != 0;
  }
  std::ofstream file(path, std::ios::binary);
  file << "# Octomap OcTree binary file\nid " << map.id << "\nsize " << nodes << "\nres " << map.resolution
       << "\ndata\n";
  file.write(reinterpret_cast<const char*>(map.data.data()), static_cast<std::streamsize>(map.data.size()));
  file.close();
  if (!file) throw std::runtime_error(path + ": cannot be written");
  return path + ": a map of " + std::to_string(nodes) + " nodes, voxels of " + std::to_string(map.resolution) + " m\n";
}

}  // namespace dccd
