// Messages out of outcomes: what a line for people says, and what is counted.
#include "output/output_messages.h"

#include <gtest/gtest.h>

#include <limits>

namespace dccd {
namespace {

/// A step that found nothing.
Outcome nothingFound(StepStatus status, StartState start, const std::string& reason = "") {
  Outcome outcome;
  outcome.answered = true;
  outcome.status = status;
  outcome.reason = reason;
  outcome.start_state = start;
  if (status != StepStatus::OK) outcome.unproved.push_back(reason);
  if (start == StartState::INTERSECTING) outcome.touching = Touching::LASTING;
  return outcome;
}

std::string summaryOf(const Outcome& outcome) { return toFirstContact(outcome, {}, "world").summary; }

TEST(Summary, NoContactIsSaidOfClearStepsAlone) {
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::OK, StartState::CLEAR)), "no contact, starts CLEAR");
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::NO_MAP, StartState::CLEAR, "none came; checked without it")),
            "no contact found, but NO_MAP (none came; checked without it), starts CLEAR");
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::PARTIAL, StartState::NOT_CHECKED, "2 vertices were lost")),
            "no contact found, but PARTIAL (2 vertices were lost), starts NOT_CHECKED");
  EXPECT_EQ(summaryOf(nothingFound(StepStatus::OK, StartState::INTERSECTING)),
            "no contact found, but starts INTERSECTING");
  Outcome suppressed = nothingFound(StepStatus::OK, StartState::CLEAR);
  suppressed.suppressed = 3;
  suppressed.touching = Touching::LASTING;
  EXPECT_EQ(summaryOf(suppressed), "no contact found, but 3 initial ones suppressed, starts CLEAR");
  Outcome fast = nothingFound(StepStatus::OK, StartState::CLEAR);
  fast.unproved = {"accuracy fast misses contacts and proves nothing"};
  EXPECT_EQ(summaryOf(fast), "no contact found, but accuracy fast misses contacts and proves nothing, starts CLEAR");
  Outcome unanswered;
  unanswered.status = StepStatus::GAP;
  EXPECT_EQ(summaryOf(unanswered), "no answer: GAP");
}

TEST(Times, WhatRosCannotHoldIsTheNearestThatItCan) {
  EXPECT_EQ(toRosTime(1500000000), ros::Time(1, 500000000));
  EXPECT_EQ(toRosTime(-1), ros::Time(0, 0));
  const StampNs last_ns = 4294967295999999999;
  EXPECT_EQ(toRosTime(last_ns), ros::Time(4294967295, 999999999));
  EXPECT_EQ(toRosTime(last_ns + 1), ros::Time(4294967295, 999999999));
  EXPECT_EQ(toRosTime(std::numeric_limits<StampNs>::max()), ros::Time(4294967295, 999999999));
}

TEST(Stats, ContactsAreCountedBeforeTheCutToMaxContacts) {
  Outcome cut = nothingFound(StepStatus::TRUNCATED, StartState::CLEAR);
  cut.total_contacts = 7;
  cut.counts = {5, 2, 3, 1, 4, 3};
  cut.stats.unfolded_bodies = 2;
  const auto stats = toStepStats(cut, {}, "world");
  EXPECT_EQ(stats.unfolded_bodies, 2u);
  EXPECT_EQ(stats.contacts, 7u);
  EXPECT_EQ(stats.contacts_certain, 5u);
  EXPECT_EQ(stats.contacts_undecided, 2u);
  EXPECT_EQ(stats.contacts_initial, 3u);
  EXPECT_EQ(stats.contacts_leaving, 1u);
  EXPECT_EQ(stats.contacts_mesh, 4u);
  EXPECT_EQ(stats.contacts_obstacle, 3u);
}

}  // namespace
}  // namespace dccd
