// Options of a monitor that are refused.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <stdexcept>
#include <string>
#include <utility>

#include "support/said.h"
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
  const auto refused = [](const auto& change) {
    MonitorOptions options;
    Body body = named("a");
    change(options, body);
    return said<std::invalid_argument>([&] { Monitor(options, {body}); }, "nothing");
  };
  EXPECT_EQ(refused([](MonitorOptions&, Body&) {}), "nothing");
  const std::pair<std::string, std::function<void(MonitorOptions&, Body&)>> wrong[] = {
      {"sync_timeout_s", [](MonitorOptions& o, Body&) { o.sync_timeout_s = -1; }},
      {"octomap_timeout_s", [](MonitorOptions& o, Body&) { o.octomap_timeout_s = -1; }},
      {"max_waiting", [](MonitorOptions& o, Body&) { o.max_waiting = 0; }},
      {"look_ahead_s", [](MonitorOptions& o, Body&) { o.look_ahead_s = 2e8; }},
      {"own_voxels_lag_s", [](MonitorOptions& o, Body&) { o.own_voxels_lag_s = 11; }},
      {"own_voxels_m", [](MonitorOptions&, Body& b) { b.own_voxels_m = std::nan(""); }},
      {"patch_gap_s", [](MonitorOptions& o, Body&) { o.patch_gap_s = HUGE_VAL; }},
      {"max_step_s", [](MonitorOptions& o, Body&) { o.store.max_step_s = 0; }},
      {"max_vertex_step_m", [](MonitorOptions& o, Body&) { o.store.max_vertex_step_m = std::nan(""); }},
      {"capacity", [](MonitorOptions& o, Body&) { o.store.capacity = 1; }},
      {"clock_body", [](MonitorOptions& o, Body&) { o.clock_body = 1; }},
      {"'a' is static", [](MonitorOptions&, Body& b) { b.motion = BodyMotionKind::STATIC; }},
      {"exclude_boxes", [](MonitorOptions& o, Body&) { o.detector.exclude_boxes = {Box{}}; }}};
  for (const auto& [name, change] : wrong) EXPECT_TRUE(mentions(refused(change), name)) << refused(change);
}

}  // namespace
}  // namespace test
}  // namespace dccd
