// Predictions: what they find, what they know of their start, and that they change no step.
#include <gtest/gtest.h>

#include "support/shapes.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

TEST_F(OneBody, PredictionMeetsWhatIsObservedLater) {
  MonitorOptions options = loose();
  options.look_ahead_s = 0.4;
  monitor.setOptions(options);
  EXPECT_FALSE(monitor.predict().answered);
  feed(pair(0, 2));
  ASSERT_TRUE(assuranceOf(feed(pair(100 * MS, 1.5))).clear());
  const Outcome ahead = monitor.predict();
  ASSERT_EQ(ahead.status, StepStatus::OK) << ahead.reason;
  EXPECT_NEAR(ahead.earliest_toc, 0.75, 1e-9) << "0.3 s of 0.4 s";
  EXPECT_EQ(ahead.stamp_ns, 500 * MS);
  const Outcome next = feed(pair(200 * MS, 1));
  EXPECT_TRUE(assuranceOf(next).clear()) << "a prediction leaves the observed steps alone";
}

// It begins where the last step ended, as a question about now does.
TEST_F(OneBody, PredictionsKnowTheirStart) {
  for (const Accuracy rung : {Accuracy::EXACT, Accuracy::CONSERVATIVE}) {
    MonitorOptions options = loose();
    options.look_ahead_s = 0.1;
    options.detector.accuracy.rung = rung;
    monitor.reset(StepStatus::RESET);
    monitor.setOptions(options);
    StampNs stamp_ns = 0;
    feed(pair(stamp_ns, 1));
    for (const double tip_z : {0.5, -0.5, -0.25, 1.0, 1.25}) {
      ASSERT_TRUE(feed(pair(stamp_ns += 100 * MS, tip_z)).answered);
      const Outcome ahead = monitor.predict(), question = monitor.checkNow();
      EXPECT_EQ(ahead.start_state, tip_z < 0 ? StartState::INTERSECTING : StartState::CLEAR) << tip_z;
      EXPECT_TRUE(same(ahead.intersections, question.intersections));
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
