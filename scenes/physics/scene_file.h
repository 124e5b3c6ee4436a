// Scene files: YAML in, SceneSpec out.
#pragma once

#include <string>

#include "config/parameter_reader.h"
#include "scenes/physics/scene_spec.h"

namespace dccd::scene {

/// Reads a scene file. Throws ParameterError ("FILE:LINE: key: what to write") on whatever it does not understand, and
/// on contradictions: a gripper on a vertex that is not there, a solid without volume, two things on one topic.
SceneSpec readSceneFile(const std::string& path);

/// The obstacle of a scene file, or of one that has nothing else: a map needs no bodies. Throws ParameterError.
Obstacle readObstacleFile(const std::string& path);

/// As readSceneFile() for a text; `name` leads messages in the place of the file.
SceneSpec parseScene(const std::string& text, const std::string& name);

}  // namespace dccd::scene
