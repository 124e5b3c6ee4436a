// Distances as messages: what a row says, what is not there, and which partners are the nearest.
#include "output/clearance_messages.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <sstream>

#include "output/output_messages.h"

namespace dccd {
namespace {

using Distance = deformable_ccd::ClearanceDistance;

constexpr double INFINITE = std::numeric_limits<double>::infinity();

ClearanceDistance between(ClearanceStatus status, double lower_m, double upper_m) {
  ClearanceDistance distance;
  distance.status = status;
  distance.lower_m = lower_m;
  distance.upper_m = upper_m;
  return distance;
}

Clearance row(std::uint16_t a, std::uint16_t b, const ClearanceDistance& distance) {
  Clearance out;
  out.body = {a, b};
  out.at_end = out.over_step = distance;
  return out;
}

/// A finger whose tip, vertex 3, comes down from 3 to 1 m above a cloth that rises from -1 to 0 m at its corner 1
/// alone, in half a second. Below the tip is the middle of that corner's edge with corner 0.
Outcome fingerOverCloth() {
  Outcome outcome;
  outcome.answered = true;
  outcome.status = StepStatus::OK;
  outcome.start_ns = 10'000'000'000;
  outcome.stamp_ns = 10'500'000'000;
  outcome.sequence = 7;
  auto step = std::make_shared<Step>();
  step->bodies.resize(2);
  step->start_ns = outcome.start_ns;
  step->stamp_ns = outcome.stamp_ns;
  Body &cloth = step->bodies[0], &finger = step->bodies[1];
  cloth.name = "cloth";
  cloth.topology = share(Topology::fromTriangles(3, {{0, 1, 2}}));
  cloth.t0 = share(Positions{{0, 0, 0}, {2, 0, -1}, {0, 2, 0}});
  cloth.t1 = share(Positions{{0, 0, 0}, {2, 0, 0}, {0, 2, 0}});
  finger.name = "finger";
  finger.topology = share(Topology::fromTriangles(4, {{0, 1, 3}, {1, 2, 3}}));
  finger.t0 = share(Positions{{0, 0, 9}, {1, 0, 9}, {2, 0, 9}, {1, 0, 3}});
  finger.t1 = share(Positions{{0, 0, 7}, {1, 0, 7}, {2, 0, 7}, {1, 0, 1}});
  outcome.step = step;
  Clearance c = row(0, 1, between(ClearanceStatus::MEASURED, 0.99995, 1.00005));
  c.at_end.point = {Vec3(1, 0, 0), Vec3(1, 0, 1)};
  c.at_end.vertex[0] = {0, 1, NO_INDEX};
  c.at_end.vertex[1] = {3, NO_INDEX, NO_INDEX};
  c.over_step = c.at_end;
  c.over_step.t = 0.5;
  c.expected = true;
  outcome.clearances = {c};
  return outcome;
}

TEST(NearestPartners, AreThoseOfWhichOneIsInsideOfTheOther) {
  Outcome outcome = fingerOverCloth();
  outcome.clearances[0].expected = false;
  EXPECT_EQ(nearestPartners(outcome).lower_m, 0.99995);
  outcome.intersections = {{{1, 0}, {3, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX}, true}};
  EXPECT_EQ(nearestPartners(outcome).lower_m, 0.99995) << "it is expected";
  outcome.intersections[0].expected = false;
  const NearestPartners nearest = nearestPartners(outcome);
  EXPECT_EQ(nearest.lower_m, 0);
  EXPECT_EQ(nearest.upper_m, 0);
  EXPECT_EQ(nearest.names, "cloth and finger");
  outcome.clearances[0].over_step.status = ClearanceStatus::UNKNOWN;
  EXPECT_TRUE(std::isnan(nearestPartners(outcome).lower_m)) << "what is not known comes first";
  outcome.clearances.clear();
  EXPECT_TRUE(std::isnan(nearestPartners(outcome).upper_m)) << "nobody asked";
}

TEST(ClearanceRow, SaysWhoHowFarWhereAndHowFastTheyClose) {
  const Outcome outcome = fingerOverCloth();
  const auto array = toClearanceArray(outcome, outcome.step->bodies, "world");
  EXPECT_EQ(array.header.stamp, ros::Time(10.5));
  EXPECT_EQ(array.header.frame_id, "world");
  EXPECT_EQ(array.start, ros::Time(10));
  EXPECT_EQ(array.sequence, 7u);
  EXPECT_TRUE(array.answered);
  ASSERT_EQ(array.pairs.size(), 1u);
  const deformable_ccd::Clearance& pair = array.pairs[0];
  EXPECT_EQ(pair.bodies[0] + " " + pair.bodies[1], "cloth finger");
  EXPECT_TRUE(pair.expected);
  EXPECT_EQ(pair.at_end.status, Distance::MEASURED);
  EXPECT_EQ(pair.at_end.lower, 0.99995);
  EXPECT_EQ(pair.at_end.upper, 1.00005);
  EXPECT_EQ(pair.at_end.stamp, ros::Time(10.5));
  EXPECT_EQ(pair.over_step.t, 0.5);
  EXPECT_EQ(pair.over_step.stamp, ros::Time(10.25));
  EXPECT_EQ(pair.at_end.points[1].z, 1);
  EXPECT_EQ(pair.at_end.first_vertices[1], 1u);
  EXPECT_EQ(pair.at_end.first_vertices[2], std::uint32_t{Distance::NO_VERTEX});
  EXPECT_EQ(pair.at_end.second_vertices[0], 3u);
  EXPECT_EQ(pair.direction.z, -1) << "from the finger towards the cloth";
  EXPECT_NEAR(pair.closing_speed, 5, 1e-9) << "4 m/s down, and half of the corner's 2 m/s up";
  EXPECT_GE(pair.speed_bound, 6) << "the fastest vertex of either";
  EXPECT_LE(pair.speed_bound, 6 + 1e-9);
}

// A quarter of a turn about its frame's origin: the arc is longer than its chord.
TEST(ClearanceRow, BoundsTheSpeedOfABodyThatTurns) {
  Outcome outcome = fingerOverCloth();
  auto step = std::make_shared<Step>(*outcome.step);
  step->bodies[0].t0 = step->bodies[0].t1;
  Body& finger = step->bodies[1];
  finger.turns = true;
  finger.pose_t1.linear() = Eigen::AngleAxisd(M_PI / 2, Vec3::UnitZ()).toRotationMatrix();
  finger.pose_t1.translation() = Vec3(0, 0, 0.5);
  finger.t0 = share(Positions{{3, 0, 0}, {0, 1, 0}, {1, 0, 0}, {1, 1, 0}});
  outcome.step = step;
  const double bound = toClearanceArray(outcome, step->bodies, "world").pairs[0].speed_bound;
  EXPECT_NEAR(bound, (3 * M_PI / 2 + 0.5) / 0.5, 1e-9);
}

TEST(ClearanceRow, WhatIsNotThereIsNaNAndNeverInfinite) {
  Outcome outcome = fingerOverCloth();
  Clearance unknown = row(0, OBSTACLE_BODY, between(ClearanceStatus::UNKNOWN, 0, INFINITE));
  outcome.clearances = {row(0, 0, between(ClearanceStatus::FARTHER, 0.5, INFINITE)),
                        row(0, 1, between(ClearanceStatus::LOWER, 0.125, INFINITE)), unknown,
                        row(1, OBSTACLE_BODY, between(ClearanceStatus::TOUCHING, 0, 0))};
  const auto array = toClearanceArray(outcome, outcome.step->bodies, "world");
  ASSERT_EQ(array.pairs.size(), 4u);
  EXPECT_EQ(array.farther, 0u);
  outcome.stats[Effect::CLEARANCE].in = 9;
  EXPECT_EQ(toClearanceArray(outcome, outcome.step->bodies, "world").farther, 5u);
  std::ostringstream text;
  text << array;
  EXPECT_EQ(text.str().find("inf"), std::string::npos) << text.str();
  const auto& [farther, lower, none, touching] =
      std::tie(array.pairs[0], array.pairs[1], array.pairs[2], array.pairs[3]);
  EXPECT_EQ(farther.at_end.lower, 0.5);
  EXPECT_EQ(lower.over_step.lower, 0.125);
  for (const auto* pair : {&farther, &lower, &none}) {
    EXPECT_TRUE(std::isnan(pair->at_end.upper) && std::isnan(pair->at_end.t)) << *pair;
    EXPECT_TRUE(std::isnan(pair->at_end.points[0].x) && std::isnan(pair->direction.x)) << *pair;
    EXPECT_TRUE(std::isnan(pair->closing_speed)) << *pair;
    EXPECT_TRUE(pair->at_end.stamp.isZero()) << *pair;
  }
  EXPECT_TRUE(std::isnan(none.at_end.lower)) << "0 would be a promise";
  EXPECT_TRUE(std::isnan(none.speed_bound));
  EXPECT_EQ(none.bodies[1], "octomap");
  EXPECT_EQ(touching.over_step.lower, 0);
  EXPECT_EQ(touching.over_step.upper, 0);
  const auto no_answer = toClearanceArray(Outcome(), {}, "world");
  EXPECT_FALSE(no_answer.answered);
  EXPECT_TRUE(no_answer.pairs.empty());
}

TEST(NearestPartners, AreTwoThatAreNotExpectedToTouch) {
  Outcome outcome = fingerOverCloth();
  Clearance expected = row(0, 1, between(ClearanceStatus::TOUCHING, 0, 0));
  expected.expected = true;
  const Clearance self = row(0, 0, between(ClearanceStatus::MEASURED, 0.1, 0.1001));
  const auto state = [&](std::vector<Clearance> rows) {
    outcome.clearances = std::move(rows);
    return toState(outcome, "world");
  };
  for (const auto& none : {state({}), state({expected, self}), toState(Outcome(), "world")}) {
    EXPECT_EQ(none.clearance_between, "");
    EXPECT_TRUE(std::isnan(none.clearance_lower) && std::isnan(none.clearance_upper));
  }
  const Clearance far = row(0, OBSTACLE_BODY, between(ClearanceStatus::FARTHER, 0.5, INFINITE));
  const auto apart = state({self, expected, far});
  EXPECT_EQ(apart.clearance_between, "cloth and octomap");
  EXPECT_EQ(apart.clearance_lower, 0.5);
  EXPECT_TRUE(std::isnan(apart.clearance_upper)) << "not infinite";

  const Clearance near = row(1, OBSTACLE_BODY, between(ClearanceStatus::MEASURED, 0.2, 0.2001));
  const auto nearest = state({far, near});
  EXPECT_EQ(nearest.clearance_between, "finger and octomap");
  EXPECT_EQ(nearest.clearance_lower, 0.2);
  EXPECT_EQ(nearest.clearance_upper, 0.2001);

  const auto unknown = state({near, row(0, OBSTACLE_BODY, between(ClearanceStatus::UNKNOWN, 0, INFINITE))});
  EXPECT_EQ(unknown.clearance_between, "cloth and octomap");
  EXPECT_TRUE(std::isnan(unknown.clearance_lower)) << "nobody knows how near the cloth is";
  EXPECT_EQ(unknown.clearance_upper, 0.2001) << "at most as far as those that are known";
}

}  // namespace
}  // namespace dccd
