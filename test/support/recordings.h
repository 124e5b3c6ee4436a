// Steps recorded from a running monitor, small enough for files in the project.
#pragma once

#include "dccd/stream.h"
#include "record/step_recording.h"

namespace dccd {
namespace test {

/// A monitor of a falling 4 x 5 grid, a rigid finger that turns beneath it (so the step is split), a rope at rest and a
/// map of two leaves; after its first frames. Each nextFrames() moves it on by 0.1 s; the grid meets all others in
/// time. With distances the grid keeps away from itself and, further, from the rope, and its vertices have uncertainty
/// radii.
class RecordedScene {
 public:
  explicit RecordedScene(const MonitorOptions& options = {}, bool with_map = true, bool with_distances = false);
  Outcome nextFrames();
  Monitor& monitor() { return monitor_; }

 private:
  void push();
  Monitor monitor_;
  int frame_ = 0;
  bool with_distances_;
  std::shared_ptr<const Topology> grid_, finger_, rope_;
};

/// The recording of the scene's second step, answer included.
StepRecording recordScene(const MonitorOptions& options = {}, bool with_map = true, bool with_distances = false);

/// A file's bytes in memory.
std::vector<std::uint8_t> recordingBytes(const StepRecording& recording);

}  // namespace test
}  // namespace dccd
