// What the map does not know, as `unknown_space` has it: ignored, reported or an obstacle; never of a map that is too
// old.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

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
  EXPECT_EQ(outcome.unknown_fraction, 0);
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].in, 0u);
  EXPECT_FALSE(free.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

TEST(UnknownSpace, ReportGivesItsShareOfWhatIsSwept) {
  Driven report(scene("unknown_space: report"));
  report.giveMap(1);
  report.feed(1, 0.35f);
  // Swept: 2 x 2 columns of voxels, z from 0.1 to 0.4; the upper two of three are unknown.
  const Outcome& outcome = report.feed(1.1, 0.15f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_TRUE(assuranceOf(outcome).clear()) << "reported, and no obstacle";
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].in, 12u);
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].out, 8u);
  EXPECT_NEAR(outcome.unknown_fraction, 2.0 / 3, 1e-12);
  EXPECT_EQ(report.feed(1.2, 0.12f).unknown_fraction, 0) << "within what is known";
  EXPECT_TRUE(report.pipeline.effects().plan().running(Effect::UNKNOWN_SPACE));
}

TEST(UnknownSpace, AShareOfAPartIsNotGivenOut) {
  Driven report(scene("unknown_space: report, max_step_s: 10"));
  report.giveMap(1);
  const auto spread = [&](double stamp_s, float reach) {
    auto bytes = cloud(stamp_s, 0.35f);
    const float far[3] = {reach, reach, reach};
    std::memcpy(bytes.data() + bytes.size() - 1 - 16, far, sizeof far);  // the last point; is_dense follows
    report.take(0, bytes);
    EXPECT_TRUE(report.pipeline.nextOutcome(0, report.outcome));
  };
  spread(1, 0.5f);
  spread(1.1, 2000);  // across 5000 blocks of voxels an axis
  ASSERT_TRUE(report.outcome.answered) << report.outcome.reason;
  EXPECT_TRUE(std::isnan(report.outcome.unknown_fraction)) << report.outcome.unknown_fraction;
  spread(1.2, 2000);
  spread(1.3, 0.5f);
  spread(1.4, 0.5f);
  EXPECT_GT(report.outcome.unknown_fraction, 0) << "and is there again as soon as all is counted";
}

TEST(UnknownSpace, MaskedVerticesSweepNothing) {
  // Of the two triangles of the grid one is left, or none.
  Driven masked(scene("unknown_space: report, vertex_mask: [0]"));
  masked.giveMap(1);
  masked.feed(1, 0.35f);
  const std::uint64_t some = masked.feed(1.1, 0.15f).stats[Effect::UNKNOWN_SPACE].in;
  EXPECT_LE(some, 12u);
  Driven all(scene("unknown_space: report, vertex_mask: [0, 1, 2, 3]"));
  all.giveMap(1);
  all.feed(1, 0.35f);
  EXPECT_EQ(all.feed(1.1, 0.15f).stats[Effect::UNKNOWN_SPACE].in, 0u);
  EXPECT_EQ(all.outcome.unknown_fraction, 0);
}

TEST(UnknownSpace, TheShareIsThatOfAllBodies) {
  Driven two(scene("unknown_space: report, " + std::string(CLOTH_AND_TABLE)));
  two.giveMap(1);
  two.take(1, cloud(1, 0.05f));  // in voxels that are known
  two.feed(1, 0.35f);
  const Outcome& outcome = two.feed(1.1, 0.15f);
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].in, 12u + 4u) << outcome.reason;
  EXPECT_EQ(outcome.stats[Effect::UNKNOWN_SPACE].out, 8u);
}

TEST(UnknownSpace, OccupiedIsAnObstacleWithinItsBox) {
  Driven occupied(scene("unknown_space: occupied, unknown_box: [0, 0, 0, 0.5, 0.5, 0.6]"));
  occupied.giveMap(1);
  occupied.feed(1, 0.12f);
  const Outcome& outcome = occupied.feed(1.1, 0.28f);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_FALSE(outcome.contacts.empty()) << "from the known into the unknown";
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-4);
}

}  // namespace
}  // namespace test
}  // namespace dccd
