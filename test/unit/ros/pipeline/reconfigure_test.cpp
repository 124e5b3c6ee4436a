// Options that change while the pipeline runs: they are in force together, or refused together.
#include <gtest/gtest.h>

#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

TEST(Options, WhatIsReconfiguredIsInForceBesideWhatThePlanDecides) {
  Driven driven(scene());
  driven.giveMap(1);
  driven.feed(1, 0.35f);
  EXPECT_TRUE(driven.pipeline.monitor().options().detector.obstacle_expected) << "a map came";
  driven.pipeline.reconfigure([](MonitorOptions& options, MarkerConfig& markers) {
    options.detector.max_contacts = 1;
    markers.obstacle_m = 2;
  });
  EXPECT_EQ(driven.pipeline.monitor().options().detector.max_contacts, 1u);
  EXPECT_TRUE(driven.pipeline.monitor().options().detector.obstacle_expected) << "the plan's, whatever is reconfigured";
  EXPECT_EQ(driven.pipeline.config().monitor.detector.max_contacts, 1u);
  EXPECT_EQ(driven.pipeline.config().markers.obstacle_m, 2);
  EXPECT_EQ(driven.feed(1.1, -0.05f).status, StepStatus::TRUNCATED);
  const auto another_clock = [](MonitorOptions& options, MarkerConfig& markers) {
    options.detector.max_contacts = 7;
    options.clock_body = 9;
    markers.obstacle_m = 3;
  };
  EXPECT_THROW(driven.pipeline.reconfigure(another_clock), std::invalid_argument);
  EXPECT_EQ(driven.pipeline.config().markers.obstacle_m, 2);
  EXPECT_EQ(driven.pipeline.config().monitor.detector.max_contacts, 1u) << "what is refused changes nothing";
  EXPECT_EQ(driven.pipeline.monitor().options().detector.max_contacts, 1u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
