// Holds a scene's `monitor` block to what the node and analyze_bag would say of it, before anything is recorded.
#pragma once

#include <string>

#include "apps/make_scene_bag/physics/scene_spec.h"

namespace dccd {

/// Throws std::runtime_error naming the file, the parameter and what to write instead: what is unknown, out of range or
/// contradicts itself, and mesh files that are missing or hold no mesh.
void checkMonitorBlock(const scene::SceneSpec& spec, const std::string& scene_path);

}  // namespace dccd
