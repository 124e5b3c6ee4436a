// What a scene's camera sees: one ray through the middle of each pixel. Free of Bullet.
#pragma once

#include <random>
#include <vector>

#include "scenes/physics/scene_spec.h"

namespace dccd::scene {

/// A scene at one time, in the fixed frame [m].
struct SceneState {
  std::vector<Positions> bodies;                ///< one for each of the scene's; none: its solids are alone
  std::vector<Eigen::Isometry3d> rigid_bodies;  ///< poses of their frames, likewise
  std::vector<Eigen::Isometry3d> links;         ///< of the robot, likewise
};

class DepthCamera {
 public:
  /// The scene must have a camera, and live as long as this.
  explicit DepthCamera(const SceneSpec& spec);

  /// The cloud, row by row, in the camera's optical frame; NaN where a ray meets nothing and where its pixel is lost.
  /// Sheets and tubes are as thin as their faces, ropes as thick as physics takes them (thickness_m). What is hidden
  /// behind the nearest is not seen. Equal scenes and seeds give equal clouds.
  std::vector<Eigen::Vector3f> look(const SceneState& state);

 private:
  /// The range [m] that each pixel's ray has to go; infinite where it meets nothing.
  using Ranges = std::vector<double>;

  template <class Range>
  void draw(Ranges& ranges, const Positions& hull, const Range& range) const;
  void drawSolid(Ranges& ranges, const Solid& solid) const;
  void drawBox(Ranges& ranges, const Eigen::Isometry3d& pose, const Vec3& half_size_m) const;
  void drawFaces(Ranges& ranges, const Positions& vertices, const std::vector<Face>& faces) const;
  void drawRope(Ranges& ranges, const Positions& points, double radius_m) const;
  void makeFly(Ranges& ranges);
  double uniform();
  double gaussian();

  const SceneSpec& spec_;
  const Camera& camera_;
  Eigen::Isometry3d from_fixed_;  // to the optical frame
  double focal_px_;
  std::vector<Vec3> directions_;          // of unit length, row by row
  std::vector<std::vector<Face>> faces_;  // of each body
  Ranges background_;                     // what rests: the obstacle
  std::mt19937_64 random_;
};

}  // namespace dccd::scene
