// Certificates of parts of a surface: what is left out has no contact, and on smooth surfaces nearly all is left out.
#include "culling/unfolded.h"

#include <gtest/gtest.h>

#include "support/closed_meshes.h"
#include "support/detector.h"
#include "support/surfaces.h"

namespace dccd {
namespace {

using test::rolled;
using test::tube;
using test::tubeAt;

Step stepOf(const Topology& topology, const Positions& t0, const Positions& t1) {
  Body body;
  body.name = "cloth";
  body.topology = std::make_shared<const Topology>(topology);
  return test::stepOf(body, t0, t1);
}

Outcome runStep(const Step& step, bool culled, BroadPhase broad_phase = BroadPhase::CLUSTERED) {
  Options options;
  options.check_start_state = false;
  options.unfolded_test = culled;
  options.broad_phase = broad_phase;
  return test::Detector(options).run(step);
}

TEST(UnfoldedParts, ATubeIsHardlyLookedAt) {
  const Step step = stepOf(tube(60, 60), tubeAt(60, 60, 0.1), tubeAt(60, 60, 0.12));
  const Outcome all = runStep(step, false), culled = runStep(step, true);
  EXPECT_EQ(culled.stats.unfolded_bodies, 0u) << "no direction sees all of it";
  EXPECT_GE(culled.stats.unfolded_parts, 2u);
  EXPECT_GT(culled.stats.unfolded_pairs, 0u);
  EXPECT_LT(4 * culled.stats[Stage::BROAD_PHASE].in, all.stats[Stage::BROAD_PHASE].in);
  EXPECT_EQ(all.stats.unfolded_parts + all.stats.unfolded_pairs, 0u);
}

TEST(UnfoldedParts, OnlyAFoldIsLookedAt) {
  const std::size_t side = 61;
  const Step step = stepOf(Topology::grid(side, side), rolled(side, 2.8), rolled(side, 3.6));
  const Outcome all = runStep(step, false), culled = runStep(step, true);
  EXPECT_GT(all.contacts.size(), 0u) << "the rolled part lies down on the rest";
  EXPECT_EQ(culled.contacts.size(), all.contacts.size());
  EXPECT_LT(2 * culled.stats[Stage::BROAD_PHASE].in, all.stats[Stage::BROAD_PHASE].in);
}

TEST(UnfoldedParts, AGloveIsFoundOutInSomeSteps) {
  const test::Glove glove(160);
  const Step step = stepOf(glove.topology, glove.curled(0.3), glove.curled(0.33));
  Options options;
  options.check_start_state = false;
  test::Detector stream(options);
  Outcome culled;
  for (int i = 0; i < 25; ++i) culled = stream.run(step);
  EXPECT_GE(culled.stats.unfolded_parts, 2u) << "its palm and its back";
  EXPECT_LT(4 * culled.stats[Stage::BROAD_PHASE].in, runStep(step, false).stats[Stage::BROAD_PHASE].in);
}

// The bounds of leaves are made where they are asked for, some of them after others have been shortened. As all of it
// moves on, too, bounds of different times are apart.
TEST(UnfoldedParts, TheFirstContactIsTheSame) {
  const std::size_t side = 61;
  for (const double along : {-1, 1}) {
    Positions t1 = rolled(side, 5);
    for (Vec3& p : t1) p.z() += along;
    const Step step = stepOf(Topology::grid(side, side), rolled(side, 2.8), t1);
    std::vector<Outcome> outcomes;
    for (const int threads : {0, 1, 2}) {
      Options options;
      options.check_start_state = false;
      options.unfolded_test = threads > 0;
      options.earliest_only = true;
      options.num_threads = std::max(threads, 1);
      outcomes.push_back(test::Detector(options).run(step));
    }
    ASSERT_GT(outcomes[0].contacts.size(), 0u);
    EXPECT_LT(outcomes[0].contacts[0].toc_upper, 0.75) << "else no bounds are shortened";
    for (const Outcome* culled : {&outcomes[1], &outcomes[2]}) {
      EXPECT_GT(culled->stats.unfolded_parts, 0u);
      ASSERT_EQ(culled->contacts.size(), outcomes[0].contacts.size());
      for (std::size_t i = 0; i < culled->contacts.size(); ++i) {
        EXPECT_EQ(culled->contacts[i].vertex, outcomes[0].contacts[i].vertex);
        EXPECT_EQ(culled->contacts[i].toc_lower, outcomes[0].contacts[i].toc_lower);
      }
    }
  }
}

TEST(UnfoldedParts, WhatIsInsideIsTheSame) {
  test::TestStep step;
  for (const double x : {-0.9, 0.1, 1.5}) {
    step.bodies = {test::ball(Vec3::Zero(), 1, 5), test::ball({x, 0.02, 0.03}, 0.05, 0)};
    for (const bool culled : {false, true}) {
      Options options;
      options.unfolded_test = culled;
      const Outcome outcome = test::Detector(options).run(step.motion());
      EXPECT_EQ(outcome.stats.unfolded_parts > 0, culled);
      EXPECT_EQ(outcome.start_state, x < 1 ? StartState::INTERSECTING : StartState::CLEAR) << x << culled;
    }
  }
}

TEST(UnfoldedParts, TheStartStateIsTheSame) {
  const Step apart = stepOf(tube(60, 60), tubeAt(60, 60, 0.1), tubeAt(60, 60, 0.12));
  const Step crossing = stepOf(Topology::grid(61, 61), rolled(61, 3.6), rolled(61, 2.8));
  for (const Step* step : {&apart, &crossing}) {
    std::vector<Outcome> outcomes;
    for (const bool culled : {false, true}) {
      Options options;
      options.unfolded_test = culled;
      outcomes.push_back(test::Detector(options).run(*step));
    }
    EXPECT_GT(outcomes[1].stats.unfolded_parts, 0u);
    EXPECT_EQ(outcomes[1].start_state, outcomes[0].start_state);
    EXPECT_EQ(outcomes[1].start_state == StartState::CLEAR, step == &apart);
    EXPECT_EQ(outcomes[1].intersections.size(), outcomes[0].intersections.size());
  }
}

TEST(UnfoldedParts, AHoleMayBeThereButNotBeCrossed) {
  const std::size_t side = 41;
  std::vector<Face> faces = Topology::grid(side, side).faces();
  faces.erase(faces.begin() + 1600, faces.begin() + 1606);
  const Positions flat = rolled(side, 0);
  const Topology holed = Topology::fromTriangles(side * side, faces);
  EXPECT_EQ(runStep(stepOf(holed, flat, flat), true).stats.unfolded_bodies, 1u);
  Positions closed = flat;
  closed[20 * side + 20] = closed[20 * side + 24];  // a corner of the hole goes across it, and beyond its other side
  closed[20 * side + 20].x() += 0.1;
  EXPECT_EQ(runStep(stepOf(holed, flat, closed), true).stats.unfolded_bodies, 0u);
}

TEST(UnfoldedParts, NothingWithADistanceOrWithoutAllVertices) {
  const Step whole = stepOf(tube(60, 60), tubeAt(60, 60, 0.1), tubeAt(60, 60, 0.12));
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  options.check_start_state = false;
  const auto partsOf = [&](const Step& step) { return test::Detector(options).run(step).stats.unfolded_parts; };
  EXPECT_GT(partsOf(whole), 0u);
  Step step = whole;
  step.bodies[0].minimum_separation_m = 1e-6;
  EXPECT_EQ(partsOf(step), 0u);
  step = whole;
  std::vector<double> radius(3600, 0.0);
  radius[77] = 0.01;
  step.bodies[0].radius_m = share(radius);
  EXPECT_EQ(partsOf(step), 0u);
  step = whole;
  step.bodies[0].vertex_mask = {5};
  EXPECT_EQ(partsOf(step), 0u);
}

TEST(UnfoldedParts, NotAroundFacesTheOtherWayRoundOrThreeAtAnEdge) {
  const std::size_t side = 41;
  const Positions flat = rolled(side, 0);
  const auto statsOf = [&](const std::vector<Face>& faces) {
    return runStep(stepOf(Topology::fromTriangles(side * side, faces), flat, flat), true).stats;
  };
  const std::vector<Face> faces = Topology::grid(side, side).faces();
  EXPECT_EQ(statsOf(faces).unfolded_bodies, 1u);
  std::vector<Face> turned = faces, three = faces;
  std::swap(turned[1600][1], turned[1600][2]);
  three.push_back({faces[1600][0], faces[1600][1], faces[10][0]});
  for (const std::vector<Face>& list : {turned, three}) {
    EXPECT_EQ(statsOf(list).unfolded_bodies, 0u);
    EXPECT_EQ(statsOf(list).unfolded_parts, 1u) << "all but the cells at that place";
    EXPECT_GT(statsOf(list)[Stage::BROAD_PHASE].in, 0u);
  }
}

}  // namespace
}  // namespace dccd
