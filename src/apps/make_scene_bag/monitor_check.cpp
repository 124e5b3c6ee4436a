#include "apps/make_scene_bag/monitor_check.h"

#include <stdexcept>

#include <tf2/buffer_core.h>

#include "config/monitor_config.h"
#include "node/monitor_pipeline.h"
#include "node/robot_source.h"

namespace dccd {

void checkMonitorBlock(const scene::SceneSpec& spec, const std::string& scene_path) {
  if (!spec.monitor.isSet()) return;
  const MonitorConfig config = readConfig(spec.monitor, "monitor/", robotOfFiles());
  try {
    tf2::BufferCore transforms;
    const TransformFeed feed(transforms);
    const MonitorPipeline pipeline(config, feed);  // effects that are not to be had, files
  } catch (const std::exception& error) {
    throw std::runtime_error(scene_path + ": monitor: " + error.what());
  }
}

}  // namespace dccd
