// A scene's robot: what its URDF says of it.
#pragma once

#include "scenes/physics/scene_spec.h"

namespace dccd {

/// Fills spec.robot->links, where there is a robot. Throws std::runtime_error naming the scene or the URDF: one that
/// cannot be read, whose links have meshes that are missing, or a joint or link that the scene names and it has not.
void addRobot(scene::SceneSpec& spec, const std::string& scene_path);

}  // namespace dccd
