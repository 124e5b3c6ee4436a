// What /diagnostics tells between outcomes: the counters of now, and the hint that helps.
#include "output/diagnostics.h"

#include <gtest/gtest.h>

#include <string>

namespace dccd {
namespace {

constexpr std::int64_t SECOND_NS = 1000000000;

std::string valueOf(const diagnostic_msgs::DiagnosticArray& array, const std::string& key) {
  for (const auto& value : array.status.at(0).values) {
    if (value.key == key) return value.value;
  }
  return "no such key";
}

TEST(Diagnostics, CountersAreThoseOfNowWithoutAnOutcome) {
  Diagnostics diagnostics("/monitor");
  EXPECT_TRUE(diagnostics.isDue(SECOND_NS));
  StatsContext context;
  diagnostics.add(Outcome(), 0);
  diagnostics.take(SECOND_NS, ros::Time(1), context, false, "", "");
  EXPECT_FALSE(diagnostics.isDue(2 * SECOND_NS - 1));
  EXPECT_TRUE(diagnostics.isDue(2 * SECOND_NS));
  for (int i = 0; i < 7; ++i) {
    ++context.frames.received;
    context.frames.count(StepStatus::DISABLED);
  }
  const auto array = diagnostics.take(2 * SECOND_NS, ros::Time(2), context, false, "", "");
  EXPECT_EQ(valueOf(array, "frames received"), "7");
  EXPECT_EQ(valueOf(array, "frames skipped"), "7");
  EXPECT_EQ(array.status.at(0).message, "disabled");
}

TEST(Diagnostics, AMapThatIsNotThereHasNoAge) {
  Diagnostics diagnostics("/monitor");
  Outcome outcome;
  outcome.answered = true;
  outcome.stamp_ns = 7 * SECOND_NS;
  Step step;
  step.map.stamp_ns = 4 * SECOND_NS;
  outcome.step = share(step);
  diagnostics.add(outcome, 0);
  EXPECT_EQ(valueOf(diagnostics.take(SECOND_NS, ros::Time(1), {}, true, "", ""), "map age [s]"), "no such key");
  outcome.obstacle = VoxelSurface::build(0.1, {{{0, 0, 0}, 1}});
  diagnostics.add(outcome, 0);
  EXPECT_EQ(valueOf(diagnostics.take(2 * SECOND_NS, ros::Time(2), {}, true, "", ""), "map age [s]"), "3");
}

TEST(Diagnostics, AFrameWithoutAnAnswerSaysNothingAgainstTheMap) {
  Diagnostics diagnostics("/monitor");
  Outcome answer, none;
  answer.answered = true;
  answer.status = StepStatus::OK;
  answer.step = share(Step());
  none.status = StepStatus::DUPLICATE;
  const auto levelAfter = [&](std::int64_t second) {
    for (const Outcome& outcome : {answer, none}) diagnostics.add(outcome, 0);
    return diagnostics.take(second * SECOND_NS, ros::Time(1), {}, true, "/map", "").status.at(0).level;
  };
  EXPECT_EQ(levelAfter(1), diagnostic_msgs::DiagnosticStatus::WARN) << "no octomap";
  answer.obstacle = VoxelSurface::build(0.1, {{{0, 0, 0}, 1}});
  EXPECT_EQ(levelAfter(2), diagnostic_msgs::DiagnosticStatus::OK);
}

TEST(Diagnostics, RatesAreThoseOfThePeriod) {
  Diagnostics diagnostics("/monitor");
  Outcome answer, none;
  answer.answered = true;
  answer.step = share(Step());
  for (const Outcome& outcome : {answer, answer, none}) diagnostics.add(outcome, 0);
  const auto busy = diagnostics.take(SECOND_NS, ros::Time(1), {}, true, "", "");
  EXPECT_EQ(valueOf(busy, "outcomes [Hz]") + " " + valueOf(busy, "answers [Hz]"), "3 2");
  diagnostics.add(answer, 0);
  const auto quiet = diagnostics.take(3 * SECOND_NS, ros::Time(3), {}, true, "", "");
  EXPECT_EQ(valueOf(quiet, "outcomes [Hz]") + " " + valueOf(quiet, "answers [Hz]"), "0.5 0.5");
}

TEST(Diagnostics, FramesThatAreDroppedDoArrive) {
  Diagnostics diagnostics("/monitor");
  StatsContext context;
  context.frames.received = 3;
  context.frames.count(StepStatus::QUEUE_FULL);
  const auto dropped = diagnostics.take(SECOND_NS, ros::Time(1), context, true, "", "");
  EXPECT_EQ(dropped.status.at(0).message.rfind("frames are dropped", 0), 0u) << dropped.status.at(0).message;
  // They were told of; now none comes.
  const auto silent = diagnostics.take(2 * SECOND_NS, ros::Time(2), context, true, "", "");
  EXPECT_EQ(silent.status.at(0).message, "no frames arrive");
}

}  // namespace
}  // namespace dccd
