// Any bytes as the recording of a step: refused with a message that can be read, or written again without loss.
#include <stdexcept>
#include <string>
#include <vector>

#include "fuzz/fuzz_target.h"
#include "support/recordings.h"

namespace {

using namespace dccd;

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
}

}  // namespace

DEFORMABLE_CCD_FUZZ_TARGET(recording)
