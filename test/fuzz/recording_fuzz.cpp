// Any bytes as the recording of a step: refused with a message that can be read, or written again without loss and, where
// that takes no time, replayed.
#include <numeric>
#include <stdexcept>
#include <string>

#include "fuzz/fuzz_target.h"
#include "io/step_replay.h"
#include "support/recordings.h"

namespace {

using namespace deformable_ccd;

bool isSmall(const StepRecording& recording) {
  std::size_t vertices = 0;
  for (const RecordedBody& body : recording.bodies) vertices += body.t0.size();
  const std::size_t leaves = recording.map.surface ? recording.map.surface->leafCount() : 0;
  // The scene in the seeds has 28 vertices and few parts; `conservative` may cost max_subdivisions for each pair and part.
  return vertices <= 32 && leaves <= 32 && recording.options.max_substeps <= 64 &&
         recording.options.rigid_tolerance_m >= 1e-3 && recording.options.detector.accuracy.max_subdivisions <= 5000;
}

/// A replay costs as much as hundreds of recordings read: the fuzzer replays one in 256, as its bytes say.
bool isToReplay([[maybe_unused]] const std::uint8_t* data, [[maybe_unused]] std::size_t size) {
#ifdef DEFORMABLE_CCD_FUZZER
  return std::accumulate(data, data + size, 0u) % 256 == 0;
#else
  return true;
#endif
}

void recording(const std::uint8_t* data, std::size_t size) {
  StepRecording read;
  try {
    read = readRecording(data, size, "input");
  } catch (const RecordingError& error) {
    const std::string message = error.what();
    if (message.rfind("input: byte ", 0) != 0 || message.size() > 1000) throw std::logic_error("message: " + message);
    return;
  }
  const std::vector<std::uint8_t> written = test::recordingBytes(read);
  const StepRecording again = readRecording(written.data(), written.size(), "copy");
  if (test::recordingBytes(again) != written) throw std::logic_error("written and read again, the step differs");
  if (!isSmall(read) || !isToReplay(data, size)) return;
  try {
    replayStep(read);
  } catch (const std::invalid_argument&) {
    // Options or bodies that cannot be.
  }
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(recording)
