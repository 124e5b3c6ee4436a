// What a scene file (config/scenes/*.yaml) says: bodies, obstacle, motion, and only the physical effects it names.
// An effect that a scene does not name is an empty optional here, and is not constructed (see simulation.h).
#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "config/parameter_tree.h"
#include "dccd/types.h"

namespace dccd::scene {

/// A rows x cols grid of vertices. A tube closes its columns around its axis; a rope is a grid of one row.
struct Shape {
  enum class Kind { SHEET, TUBE, ROPE };
  Kind kind = Kind::SHEET;
  int rows = 1;
  int cols = 2;
  Vec3 size_m = Vec3::Zero();        ///< sheet: width (cols), height (rows); tube: radius, length; rope: length
  Vec3 center_m = Vec3::Zero();      ///< in the fixed frame
  Vec3 rotation_rad = Vec3::Zero();  ///< rotation vector, applied about the center
};

/// Where a held or rigid thing is: at rest before the first key and after the last, smoothly between two.
struct MotionKey {
  double time_s = 0.0;
  Vec3 offset_m = Vec3::Zero();      ///< from the start
  Vec3 rotation_rad = Vec3::Zero();  ///< rotation vector about the start's centroid
};
using Motion = std::vector<MotionKey>;

/// Vertices that follow a motion, or a link of the robot, instead of the physics, until they are released.
struct Gripper {
  std::vector<int> vertices;
  Motion motion;
  std::optional<double> release_s;
  std::string link{};    ///< holds them where they are at grasp_s; empty: the motion does, from the start
  double grasp_s = 0.0;  ///< with a link: physics has them until then
};

/// How a body's frames are published.
enum class MeshOutput { MESH_STAMPED, POINT_CLOUD_GRID, POLYGON_MESH, MARKER };
/// Their names.
inline const std::vector<std::string> MESH_OUTPUTS{"mesh_stamped", "point_cloud_grid", "polygon_mesh", "marker"};

struct Body {
  std::string name;
  std::string topic;
  std::string frame;
  MeshOutput output = MeshOutput::MESH_STAMPED;
  Shape shape;
  double mass_kg = 0.2;
  double thickness_m = 0.004;         ///< distance that physics keeps between vertices and obstacles
  double damping = 0.0;               ///< 0 to 1, share of the velocity lost in a step
  double start_noise_m = 0.0;         ///< random offset of each vertex at the start: no two folds are alike
  std::optional<double> bending;      ///< 0 to 1, Bullet's linear stiffness of the bending links
  std::optional<int> self_collision;  ///< convex clusters that the body is cut into; more are finer and slower
  std::optional<double> friction;     ///< 0 to 1
  std::vector<Gripper> grippers;
};

struct Solid {
  enum class Kind { BOX, RING };
  Kind kind = Kind::BOX;
  Box box;                       ///< BOX
  Vec3 center_m = Vec3::Zero();  ///< RING: a torus around `axis`
  Vec3 axis = Vec3::UnitZ();
  double radius_m = 0.0;
  double tube_radius_m = 0.0;
};

/// What the octomap shows. Physics only meets it where `collides` is set.
struct Obstacle {
  std::string topic;
  std::string frame;
  double resolution_m = 0.02;
  bool binary = true;
  bool collides = false;
  double inset_m = 0.0;  ///< physics' solids are smaller by this: voxels reach beyond what they map
  std::vector<Solid> solids;
};

/// A box that moves along a path; published as a tf frame, met by the bodies.
struct RigidBody {
  std::string name;
  std::string frame;
  Vec3 size_m = Vec3::Zero();
  Vec3 start_m = Vec3::Zero();  ///< center at the start
  Motion motion;
};

/// Where a joint is [m or rad]: at rest before the first key and after the last, smoothly between two.
struct JointKey {
  double time_s = 0.0;
  double position = 0.0;
};

struct Surface {
  Positions vertices;  ///< [m]
  std::vector<Face> faces;
};

/// A link of the robot, and the joint that carries it.
struct Link {
  enum class Joint { FIXED, TURNS, SLIDES };
  std::string name;
  int parent = -1;  ///< which comes before it; -1: it is the root, and has no joint
  std::string joint_name;
  Joint joint = Joint::FIXED;
  Eigen::Isometry3d origin = Eigen::Isometry3d::Identity();  ///< of the joint in the parent's frame
  Vec3 axis = Vec3::UnitX();                                 ///< of unit length
  std::vector<JointKey> keys;                                ///< none: it stays at 0
  std::vector<Surface> surfaces;                             ///< in its frame
};

/// Published as tf and joint states, seen by the camera. Physics knows it by what its grippers hold.
struct Robot {
  std::string description;  ///< file of its URDF
  Vec3 base_m = Vec3::Zero();
  std::map<std::string, std::vector<JointKey>> joints;
  std::vector<std::string> named_links;  ///< by grippers
  std::vector<Link> links;               ///< what the URDF says: addRobot()
};

/// A depth camera that looks on. Its frame is an optical one: x to the right, y down, z forward.
struct Camera {
  std::string topic;        ///< of its clouds; its map comes on the obstacle's topic
  std::string truth_topic;  ///< of the map that the obstacle's solids make, latched at the start
  std::string frame;
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();  ///< of `frame` in the fixed frame
  int width = 0;                                           ///< pixels
  int height = 0;
  double field_of_view_rad = 0.0;  ///< from the left side of the image to the right one
  double rate_hz = 0.0;            ///< clouds a second, at most one a frame
  double noise_m = 0.0;            ///< standard deviation of a range
  double lost_share = 0.0;         ///< 0 to 1, of the pixels
  double flying_share = 0.0;       ///< the same, of those that lie between what is in front at an edge and behind
  double lag_s = 0.0;              ///< from the stamp of a cloud to when it and its map come
  int empty_clouds = 0;            ///< before the scene begins, of the solids alone
  double inset_m = 0.0;            ///< the solids seen are smaller by this: their faces lie within voxels of the map
  int seed = 1;                    ///< of noise, lost and flying pixels
};

struct Wind {
  Vec3 velocity_m_s = Vec3::Zero();
  double drag = 0.0;
  double lift = 0.0;
  double gust = 0.0;  ///< share of the velocity that comes and goes
  double gust_period_s = 1.0;
};

struct SceneSpec {
  std::string name;
  std::string description;
  std::string fixed_frame;
  double frame_rate_hz = 30.0;
  int frames = 0;
  int substeps = 8;  ///< physics steps per frame
  std::optional<Vec3> gravity_m_s2;
  std::optional<Wind> wind;
  std::vector<Body> bodies;
  std::optional<Obstacle> obstacle;
  std::vector<RigidBody> rigid_bodies;
  std::optional<Robot> robot;
  std::optional<Camera> camera;  ///< where there is one, there is an obstacle
  ParameterTree monitor;         ///< the scene's `monitor` block, as the node reads it
  std::string monitor_yaml;      ///< the same as text, passed on as written
};

}  // namespace dccd::scene
