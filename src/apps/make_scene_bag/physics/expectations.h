// The `expect` block of a scene file: facts about the scene that tests and the demo hold the monitor to. The recorder
// itself has no use for them, but says at once what is wrong with them.
#pragma once

#include "apps/make_scene_bag/physics/scene_spec.h"
#include "config/parameter_reader.h"

namespace dccd::scene {

/// Throws ParameterError on what it does not understand, and on facts that contradict the scene (a contact after its
/// end, with a body that is not there) or each other (a contact while all is clear).
/// A name of `body` that is no body's must be a link's: it becomes one of the robot's named_links.
void checkExpectations(ParameterReader map, SceneSpec& spec);

}  // namespace dccd::scene
