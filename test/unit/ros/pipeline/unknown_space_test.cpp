// What the map does not know, as `unknown_space` has it: ignored or an obstacle.
#include <gtest/gtest.h>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

TEST(UnknownSpace, FreeIsWhatNobodyAskedAbout) {
  Driven free(scene());
  EXPECT_EQ(decodeMapMessage(map(1), free.config).known, nullptr) << "nothing is built of it";
  free.giveMap(1);
  free.feed(1, 0.35f);
  const Outcome& outcome = free.feed(1.1, 0.15f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_TRUE(assuranceOf(outcome).clear()) << "the unknown is no obstacle";
  EXPECT_FALSE(free.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

TEST(UnknownSpace, OccupiedIsAnObstacleWithinItsBox) {
  Driven occupied(scene("unknown_space: occupied, unknown_box: [0, 0, 0, 0.5, 0.5, 0.6]"));
  occupied.giveMap(1);
  occupied.feed(1, 0.12f);
  const Outcome& outcome = occupied.feed(1.1, 0.28f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_FALSE(outcome.contacts.empty()) << "from the known into the unknown";
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-4);
  EXPECT_TRUE(occupied.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

}  // namespace
}  // namespace test
}  // namespace dccd
