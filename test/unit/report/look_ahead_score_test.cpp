#include "report/look_ahead_score.h"

#include <gtest/gtest.h>

namespace dccd {
namespace {

constexpr StampNs MS = 1000000;

Contact touch(Index vertex, double toc) {
  Contact c;
  c.kind = PairKind::VERTEX_VOXEL_FACE;
  c.body = {0, OBSTACLE_BODY};
  c.vertex[0] = vertex;
  c.toc_lower = c.toc_upper = toc;
  return c;
}

Outcome step(StampNs start_ns, StampNs end_ns, std::vector<Contact> contacts = {}) {
  Outcome outcome;
  outcome.status = StepStatus::OK;
  outcome.answered = true;
  outcome.start_ns = start_ns;
  outcome.stamp_ns = end_ns;
  outcome.contacts = std::move(contacts);
  return outcome;
}

TEST(LookAheadScore, CountsThePredictionsThatCameTrue) {
  LookAheadScore score(0.4);
  score.observe(step(0, 100 * MS));
  score.predict(step(100 * MS, 500 * MS, {touch(7, 0.5), touch(8, 0.9)}));  // at 300 ms, at 460 ms
  score.observe(step(100 * MS, 200 * MS));
  score.predict(step(200 * MS, 600 * MS, {touch(7, 0.2)}));  // at 280 ms
  score.observe(step(200 * MS, 300 * MS, {touch(7, 0.6)}));  // at 260 ms
  const LookAheadSummary summary = score.summary();
  EXPECT_EQ(summary.came_true, 2u);
  EXPECT_EQ(summary.not_observed, 0u) << "8 still has time";
  score.observe(step(300 * MS, 400 * MS, {touch(7, 0.0), touch(9, 0.5)}));
  EXPECT_EQ(score.summary().came_true, 2u) << "7 is in contact all along";
  EXPECT_EQ(score.summary().not_predicted, 1u) << "9 came unannounced";
  score.observe(step(400 * MS, 510 * MS, {touch(7, 0.0)}));
  EXPECT_EQ(score.summary().not_observed, 1u) << "the horizon of 8 is over";
}

TEST(LookAheadScore, WhatTouchesAlreadyOrMayTouchIsNoPrediction) {
  LookAheadScore score(0.4);
  score.observe(step(0, 100 * MS, {touch(1, 0.5)}));
  Contact undecided = touch(2, 0.5), initial = touch(3, 0);
  undecided.certainty = Certainty::UNDECIDED;
  initial.initial = true;
  score.predict(step(100 * MS, 500 * MS, {touch(1, 0.1), undecided, initial}));
  score.observe(step(100 * MS, 200 * MS, {touch(1, 0.0)}));
  score.observe(step(200 * MS, 700 * MS, {touch(1, 0.0)}));
  EXPECT_EQ(score.summary().came_true, 0u);
  EXPECT_EQ(score.summary().not_observed, 0u);
}

TEST(LookAheadScore, ASeamForgets) {
  LookAheadScore score(0.4);
  score.observe(step(0, 100 * MS));
  score.predict(step(100 * MS, 500 * MS, {touch(7, 0.5)}));
  Outcome gap;
  gap.status = StepStatus::GAP;
  score.observe(gap);
  score.observe(step(150 * MS, 300 * MS, {touch(7, 0.5)}));
  EXPECT_EQ(score.summary().came_true, 0u);
}

}  // namespace
}  // namespace dccd
