// What the tests of recordings share: the options of a scene, and the error that bytes lead to.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "dccd/stream.h"
#include "record/step_recording.h"
#include "support/said.h"

namespace dccd {
namespace test {

inline std::string errorOf(const std::vector<std::uint8_t>& bytes) {
  return said<RecordingError>([&] { readRecording(bytes.data(), bytes.size(), "FILE"); });
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
