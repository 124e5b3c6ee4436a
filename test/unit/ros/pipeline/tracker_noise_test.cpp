// How uncertain the tracker is, from a field of the points or one number for all of them.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "dccd/assurance.h"
#include "unit/ros/pipeline/driven_pipeline.h"

namespace dccd {
namespace test {
namespace {

TEST(TrackerNoise, ComesFromThePointField) {
  Driven noisy(scene("uncertainty: {field: sigma}"));
  noisy.giveMap(1);
  EXPECT_TRUE(noisy.pipeline.effects().plan().running(Effect::TRACKER_NOISE));
  noisy.feed(1, 0.17f, {0, 0, 0, 0});
  EXPECT_TRUE(assuranceOf(noisy.feed(1.1, 0.15f, {0, 0, 0, 0})).clear()) << "15 cm above the map";
  // One vertex known to 0.12 m: down to 0.1 m above the map it may touch; the features at it too, no others.
  const Outcome& outcome = noisy.feed(1.2, 0.10f, {0, 0, 0.12f, 0});
  ASSERT_FALSE(outcome.contacts.empty());
  for (const Contact& c : outcome.contacts) {
    EXPECT_TRUE(std::count(c.vertex.begin(), c.vertex.end(), 2u)) << "feature without the uncertain vertex";
  }
  EXPECT_LE(outcome.earliest_toc, 0.6 + 1e-6);
  EXPECT_NEAR(outcome.earliest_toc, 0.6, 1e-3);
  EXPECT_GT(outcome.stats[Effect::TRACKER_NOISE].out, 0u);
  for (const Contact& c : outcome.contacts) {
    EXPECT_EQ(c.body[1], OBSTACLE_BODY) << "neighbours on the mesh are no contacts, however uncertain";
  }
  EXPECT_GT(outcome.stats.left_out_met, 0u);
  EXPECT_TRUE(noisy.feed(1.3, 0.13f, {0, 0, 0, 0}).answered);
  EXPECT_TRUE(assuranceOf(noisy.feed(1.4, 0.13f, {0, 0, 0, 0})).clear()) << "as soon as the tracker is sure again";
}

TEST(TrackerNoise, BadFieldsAreRefusedByNameAndValue) {
  Driven noisy(scene("uncertainty: {field: sigma}"));
  EXPECT_EQ(noisy.feed(1, 0.2f).status, StepStatus::BAD_MESSAGE);
  EXPECT_NE(noisy.outcome.reason.find("'sigma'"), std::string::npos) << noisy.outcome.reason;
  EXPECT_EQ(noisy.feed(1.1, 0.2f, {0, -1, 0, 0}).status, StepStatus::BAD_MESSAGE);
  EXPECT_NE(noisy.outcome.reason.find("of point 1 is -1"), std::string::npos) << noisy.outcome.reason;
  EXPECT_EQ(noisy.feed(1.2, 0.2f, {0, 0, NAN, 0}).status, StepStatus::BAD_MESSAGE);
  EXPECT_EQ(noisy.feed(1.25, 0.2f, {0, 0, 0, 1.001e9f}).status, StepStatus::BAD_MESSAGE) << "as the parameters";
  EXPECT_NE(noisy.outcome.reason.find("of point 3 is 1.001e+09; "), std::string::npos) << noisy.outcome.reason;
  EXPECT_NE(noisy.outcome.reason.find("at most 1e+09 m"), std::string::npos) << noisy.outcome.reason;
  EXPECT_EQ(noisy.feed(1.3, 0.2f, {0, 0, 0, 0}).status, StepStatus::FIRST_FRAME) << "and nothing is lost";
}

TEST(TrackerNoise, ANumberHoldsForAllVertices) {
  Driven noisy(scene("uncertainty: {radius_m: 0.12}"));
  noisy.giveMap(1);
  noisy.feed(1, 0.17f);
  EXPECT_NEAR(noisy.feed(1.1, 0.07f).earliest_toc, 0.5, 1e-3);
}

}  // namespace
}  // namespace test
}  // namespace dccd
