// What the tests of recordings share: the options of a scene, a recording's way through bytes, and the error that bytes
// lead to.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "dccd/stream.h"
#include "record/step_recording.h"
#include "support/recordings.h"
#include "support/said.h"

namespace dccd {
namespace test {

inline std::string errorOf(const std::vector<std::uint8_t>& bytes) {
  return said<RecordingError>([&] { readRecording(bytes.data(), bytes.size(), "FILE"); });
}

/// As it is read after it was written, and would be written again.
inline StepRecording again(const StepRecording& recording) {
  const std::vector<std::uint8_t> bytes = recordingBytes(recording);
  StepRecording read = readRecording(bytes.data(), bytes.size(), "FILE");
  EXPECT_EQ(recordingBytes(read), bytes);
  return read;
}

inline MonitorOptions with(Accuracy rung) {
  MonitorOptions options;
  options.detector.accuracy.rung = rung;
  options.detector.obstacle_expected = true;
  return options;
}

inline MonitorOptions expecting() {
  MonitorOptions options = with(Accuracy::EXACT);
  options.detector.expected = {
      {{ExpectedPartner{0, {0, 1, 2, 3, 4, 5, 6, 7}, "hem"}, ExpectedPartner{OBSTACLE_BODY, {}, ""}}, "carry"},
      {{ExpectedPartner{0, {}, ""}, ExpectedPartner{2, {}, ""}}, ""}};
  return options;
}

}  // namespace test
}  // namespace dccd
