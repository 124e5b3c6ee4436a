// What of the robot keeps a step from being proved: links that are not watched, another description, too many voxels of
// its own.
#include <algorithm>
#include <string>
#include <vector>

#include "node/monitor_pipeline.h"

namespace dccd {

std::size_t MonitorPipeline::robotsVoxels(const Step& step) {
  if (counted_voxels_ == step.map.own.voxels) return robots_voxels_;
  counted_voxels_ = step.map.own.voxels;
  const auto isRobots = [&](const OwnVoxel& voxel) {
    const bool is_attached = voxel.body >= config_.bodies.size();
    return !voxel.doubted && (is_attached || !config_.bodies[voxel.body].link.empty());
  };
  robots_voxels_ = 0;
  if (counted_voxels_) {
    robots_voxels_ =
        static_cast<std::size_t>(std::count_if(counted_voxels_->begin(), counted_voxels_->end(), isRobots));
  }
  return robots_voxels_;
}

void MonitorPipeline::nameUnwatched(Outcome& outcome) {
  if (!outcome.answered) return;
  const std::size_t most = config_.robot_asked.max_own_voxels, own = most > 0 ? robotsVoxels(*outcome.step) : 0;
  if (own > most) {
    outcome.unproved.push_back(
        std::to_string(own) +
        " voxels of the map are own of the robot and what it holds, and robot/max_own_voxels is " +
        std::to_string(most) + "; see that its meshes, scale and transforms fit, or raise it");
  }
  for (const auto* sentences : {&config_.robot.missing, &robot_changed_}) {
    outcome.unproved.insert(outcome.unproved.end(), sentences->begin(), sentences->end());
  }
}

const std::vector<std::string>& MonitorPipeline::robotChanged(const std::vector<std::string>& parameters) {
  robot_changed_.clear();
  for (const std::string& name : parameters) {
    robot_changed_.push_back("parameter " + name +
                             " is another one than at the start; restart the monitor, which watches the robot of then");
  }
  if (!robot_changed_.empty()) voidWhatWasSaid(robot_changed_.front());
  return robot_changed_;
}

}  // namespace dccd
