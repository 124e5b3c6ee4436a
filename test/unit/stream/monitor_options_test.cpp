// Options of a monitor that are refused.
#include <gtest/gtest.h>

#include <stdexcept>

#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

// Options that are refused change nothing, not even those that could have been taken.
TEST(MonitorOptionsTest, RefusedOnesLeaveTheOldOnesInForce) {
  MonitorOptions options;
  options.detector.accuracy.rung = Accuracy::CONSERVATIVE;
  Body felt = named("felt");
  felt.minimum_separation_m = 0.01;
  Monitor monitor(options, {felt});
  monitor.push(0, tip(0, 0), NOW);
  only(monitor);
  monitor.push(0, tip(100 * MS, 0), NOW);
  EXPECT_EQ(only(monitor).status, StepStatus::OK);
  MonitorOptions wrong = options;
  wrong.detector.accuracy.rung = Accuracy::EXACT;
  wrong.store.max_vertex_step_m = 0;
  EXPECT_THROW(monitor.setOptions(wrong), std::invalid_argument);
  EXPECT_EQ(monitor.push(0, tip(200 * MS, 3), NOW), StepStatus::TELEPORT);
}

TEST(MonitorOptionsTest, OutOfRangeNamesTheOption) {
  MonitorOptions options;
  options.sync_timeout_s = -1;
  EXPECT_THROW(Monitor(options, {named("a")}), std::invalid_argument);
  options = {};
  options.look_ahead_s = 2e8;
  EXPECT_THROW(Monitor(options, {named("a")}), std::invalid_argument);
  options = {};
  options.clock_body = 1;
  EXPECT_THROW(Monitor(options, {named("a")}), std::invalid_argument);
  options = {};
  options.detector.exclude_boxes = {Box{}};
  EXPECT_THROW(Monitor(options, {named("a")}), std::invalid_argument);
}

}  // namespace
}  // namespace test
}  // namespace dccd
