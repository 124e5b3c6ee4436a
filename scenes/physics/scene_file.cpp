#include "scenes/physics/scene_file.h"

#include <algorithm>
#include <numeric>

#include "scenes/physics/shapes.h"

namespace dccd::scene {
namespace {

constexpr double LARGE = 1e6;  // beyond any scene, within what Bullet's solvers stay stable at

Shape readShape(ParameterReader map, Shape::Kind kind) {
  Shape shape;
  shape.kind = kind;
  if (kind == Shape::Kind::ROPE) {
    shape.cols = map.integer("points", 2, 10000);
    shape.size_m = Vec3(map.number("length_m", 1e-3, 1e3), 0.0, 0.0);
  } else {
    const bool sheet = kind == Shape::Kind::SHEET;
    shape.rows = map.integer("rows", 2, 1000);
    shape.cols = map.integer("cols", sheet ? 2 : 3, 1000);
    shape.size_m = sheet ? map.numbers("size_m", 2, 1e-3, 1e3)
                         : Vec3(map.number("radius_m", 1e-3, 1e3), map.number("length_m", 1e-3, 1e3), 0.0);
  }
  shape.center_m = map.vector("center_m");
  shape.rotation_rad = map.vector("rotation_rad", Vec3::Zero());
  map.finish();
  return shape;
}

Motion readMotion(ParameterReader& parent) {
  Motion motion;
  for (ParameterReader& map : parent.sections("motion")) {
    MotionKey key;
    key.time_s = map.number("time_s", 0.0, LARGE);
    key.offset_m = map.vector("offset_m", Vec3::Zero());
    key.rotation_rad = map.vector("rotation_rad", Vec3::Zero());
    if (!motion.empty() && key.time_s <= motion.back().time_s)
      map.fail("time_s", "must be later than that of the key before");
    map.finish();
    motion.push_back(key);
  }
  return motion;
}

Gripper readGripper(ParameterReader map, const Shape& shape, std::optional<Robot>& robot) {
  Gripper gripper;
  const bool by_row = map.has("row"), by_col = map.has("col"), by_vertex = map.has("vertices");
  if (by_row + by_col + by_vertex != 1) map.fail("", "needs just one of row, col, vertices: what the gripper holds");
  if (by_row) {
    const int row = map.integer("row", 0, shape.rows - 1);
    gripper.vertices.resize(static_cast<std::size_t>(shape.cols));
    std::iota(gripper.vertices.begin(), gripper.vertices.end(), row * shape.cols);
  } else if (by_col) {
    const int col = map.integer("col", 0, shape.cols - 1);
    for (int row = 0; row < shape.rows; ++row) gripper.vertices.push_back(row * shape.cols + col);
  } else {
    gripper.vertices = map.integers("vertices", 0, shape.rows * shape.cols - 1);
  }
  gripper.motion = readMotion(map);
  if (map.has("link")) {
    gripper.link = map.text("link");
    if (!robot) map.fail("link", "has no meaning without a robot; write one, or a motion");
    if (!gripper.motion.empty()) map.fail("motion", "contradicts link; remove one of the two");
    robot->named_links.push_back(gripper.link);
    gripper.grasp_s = map.number("grasp_s", 0.0, 0.0, LARGE);
  }
  if (map.has("release_s")) gripper.release_s = map.number("release_s", 0.0, LARGE);
  map.finish();
  return gripper;
}

Body readBody(ParameterReader map, const std::string& fixed_frame, std::optional<Robot>& robot) {
  Body body;
  body.name = map.text("name");
  body.topic = map.text("topic", "/" + body.name);
  body.frame = map.text("frame", fixed_frame);
  const std::string output = map.choice("output", MESH_OUTPUTS[0], MESH_OUTPUTS);
  body.output =
      static_cast<MeshOutput>(std::find(MESH_OUTPUTS.begin(), MESH_OUTPUTS.end(), output) - MESH_OUTPUTS.begin());
  const bool sheet = map.has("sheet"), tube = map.has("tube"), rope = map.has("rope");
  if (sheet + tube + rope != 1) map.fail("", "needs just one of sheet, tube, rope: the body's shape");
  body.shape = sheet  ? readShape(map.section("sheet"), Shape::Kind::SHEET)
               : tube ? readShape(map.section("tube"), Shape::Kind::TUBE)
                      : readShape(map.section("rope"), Shape::Kind::ROPE);
  if (rope && body.output != MeshOutput::POINT_CLOUD_GRID)
    map.fail("output", "must be point_cloud_grid: a rope has no faces");
  body.mass_kg = map.number("mass_kg", 1e-6, LARGE);
  body.thickness_m = map.number("thickness_m", body.thickness_m, 1e-5, 1.0);
  body.damping = map.number("damping", 0.0, 0.0, 1.0);
  body.start_noise_m = map.number("start_noise_m", 0.0, 0.0, 1.0);
  if (map.has("bending")) {
    ParameterReader bending = map.section("bending");
    body.bending = bending.number("stiffness", 0.0, 1.0);
    bending.finish();
  }
  if (map.has("self_collision")) {
    if (rope) map.fail("self_collision", "needs faces, and a rope has none; leave it out");
    ParameterReader self_collision = map.section("self_collision");
    body.self_collision = self_collision.integer("clusters", 64, 2, 10000);
    self_collision.finish();
  }
  if (map.has("friction")) body.friction = map.number("friction", 0.0, 1.0);
  for (ParameterReader& gripper : map.sections("grippers"))
    body.grippers.push_back(readGripper(gripper, body.shape, robot));
  map.finish();
  return body;
}

Solid readSolid(ParameterReader map) {
  Solid solid;
  const bool box = map.has("box"), ring = map.has("ring");
  if (box + ring != 1) map.fail("", "needs just one of box, ring");
  if (box) {
    ParameterReader inner = map.neededSection("box");
    solid.box.min = inner.vector("min_m");
    solid.box.max = inner.vector("max_m");
    if (!(solid.box.min.array() < solid.box.max.array()).all())
      inner.fail("max_m", "must be above min_m on every axis");
    inner.finish();
  } else {
    solid.kind = Solid::Kind::RING;
    ParameterReader inner = map.neededSection("ring");
    solid.center_m = inner.vector("center_m");
    solid.axis = inner.vector("axis", Vec3::UnitZ());
    if (solid.axis.norm() < 1e-6) inner.fail("axis", "is zero; write a direction");
    solid.axis.normalize();
    solid.radius_m = inner.number("radius_m", 1e-3, 1e3);
    solid.tube_radius_m = inner.number("tube_radius_m", 1e-4, solid.radius_m);
    inner.finish();
  }
  map.finish();
  return solid;
}

Obstacle readObstacle(ParameterReader map, const std::string& fixed_frame) {
  Obstacle obstacle;
  obstacle.topic = map.text("topic", "/octomap_binary");
  obstacle.frame = map.text("frame", fixed_frame);
  obstacle.resolution_m = map.number("resolution_m", 1e-3, 10.0);
  obstacle.binary = map.get("binary", true);
  obstacle.collides = map.get("collides", false);
  obstacle.inset_m = map.number("inset_m", 0.0, 0.0, 1.0);
  for (ParameterReader& solid : map.sections("solids")) obstacle.solids.push_back(readSolid(solid));
  if (obstacle.solids.empty())
    map.fail("solids", "must hold at least one solid (box or ring); or leave the obstacle out");
  map.finish();
  return obstacle;
}

RigidBody readRigidBody(ParameterReader map) {
  RigidBody body;
  if (map.has("self_collision"))
    map.fail("self_collision", "has no meaning: the body is rigid and cannot meet itself; remove this line");
  body.name = map.text("name");
  body.frame = map.text("frame", body.name);
  body.size_m = map.numbers("size_m", 3, 1e-4, 1e3);
  body.start_m = map.vector("start_m");
  body.motion = readMotion(map);
  map.finish();
  return body;
}

Robot readRobot(ParameterReader map) {
  Robot robot;
  robot.description = map.text("description");
  robot.base_m = map.vector("base_m", Vec3::Zero());
  ParameterReader joints = map.section("joints");
  for (const std::string& name : joints.names()) {
    for (ParameterReader& key : joints.sections(name)) {
      std::vector<JointKey>& keys = robot.joints[name];
      keys.push_back({key.number("time_s", 0.0, LARGE), key.number("position", -LARGE, LARGE)});
      if (keys.size() > 1 && keys.back().time_s <= keys[keys.size() - 2].time_s)
        key.fail("time_s", "must be later than that of the key before");
      key.finish();
    }
  }
  map.finish();
  return robot;
}

Eigen::Isometry3d readCameraPose(ParameterReader& map) {
  const bool aimed = map.has("looks_at_m"), turned = map.has("quaternion");
  if (aimed + turned != 1) map.fail("", "needs just one of looks_at_m, quaternion: where it looks");
  const Vec3 position_m = map.vector("position_m");
  Eigen::Isometry3d pose(Eigen::Translation3d{position_m});
  if (turned) {
    const ParameterTree& list = map.raw("quaternion");
    if (list.items.size() != 4) map.fail("quaternion", "must be a list of 4 numbers: x, y, z, w");
    const std::vector<double> q = map.numbers(list, "quaternion", 4);
    const Eigen::Quaterniond turn(q[3], q[0], q[1], q[2]);
    if (turn.norm() < 1e-6) map.fail("quaternion", "is zero; write x, y, z, w of the optical frame");
    pose.linear() = turn.normalized().toRotationMatrix();
    return pose;
  }
  const Vec3 way_m = map.vector("looks_at_m") - position_m;
  if (way_m.norm() < 1e-6) map.fail("looks_at_m", "is where the camera is; write a place before it");
  const Vec3 forward = way_m.normalized();
  // Upright; a camera that looks straight up or down has the fixed frame's x to its right.
  const Vec3 right = forward.cross(Vec3::UnitZ()).norm() < 1e-6 ? Vec3(Vec3::UnitX())
                                                                : Vec3(forward.cross(Vec3::UnitZ()).normalized());
  pose.linear() << right, forward.cross(right), forward;
  return pose;
}

/// Of a camera, what others have as well.
void checkCameraNames(ParameterReader& map, const Camera& camera, const SceneSpec& spec) {
  std::vector<std::string> topics{spec.obstacle->topic}, frames{spec.obstacle->frame, spec.fixed_frame};
  for (const Body& body : spec.bodies) {
    topics.push_back(body.topic);
    frames.push_back(body.frame);
  }
  for (const RigidBody& body : spec.rigid_bodies) frames.push_back(body.frame);
  const auto isIn = [](const std::string& name, const std::vector<std::string>& others) {
    return std::find(others.begin(), others.end(), name) != others.end();
  };
  if (isIn(camera.topic, topics)) map.fail("topic", "is another's, too; write a topic of its own");
  topics.push_back(camera.topic);
  if (isIn(camera.truth_topic, topics)) map.fail("truth_topic", "is another's, too; write a topic of its own");
  if (isIn(camera.frame, frames)) map.fail("frame", "is another's, too; write a frame of its own");
}

Camera readCamera(ParameterReader map, const SceneSpec& spec) {
  if (!spec.obstacle) map.fail("", "needs an obstacle, whose topic and resolution its map has; write one");
  Camera camera;
  camera.topic = map.text("topic", "/camera/points");
  camera.truth_topic = map.text("truth_topic", "/truth/octomap");
  camera.frame = map.text("frame", "camera");
  camera.pose = readCameraPose(map);
  camera.width = map.integer("width", 1, 4096);
  camera.height = map.integer("height", 1, 4096);
  camera.field_of_view_rad = map.number("field_of_view_rad", 0.01, 3.0);
  camera.rate_hz = map.number("rate_hz", 0.01, spec.frame_rate_hz);
  camera.noise_m = map.number("noise_m", 0.0, 0.0, 1.0);
  camera.lost_share = map.number("lost_share", 0.0, 0.0, 1.0);
  camera.flying_share = map.number("flying_share", 0.0, 0.0, 1.0);
  camera.lag_s = map.number("lag_s", 0.0, 0.0, 60.0);
  camera.empty_clouds = map.integer("empty_clouds", 0, 0, 1000);
  if (camera.empty_clouds > 600 * camera.rate_hz)
    map.fail("empty_clouds", "take more than 600 s at rate_hz; write fewer or a higher rate_hz");
  camera.inset_m = map.number("inset_m", 0.0, 0.0, 1.0);
  camera.seed = map.integer("seed", camera.seed, 0, 1000000000);
  checkCameraNames(map, camera, spec);
  for (const Solid& solid : spec.obstacle->solids) {
    if (contains(solid, camera.pose.translation()))
      map.fail("position_m", "lies in a solid of the obstacle; write a place outside");
    if (empty(shrunk(solid, camera.inset_m)))
      map.fail("inset_m", "leaves nothing of a solid of the obstacle; write less than half of its smallest size");
  }
  map.finish();
  return camera;
}

Wind readWind(ParameterReader map) {
  Wind wind;
  wind.velocity_m_s = map.vector("velocity_m_s");
  wind.drag = map.number("drag", 0.0, LARGE);
  wind.lift = map.number("lift", 0.0, 0.0, LARGE);
  wind.gust = map.number("gust", 0.0, 0.0, 10.0);
  wind.gust_period_s = map.number("gust_period_s", wind.gust_period_s, 0.01, LARGE);
  map.finish();
  return wind;
}

/// One body of the monitor's block, held against the body of the scene on its topic.
void checkMonitorBody(ParameterReader map, const SceneSpec& spec) {
  ParameterReader topology = map.section("topology");
  if (!map.has("topic") || !topology.has("rows")) return;
  const int rows = topology.integer("rows", 2, 100000), cols = topology.integer("cols", 2, 100000);
  for (const Body& body : spec.bodies) {
    const int points = body.shape.rows * body.shape.cols;
    if (body.topic != map.text("topic") || rows * cols == points) continue;
    topology.fail("rows", "and cols are " + std::to_string(rows) + " x " + std::to_string(cols) + " = " +
                              std::to_string(rows * cols) + ", but " + body.name + " has " + std::to_string(points) +
                              " points; write rows: " + std::to_string(body.shape.rows) +
                              ", cols: " + std::to_string(body.shape.cols));
  }
}

/// What contradicts the scene. All else that is wrong with the block the monitor says that the tool makes of it.
void checkMonitor(ParameterReader& scene, const SceneSpec& spec) {
  ParameterReader bodies = scene.section("monitor").section("bodies");
  for (const std::string& name : bodies.names()) checkMonitorBody(bodies.section(name), spec);
}

SceneSpec readScene(const ParameterTree& tree) {
  ParameterReader map(tree, "");
  SceneSpec spec;
  if (!map.has("bodies"))
    map.fail("bodies", "is needed: what moves in this scene; for the map alone let the output end in .bt");
  spec.name = map.text("name");
  spec.description = map.text("description");
  spec.fixed_frame = map.text("fixed_frame", "world");
  spec.frame_rate_hz = map.number("frame_rate_hz", spec.frame_rate_hz, 0.1, 1000.0);
  spec.frames = map.integer("frames", 2, 1000000);
  ParameterReader physics = map.neededSection("physics");
  spec.substeps = physics.integer("substeps", spec.substeps, 1, 1000);
  if (physics.has("gravity_m_s2")) spec.gravity_m_s2 = physics.vector("gravity_m_s2");
  if (physics.has("wind")) spec.wind = readWind(physics.section("wind"));
  physics.finish();
  if (map.has("robot")) spec.robot = readRobot(map.section("robot"));
  for (ParameterReader& body : map.sections("bodies")) {
    spec.bodies.push_back(readBody(body, spec.fixed_frame, spec.robot));
    for (std::size_t i = 0; i + 1 < spec.bodies.size(); ++i) {
      if (spec.bodies[i].topic == spec.bodies.back().topic)
        body.fail("topic", "is another body's, too; write a topic of its own");
    }
  }
  if (spec.bodies.empty()) map.fail("bodies", "must hold at least one body: what moves in this scene");
  if (map.has("obstacle")) spec.obstacle = readObstacle(map.section("obstacle"), spec.fixed_frame);
  for (ParameterReader& body : map.sections("rigid_bodies")) spec.rigid_bodies.push_back(readRigidBody(body));
  if (map.has("camera")) spec.camera = readCamera(map.section("camera"), spec);
  checkMonitor(map, spec);
  map.raw("expect");  // of the monitor: scripts/lib/scene_story.py reads it, and says what of it is not known
  spec.monitor = map.raw("monitor");
  spec.monitor.file = tree.file;
  map.finish();
  return spec;
}

}  // namespace

SceneSpec parseScene(const std::string& text, const std::string& name) {
  SceneSpec spec = readScene(parseYaml(text, name));
  spec.monitor_yaml = yamlBelow(text, "monitor");
  return spec;
}

Obstacle readObstacleFile(const std::string& path) {
  ParameterReader map(parseYaml(yamlText(path, "a file with an obstacle, such as examples/box.yaml"), path), "");
  if (map.has("bodies")) {
    const SceneSpec spec = readSceneFile(path);
    if (!spec.obstacle) map.fail("obstacle", "is missing: the scene has no map");
    return *spec.obstacle;
  }
  const std::string fixed_frame = map.text("fixed_frame", "world");
  const Obstacle obstacle = readObstacle(map.neededSection("obstacle"), fixed_frame);
  map.finish();
  return obstacle;
}

SceneSpec readSceneFile(const std::string& path) {
  return parseScene(yamlText(path, "a scene file, such as config/scenes/table_edge.yaml"), path);
}

}  // namespace dccd::scene
