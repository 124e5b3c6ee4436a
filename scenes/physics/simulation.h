// Bullet soft bodies in double precision, stepped to record scenes. Physics for test data: never part of the node.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "scenes/physics/scene_spec.h"

namespace dccd::scene {

class Simulation {
 public:
  /// Constructs the bodies and only the effects that the scene names. Equal scene and seed give equal motion, bit for
  /// bit.
  Simulation(const SceneSpec& spec, std::uint64_t seed);
  ~Simulation();

  /// Advances by one frame, 1 / frame_rate_hz.
  void step();

  double time_s() const;
  /// The vertices [m] of a body in the fixed frame.
  Positions positions(std::size_t body) const;
  /// Pose of a rigid body's frame in the fixed frame.
  Eigen::Isometry3d rigidPose(std::size_t rigid_body) const;

  /// The physical effects that were constructed, in the order of construction, for example "gravity", "cloth: bending".
  const std::vector<std::string>& effects() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace dccd::scene
