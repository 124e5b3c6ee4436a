// Any step that can be read from a recording is replayed, or refused by the monitor: bodies, options and maps that no
// node would make. Its corpus is that of the recordings.
#include <stdexcept>

#include "fuzz/fuzz_target.h"
#include "record/step_recording.h"
#include "record/step_replay.h"

namespace {

using namespace dccd;

bool isSmall(const StepRecording& recording) {
  std::size_t vertices = 0;
  for (const Body& body : recording.step.bodies) vertices += body.t0->size();
  const std::size_t leaves = recording.step.map.surface ? recording.step.map.surface->leafCount() : 0;
  // The scene in the seeds has 28 vertices and few parts; `conservative` may cost max_subdivisions for each pair and
  // part.
  return vertices <= 32 && leaves <= 32 && recording.options.max_substeps <= 64 &&
         recording.options.rigid_tolerance_m >= 1e-3 && recording.options.accuracy.max_subdivisions <= 5000;
}

void replay(const std::uint8_t* data, std::size_t size) {
  try {
    const StepRecording recording = readRecording(data, size, "input");
    if (isSmall(recording)) replayStep(recording);
  } catch (const RecordingError&) {
    // No recording; the target `recording` looks at what is said of it.
  } catch (const std::invalid_argument&) {
    // Options or bodies that cannot be.
  }
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(replay)
