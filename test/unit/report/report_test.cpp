#include "report/report.h"

#include <gtest/gtest.h>

#include <filesystem>

namespace dccd {
namespace {

Outcome nothingFound(StepStatus status, StartState start) {
  Outcome outcome;
  outcome.answered = true;
  outcome.status = status;
  outcome.start_state = start;
  if (status != StepStatus::OK) outcome.unproved.push_back(toString(status));
  if (start == StartState::INTERSECTING) outcome.touching = Touching::LASTING;
  return outcome;
}

std::string headlineOf(const std::vector<Outcome>& outcomes) {
  const std::string folder = ::testing::TempDir() + "headline_report";
  Report report(folder);
  for (const Outcome& outcome : outcomes) report.add(outcome, {});
  const std::string headline = report.headline();
  std::filesystem::remove_all(folder);
  return headline;
}

TEST(Headline, OnlyClearStepsSayNoContact) {
  const Outcome clear = nothingFound(StepStatus::OK, StartState::CLEAR);
  const Outcome no_map = nothingFound(StepStatus::NO_MAP, StartState::CLEAR);
  const Outcome crossing = nothingFound(StepStatus::OK, StartState::INTERSECTING);
  EXPECT_EQ(headlineOf({}), "No answer: no step could be checked.");
  EXPECT_EQ(headlineOf({clear, clear}), "No contact in 2 answered steps.");
  EXPECT_EQ(headlineOf({no_map, no_map, nothingFound(StepStatus::PARTIAL, StartState::CLEAR)}),
            "No contact found in 3 answered steps, but it is not ruled out (NO_MAP 2, PARTIAL 1).");
  EXPECT_EQ(headlineOf({clear, no_map, crossing}),
            "No contact in 1 of 3 answered steps; in others none was found, but it is not ruled out (NO_MAP 1, start "
            "INTERSECTING 1).");
  EXPECT_EQ(headlineOf({clear, Outcome{}}), "No contact in 1 answered steps; 1 frame without an answer.");
}

}  // namespace
}  // namespace dccd
