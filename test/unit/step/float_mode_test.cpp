// The floating-point mode of whoever asks is no part of the question: a step brings its own, on every thread, and
// leaves the caller's as it was.
#include <gtest/gtest.h>

#include <cfenv>
#include <cmath>

#include "record/step_replay.h"
#include "step/history.h"
#include "support/flush_to_zero.h"
#include "support/recordings.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

class RoundingMode {
 public:
  explicit RoundingMode(int mode) : saved_(std::fegetround()) { std::fesetround(mode); }
  ~RoundingMode() { std::fesetround(saved_); }
  RoundingMode(const RoundingMode&) = delete;
  RoundingMode& operator=(const RoundingMode&) = delete;

 private:
  int saved_;
};

MonitorOptions with(Accuracy rung) {
  MonitorOptions options;
  options.detector.accuracy.rung = rung;
  options.detector.obstacle_expected = true;
  options.detector.patches = true;
  return options;
}

TEST(FloatMode, OfTheCallerChangesNoAnswerAndStays) {
  for (const Accuracy rung : {Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    StepRecording recorded = recordScene(with(rung));  // with a body that turns
    recorded.answer = replayStep(recorded).answer;     // whose counters are those of a step without one before it
    for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
      for (const int threads : {1, 3}) {
        StepReplay replay;
        int left = 0;
        {
          const RoundingMode rounding(mode);
          replay = replayStep(recorded, threads);
          left = std::fegetround();
        }
        EXPECT_EQ(left, mode);
        EXPECT_FALSE(replay.answer.contacts.empty());
        for (const StepCounter& counter : STEP_COUNTERS) {
          EXPECT_EQ(replay.answer.stats.*counter.value, recorded.answer.stats.*counter.value) << counter.name;
        }
        EXPECT_TRUE(replay.differences.empty())
            << toString(rung) << ", mode " << mode << ", " << threads << " threads: " << replay.differences.front();
      }
    }
    StepReplay replay;
    {
      const FlushToZero flushing;
      replay = replayStep(recorded, 3);
      EXPECT_TRUE(flushing.isInForce());
    }
    EXPECT_TRUE(replay.differences.empty()) << replay.differences.front();
  }
}

/// The filters leave out as much as ever, and nothing else: what they keep is counted.
TEST(FloatMode, OfTheCallerChangesNoCounter) {
  const TestStep cloth = crumpled(5, 2, 40);
  Options options;
  const Outcome usual = runOnce(cloth, options);
  ASSERT_GT(usual.contacts.size(), 100u);
  for (const int mode : {FE_UPWARD, FE_DOWNWARD, FE_TOWARDZERO}) {
    Outcome outcome;
    {
      const RoundingMode rounding(mode);
      outcome = runOnce(cloth, options);
    }
    EXPECT_EQ(outcome.contacts.size(), usual.contacts.size());
    for (const StepCounter& counter : STEP_COUNTERS) {
      EXPECT_EQ(outcome.stats.*counter.value, usual.stats.*counter.value) << counter.name << ", mode " << mode;
    }
    for (const Stage stage : {Stage::BROAD_PHASE, Stage::PLANAR, Stage::ELEMENTARY}) {
      EXPECT_EQ(outcome.stats[stage].out, usual.stats[stage].out) << toString(stage) << ", mode " << mode;
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
