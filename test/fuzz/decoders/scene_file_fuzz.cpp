// Any bytes as a scene file: a scene, or an error with file and line.
#include <stdexcept>
#include <string>

#include "fuzz/fuzz_target.h"
#include "scenes/physics/scene_file.h"

namespace {

void scene_file(const std::uint8_t* data, std::size_t size) {
  try {
    dccd::scene::parseScene(std::string(data, data + size), "input");
  } catch (const dccd::ParameterError& error) {
    if (std::string(error.what()).rfind("input:", 0) != 0)
      throw std::logic_error(std::string("message: ") + error.what());
  }
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(scene_file)
