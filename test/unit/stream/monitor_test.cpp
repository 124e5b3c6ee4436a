// The frames of one body as a stream: steps, seams, frames that are refused, what the outcome says of each.
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

TEST_F(OneBody, KnownTimeOfContact) {
  EXPECT_EQ(feed(pair(100 * MS, 1)).status, StepStatus::FIRST_FRAME);
  const Outcome outcome = feed(pair(200 * MS, -3));
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_TRUE(outcome.answered);
  EXPECT_EQ(outcome.start_ns, 100 * MS);
  EXPECT_EQ(outcome.stamp_ns, 200 * MS);
  EXPECT_LE(outcome.earliest_toc, 0.25);
  EXPECT_GE(outcome.earliest_toc, 0.25 - std::ldexp(1.0, -31));
  EXPECT_FALSE(assuranceOf(outcome).clear());
  const ContactGeometry geometry = contactGeometry(outcome, outcome.contacts.front());
  EXPECT_NEAR(geometry.point.z(), 0, 1e-6);
  EXPECT_NEAR(std::abs(geometry.normal.z()), 1, 1e-6);
  EXPECT_NEAR(geometry.approach_speed, 4, 1e-6);
}

TEST_F(OneBody, ClearOnlyWhenNothingIsLeftOpen) {
  EXPECT_FALSE(assuranceOf(feed(pair(100 * MS, 1))).clear()) << "one frame is no answer";
  EXPECT_TRUE(assuranceOf(feed(pair(200 * MS, 0.9))).clear());
  MeshFrame lost = pair(300 * MS, 0.8);
  lost.positions[5].x() = std::numeric_limits<double>::infinity();
  const Outcome partial = feed(std::move(lost));
  EXPECT_EQ(partial.status, StepStatus::PARTIAL);
  EXPECT_TRUE(partial.answered);
  EXPECT_FALSE(assuranceOf(partial).clear());
  EXPECT_EQ(partial.stats.unchecked_vertices, 1u);
}

TEST_F(OneBody, InACellNothingIsProvedUntilItsQuestionsAreAnswered) {
  MonitorOptions options = loose();
  options.in_cell = true;
  monitor.setOptions(options);
  feed(pair(100 * MS, 1));
  for (Outcome outcome : {feed(pair(200 * MS, 0.9)), monitor.checkNow()}) {
    EXPECT_TRUE(outcome.answered);
    EXPECT_FALSE(assuranceOf(outcome).proved);
    for (std::size_t q = 0; q < static_cast<std::size_t>(Question::COUNT); ++q) {
      EXPECT_FALSE(outcome.claim.holds());
      outcome.claim.answer(static_cast<Question>(q), "");
    }
    EXPECT_TRUE(assuranceOf(outcome).clear());
  }
}

TEST_F(OneBody, RefusedFramesYieldOutcomesInOrder) {
  feed(pair(0, 1));
  monitor.countReceived(0, 2);
  monitor.skip(0, StepStatus::BAD_MESSAGE, 10 * MS, "index 7", 77);
  MeshFrame next = pair(20 * MS, 0.9);
  next.arrival_ns = 88;
  monitor.push(0, std::move(next), NOW);
  Outcome outcome;
  ASSERT_TRUE(monitor.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::BAD_MESSAGE);
  EXPECT_EQ(outcome.reason, "index 7");
  EXPECT_FALSE(outcome.answered);
  EXPECT_FALSE(assuranceOf(outcome).clear());
  EXPECT_EQ(outcome.arrival_ns, 77);
  ASSERT_TRUE(monitor.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::PARTIAL) << "from the frame before the refused one, which is missed";
  EXPECT_EQ(outcome.start_ns, 0);
  EXPECT_EQ(outcome.arrival_ns, 88);
  expectAddsUp(monitor);
}

TEST_F(OneBody, TooManyContactsKeepTheEarliest) {
  MonitorOptions options = loose();
  options.detector.max_contacts = 1;
  monitor.setOptions(options);
  feed(pair(0, 1));
  const Outcome outcome = feed(pair(100 * MS, -3));
  ASSERT_GT(outcome.total_contacts, 1u);
  EXPECT_EQ(outcome.status, StepStatus::TRUNCATED);
  ASSERT_EQ(outcome.contacts.size(), 1u);
  EXPECT_EQ(outcome.contacts[0].toc_lower, outcome.earliest_toc);
  EXPECT_EQ(outcome.counts.certain + outcome.counts.undecided, outcome.total_contacts) << "counted before the cut";
  EXPECT_EQ(outcome.counts.mesh, outcome.total_contacts);
  EXPECT_EQ(outcome.counts.obstacle, 0u);
  EXPECT_TRUE(outcome.missing().empty()) << "only the list is cut";
}

TEST_F(OneBody, AMaskBeyondTheMeshIsNoStep) {
  Body masked = named("cloth");
  masked.vertex_mask = {6};
  Outcome outcome;
  Monitor wrong(loose(), {masked});
  wrong.push(0, pair(0, 1), NOW);
  wrong.push(0, pair(100 * MS, 0.9), NOW);
  wrong.next(NOW, outcome);
  ASSERT_TRUE(wrong.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::INTERNAL_ERROR);
  EXPECT_NE(outcome.reason.find("vertex_mask"), std::string::npos);
}

}  // namespace
}  // namespace test
}  // namespace dccd
