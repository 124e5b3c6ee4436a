// Steps a scene's physics and writes what a robot would have seen into a bag.
#pragma once

#include <cstdint>
#include <string>

#include "scenes/physics/scene_spec.h"

namespace dccd {

struct RecorderOptions {
  int frames = 0;      ///< 0: the scene's own number
  double rate_hz = 0;  ///< frames a second; 0: the scene's own number
  std::uint64_t seed = 1;
  std::string output;  ///< message type of every body; empty: the scene's own
  bool full_octomap = false;
  std::string monitor_config_path;  ///< empty: not written
  bool quiet = false;
};

/// Records the scene; returns a few lines that say what was recorded. Stamps start at START_STAMP_S, whatever the day.
/// Throws rosbag::BagException when the bag cannot be opened, std::runtime_error when it cannot be written, and on a
/// scene that cannot be published.
std::string recordScene(const scene::SceneSpec& spec, const std::string& bag_path, const RecorderOptions& options);

/// Writes the obstacle as a map file (.bt), for `octomap_file`; returns a line that says what was written. Throws
/// std::runtime_error naming the file.
std::string recordMap(const scene::Obstacle& obstacle, const std::string& path);

}  // namespace dccd
