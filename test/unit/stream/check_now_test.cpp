// A question looks at the newest frame and takes the time that it takes: what limits the steps does not cut its answer.
#include <gtest/gtest.h>

#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

TEST_F(OneBody, CheckNowLooksAtTheNewestFrame) {
  EXPECT_FALSE(monitor.checkNow().answered);
  feed(pair(0, 0));
  const Outcome touching = monitor.checkNow();
  EXPECT_TRUE(touching.answered);
  EXPECT_FALSE(touching.contacts.empty());
}

// A step would wait for the other body; a question says that it was not seen for as long.
TEST(CheckNow, ABodyThatFellSilentIsNotKnownToBeThere) {
  for (const bool silent : {false, true}) {
    Monitor monitor(loose(), {named("floor"), named("tip")});
    monitor.push(1, tip(100 * MS, 1), 0);
    for (const StampNs stamp_ns : {100 * MS, 400 * MS, silent ? 700 * MS : 500 * MS})
      monitor.push(0, floor(stamp_ns, 0), 0);
    const Outcome now = monitor.checkNow();
    EXPECT_TRUE(now.answered);
    EXPECT_EQ(assuranceOf(now).proved, !silent) << describe(assuranceOf(now));
  }
}

/// A triangle, and one that stands on it with its tip below it.
MeshFrame crossed(StampNs stamp_ns) {
  MeshFrame frame;
  frame.stamp_ns = stamp_ns;
  frame.topology = share(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
  frame.positions = {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, -0.5}, {0.5, 0, 0.5}, {-0.5, 0, 0.5}};
  return frame;
}

TEST(CheckNow, NoLimitOfTheStepsCutsIt) {
  for (const bool budget : {false, true}) {
    MonitorOptions options;
    (budget ? options.detector.step_budget_ms : options.detector.max_compute_ms) = 1e-6;
    Body cloth;
    cloth.name = "cloth";
    Monitor monitor(options, {cloth});
    for (const StampNs stamp_ns : {100 * MS, 133 * MS}) monitor.push(0, crossed(stamp_ns), 0);
    Outcome outcome;
    while (monitor.next(0, outcome)) continue;
    ASSERT_EQ(outcome.status, StepStatus::DEADLINE) << "a step has no time at all";
    const Outcome now = monitor.checkNow();
    EXPECT_EQ(now.status, StepStatus::OK) << now.reason;
    EXPECT_TRUE(now.complete);
    EXPECT_EQ(now.start_state, StartState::INTERSECTING);
    EXPECT_FALSE(now.intersections.empty());
    EXPECT_TRUE(assuranceOf(now).proved) << describe(assuranceOf(now));
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
