// The seeds of the fuzz targets `recording` and `replay` are recordings that this program reads. A new version of the
// file makes them anew: DEFORMABLE_CCD_WRITE_SEEDS=1 unit_tests --gtest_filter=RecordingSeeds.*
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <map>

#include "record/step_replay.h"
#include "support/recordings.h"
#include "unit/record/recording_support.h"

namespace dccd {
namespace test {
namespace {

namespace fs = std::filesystem;

/// One body of the scene, before its step was answered.
StepRecording alone(std::size_t body) {
  StepRecording r = recordScene();
  r.step.bodies = {r.step.bodies[body]};
  r.has_answer = false;
  r.answer = Outcome();
  return r;
}

std::map<std::string, StepRecording> seeds() {
  MonitorOptions all = expecting();
  all.detector.patches = true;
  StepRecording nothing;
  nothing.step.stamp_ns = 1;
  return {{"conservative_without_map", recordScene(with(Accuracy::CONSERVATIVE), false)},
          {"distances", recordScene(with(Accuracy::CONSERVATIVE), true, true)},
          {"everything", recordScene(all)},
          {"no_bodies", nothing},
          {"one_body", alone(0)},
          {"polyline", alone(2)}};
}

/// One that is refused early is no seed for a fuzzer.
TEST(RecordingSeeds, AreReadAndReplayed) {
  const fs::path folder = DEFORMABLE_CCD_SOURCE_DIR "/test/fuzz/corpus/recording";
  const bool write = std::getenv("DEFORMABLE_CCD_WRITE_SEEDS") != nullptr;
  for (const auto& [name, seed] : seeds()) {
    if (write) writeRecording(folder / name, seed);
    StepRecording read;
    ASSERT_NO_THROW(read = readRecordingFile(folder / name)) << name;
    EXPECT_EQ(read.step.bodies.size(), seed.step.bodies.size()) << name;
    if (!read.step.bodies.empty()) EXPECT_TRUE(replayStep(read).differences.empty()) << name;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
