// Limits of time where frames come as a stream: what ends a step, and the share of the prediction.
#include <gtest/gtest.h>

#include <cmath>

#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

/// A step and the prediction after it share the time that a step may take.
TEST(StreamLimits, APredictionHasItsShareOfTheTime) {
  MonitorOptions options = loose();
  const auto stepMs = [&] { return Monitor(options, {named("cloth")}).stepMs(); };
  EXPECT_EQ(stepMs(), 0);
  options.detector.max_compute_ms = 400;
  EXPECT_EQ(stepMs(), 400);
  options.look_ahead_s = 0.1;
  EXPECT_EQ(stepMs(), 300);
  options.detector.step_budget_ms = 2e-6;
  EXPECT_EQ(stepMs(), 1.5e-6);
  Monitor monitor(options, {named("cloth")});
  for (const double z : {1.0, -3.0}) {
    monitor.countReceived(0);
    monitor.push(0, pair(z > 0 ? 100 * MS : 200 * MS, z), NOW);
  }
  Outcome outcome;
  while (monitor.next(NOW, outcome)) {
  }
  EXPECT_EQ(outcome.status, StepStatus::DEADLINE);
  EXPECT_EQ(monitor.predict().status, StepStatus::DEADLINE);
}

// A flat sheet cannot touch itself, which takes no pair and no time; whether it did so at the start is left open.
TEST_F(OneBody, AStartStateWithoutTimeIsNoClearStep) {
  feed(floor(100 * MS, 0));
  EXPECT_TRUE(assuranceOf(feed(floor(200 * MS, 1))).clear());
  monitor.reset(StepStatus::RESET);
  MonitorOptions hurried = loose();
  hurried.detector.step_budget_ms = 1e-6;
  monitor.setOptions(hurried);
  feed(floor(300 * MS, 0));
  const Outcome outcome = feed(floor(400 * MS, 1));
  EXPECT_EQ(outcome.status, StepStatus::DEADLINE);
  EXPECT_EQ(outcome.start_state, StartState::NOT_CHECKED);
  EXPECT_FALSE(outcome.complete);
  EXPECT_FALSE(assuranceOf(outcome).clear());
  EXPECT_TRUE(std::isinf(outcome.unchecked_toc_lower)) << "no pair was left out";
  EXPECT_NE(outcome.reason.find("start state"), std::string::npos) << outcome.reason;
  const Outcome question = monitor.checkNow();
  EXPECT_TRUE(question.complete) << "a question takes the time that it takes";
  EXPECT_TRUE(assuranceOf(question).clear());
}

}  // namespace
}  // namespace test
}  // namespace dccd
