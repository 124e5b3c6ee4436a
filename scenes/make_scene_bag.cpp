// make_scene_bag SCENE.yaml OUT.bag: records a scene's cloth, octomap and transforms from a physics simulation.
// make_scene_bag SCENE.yaml OUT.bt: its map alone.
#include <exception>
#include <iostream>
#include <string>

#include <CLI/CLI.hpp>

#include "apps/decimal_options.h"
#include "config/monitor_config.h"
#include "node/monitor_pipeline.h"
#include "node/robot_source.h"
#include "scenes/physics/scene_file.h"
#include "scenes/recorder.h"
#include "scenes/scene_robot.h"

namespace {

/// Holds a scene's `monitor` block to what the node and analyze_bag would say of it, before anything is recorded.
void checkMonitorBlock(const dccd::scene::SceneSpec& spec, const std::string& scene_path) {
  if (!spec.monitor.isSet()) return;
  const dccd::MonitorConfig config = readConfig(spec.monitor, "monitor/", dccd::robotOfFiles());
  try {
    dccd::TransformFeed feed;
    const dccd::MonitorPipeline pipeline(config, feed);  // effects that are not to be had, files
  } catch (const std::exception& error) {
    throw std::runtime_error(scene_path + ": monitor: " + error.what());
  }
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app(
      "Records a scene (config/scenes/*.yaml) as a bag: bodies, octomap, tf, a camera's clouds. The same seed gives "
      "the same bag. Into OUT.bt it writes the octomap alone, for which the file needs nothing but its obstacle.");
  std::string scene_path, bag_path;
  dccd::RecorderOptions options;
  app.add_option("scene", scene_path, "Scene file")->required();
  app.add_option("bag", bag_path, "Bag to write, or a .bt file: the scene's map alone")->required();
  app.add_option("--frames", options.frames, "Frames to record instead of the scene's own number")
      ->check(CLI::Range(2, 1000000));
  app.add_option("--rate", options.rate_hz, "Frames a second instead of the scene's own number, over the same time")
      ->check(CLI::Range(0.1, 1000.0));
  app.add_option("--seed", options.seed, "Seed of the start's noise")->capture_default_str();
  app.add_option("--output", options.output, "Message type of every body, instead of the scene's own")
      ->check(CLI::IsMember(dccd::scene::MESH_OUTPUTS));
  app.add_flag("--full", options.full_octomap, "Write the octomap with log-odds instead of binary");
  app.add_option("--monitor-config", options.monitor_config_path,
                 "Also write the scene's parameters for the monitor here");
  app.add_flag("--quiet", options.quiet, "No progress bar");
  dccd::requireDecimalNumbers(app);
  try {
    app.parse(argc, argv);
    dccd::refuseToOverwrite(scene_path, {bag_path, options.monitor_config_path});
    if (bag_path.size() > 3 && bag_path.compare(bag_path.size() - 3, 3, ".bt") == 0) {
      std::cout << dccd::recordMap(dccd::scene::readObstacleFile(scene_path), bag_path);
      return 0;
    }
    dccd::scene::SceneSpec spec = dccd::scene::readSceneFile(scene_path);
    dccd::addRobot(spec, scene_path);
    checkMonitorBlock(spec, scene_path);
    std::cout << dccd::recordScene(spec, bag_path, options);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 1;
  } catch (const std::exception& error) {
    std::cerr << "make_scene_bag: " << error.what() << "\n";
    return 1;
  }
  return 0;
}
