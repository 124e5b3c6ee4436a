#include "node/step_recorder.h"

#include <algorithm>
#include <cstdlib>
#include <stdexcept>

#include "node/map_memory.h"

namespace dccd {

namespace {

/// As ROS itself: where its tools keep what they write.
std::string rosHome() {
  if (const char* home = std::getenv("ROS_HOME")) return home;
  const char* user = std::getenv("HOME");
  return std::string(user ? user : "/tmp") + "/.ros";
}

/// A node's name as a part of a file's.
std::string inFileName(std::string name) {
  if (!name.empty() && name[0] == '/') name.erase(0, 1);
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
}

}  // namespace

StepRecorder::StepRecorder(const MonitorConfig& config, Monitor& monitor, const std::string& node)
    : folder_(rosHome() + "/deformable_ccd"), owner_(inFileName(node)) {
  if (config.record_steps == 0) return;
  recorder_ = std::make_unique<FlightRecorder>(config.record_steps, folder_, owner_, recordedMaps(config));
  monitor.setListener(recorder_.get());
}

bool StepRecorder::record(std::string& message) {
  if (!recorder_) {
    message = "nothing is recorded: record_steps is 0";
    return false;
  }
  if (recorder_->size() == 0) {
    message = "no step has been computed yet";
    return false;
  }
  try {
    message.clear();
    for (const std::string& file : recorder_->writeAll("asked for by record_step"))
      message += (message.empty() ? "" : "\n") + file;
    return true;
  } catch (const std::runtime_error& error) {
    message = error.what();
    return false;
  }
}

std::string StepRecorder::takeSurprise() { return recorder_ ? recorder_->takeSurprise() : std::string(); }

}  // namespace dccd
