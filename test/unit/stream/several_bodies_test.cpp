// Several bodies in one stream: one is the clock, the others are interpolated, waited for, or static.
#include <gtest/gtest.h>

#include "stream/monitor_impl.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

/// The step of both to this stamp.
Outcome stepOf(Monitor& two, StampNs stamp_ns, double tip_z, double floor_z = 0) {
  two.push(1, tip(stamp_ns, tip_z), NOW);
  two.push(0, floor(stamp_ns, floor_z), NOW);
  return only(two);
}

class TwoBodies : public ::testing::Test {
 protected:
  Monitor monitor{loose(), {named("floor"), named("tip")}};  // the floor is the clock
  void feed(std::size_t body, MeshFrame frame, std::int64_t now = NOW) {
    monitor.countReceived(body);
    monitor.push(body, std::move(frame), now);
  }
};

TEST_F(TwoBodies, OthersAreInterpolatedAtBothEnds) {
  feed(0, floor(100 * MS, 0));
  EXPECT_EQ(only(monitor).status, StepStatus::FIRST_FRAME);
  feed(1, tip(0, 4));
  feed(0, floor(200 * MS, 0));
  Outcome outcome;
  EXPECT_FALSE(monitor.next(NOW, outcome)) << "waits for the tip";
  EXPECT_TRUE(monitor.waiting());
  feed(1, tip(400 * MS, -4));  // 2 at 100 ms, 0 at 200 ms
  outcome = only(monitor);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_NEAR((*outcome.step->bodies[1].t0)[0].z(), 2, 1e-12);
  EXPECT_NEAR(outcome.earliest_toc, 1, 1e-9);
  EXPECT_EQ(outcome.contacts[0].body, (std::array<std::uint16_t, 2>{1, 0}));
  expectAddsUp(monitor);
}

// Seen through the floor and back between two frames of it: the step goes by where it was.
TEST_F(TwoBodies, FramesBetweenTheEndsThatLeaveTheStraightWayAreFollowed) {
  const auto lastOf = [](double middle) {
    Monitor two(loose(), {named("floor"), named("tip")});
    stepOf(two, 0, 1);
    two.push(1, tip(50 * MS, middle), NOW);
    return stepOf(two, 100 * MS, 1);
  };
  const Outcome straight = lastOf(1.0005);
  EXPECT_EQ(straight.status, StepStatus::OK);
  EXPECT_EQ(straight.substeps, 1u);
  EXPECT_TRUE(assuranceOf(straight).clear());
  const Outcome through = lastOf(-1);
  EXPECT_EQ(through.status, StepStatus::OK) << through.reason;
  EXPECT_EQ(through.substeps, 2u);
  EXPECT_EQ(through.touching, Touching::NEW);
  EXPECT_NEAR(through.earliest_toc, 0.25, 1e-9);
}

// From below to above by a stamp that goes back by a nanosecond: the step before and the one after are whole, each in a
// run of its own, and nobody saw what lies between.
TEST_F(TwoBodies, AJumpOfAnotherBodyBetweenTwoStepsIsASeam) {
  constexpr StampNs START = 1700000000000 * MS;
  for (const StampNs back_ns : {StampNs{1}, StampNs{10 * MS}, StampNs{100 * MS}, StampNs{5000 * MS}}) {
    Monitor two(loose(), {named("floor"), named("tip")});
    const auto step = [&](int k, double tip_z) { return stepOf(two, START + 100 * k * MS, tip_z); };
    step(0, -1.5);
    EXPECT_TRUE(assuranceOf(step(1, -1.5)).clear()) << "the tip, 1 high, is below";
    two.push(1, tip(START + 100 * MS - back_ns, 1), NOW);
    std::vector<Outcome> outcomes;
    for (int k = 2; k < 6; ++k) outcomes.push_back(step(k, 1));
    // After a jump by more than max_step_s the frame that follows it comes after a gap, too.
    EXPECT_EQ(outcomes[0].status, back_ns < 1000 * MS ? StepStatus::TIME_JUMP : StepStatus::GAP) << back_ns << " ns";
    EXPECT_FALSE(outcomes[0].answered);
    EXPECT_NE(outcomes[0].reason.find("body 'tip'"), std::string::npos) << outcomes[0].reason;
    EXPECT_EQ(outcomes[1].status, StepStatus::OK) << "said once";
    EXPECT_TRUE(assuranceOf(outcomes[3]).clear());
    expectAddsUp(two);
  }
}

// Of the frames that a step lies between one had a face that could not be used: then not all was looked at. It was also
// more uncertain: so was the step.
TEST_F(TwoBodies, WhatAnyFrameOfTheStepLacksIsMissing) {
  MonitorOptions options = loose();
  options.detector.accuracy.rung = Accuracy::CONSERVATIVE;  // which holds a distance
  for (int lacking = 0; lacking < 5; ++lacking) {
    Monitor two(options, {named("floor"), named("tip")});
    std::vector<Outcome> outcomes;
    for (int k = 0; k < 5; ++k) {  // the floor's frames lie in the middle between the tip's
      MeshFrame frame = tip(100 * k * MS, 1);
      frame.dropped_faces = k == lacking ? 3 : 0;
      frame.radius_m.assign(frame.positions.size(), k == lacking ? 0.002 : 0.001);
      two.push(1, std::move(frame), NOW);
      if (k == 0) continue;
      two.push(0, floor((100 * k - 50) * MS, 0), NOW);
      outcomes.push_back(only(two));
    }
    for (int step = 1; step < 4; ++step) {  // from the middle after frame step - 1 to the middle after frame step
      const bool lacks = lacking >= step - 1 && lacking <= step + 1;
      const Outcome& outcome = outcomes[static_cast<std::size_t>(step)];
      EXPECT_EQ(outcome.stats.unchecked_faces, lacks ? 3u : 0u) << "step " << step << ", frame " << lacking;
      EXPECT_EQ(assuranceOf(outcome).clear(), !lacks);
      const std::vector<double>& radius_m = *outcome.step->bodies[1].radius_m;
      EXPECT_EQ(radius_m, std::vector<double>(radius_m.size(), lacks ? 0.002 : 0.001));
    }
  }
}

TEST_F(TwoBodies, MissingBodyIsNoAnswerAfterTheTimeout) {
  feed(0, floor(100 * MS, 0));
  only(monitor);
  feed(0, floor(200 * MS, 0));
  Outcome outcome;
  EXPECT_FALSE(monitor.next(NOW, outcome));
  outcome = only(monitor, LATER);
  EXPECT_EQ(outcome.status, StepStatus::NO_BODY);
  EXPECT_NE(outcome.reason.find("tip"), std::string::npos);
  EXPECT_FALSE(assuranceOf(outcome).clear());
  expectAddsUp(monitor);
}

TEST_F(TwoBodies, SeamOfAnotherBodyIsASeamOfTheStep) {
  feed(0, floor(1000 * MS, 0));
  feed(1, tip(0, 4));
  feed(1, tip(1100 * MS, 4));
  only(monitor);
  feed(0, floor(1050 * MS, 0));
  const Outcome outcome = only(monitor);
  EXPECT_EQ(outcome.status, StepStatus::GAP);
  EXPECT_NE(outcome.reason.find("tip"), std::string::npos);
}

// The other body has gone on to another topology while the step waited; the step is still in the one before.
TEST_F(TwoBodies, TopologyIsThatOfTheStepNotTheNewest) {
  // Of the same four vertices, the first topology takes the tip and the second does not.
  const auto with_tip = std::make_shared<const Topology>(Topology::fromTriangles(4, {{0, 1, 2}}));
  const auto without = std::make_shared<const Topology>(Topology::fromTriangles(4, {{1, 2, 3}}));
  const auto four = [](StampNs stamp_ns, const std::shared_ptr<const Topology>& topology, double z) {
    return MeshFrame{stamp_ns, topology, {{0, 0, z}, {0.5, 0, z + 5}, {-0.5, 0, z + 5}, {0, 0.5, z + 5}}};
  };
  const MeshFrame fewer = tip(200 * MS, 9);
  for (const MeshFrame& newest : {four(200 * MS, without, 9), fewer}) {
    monitor.reset();
    feed(0, floor(0, 0));
    only(monitor);
    feed(1, four(0, with_tip, 1));
    feed(1, four(100 * MS, with_tip, -1));
    feed(1, newest);
    feed(0, floor(100 * MS, 0));
    const Outcome outcome = only(monitor);
    ASSERT_EQ(outcome.status, StepStatus::PARTIAL) << "vertex 3 belongs to no face";
    EXPECT_EQ(outcome.stats.unchecked_vertices, 1u);
    EXPECT_EQ(outcome.step->bodies[1].topology, with_tip);
    ASSERT_FALSE(outcome.contacts.empty());
    EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-9);
    // From the seam on it is the new one that counts.
    feed(0, floor(200 * MS, 0));
    EXPECT_EQ(only(monitor).status, StepStatus::TOPOLOGY_CHANGED);
    MeshFrame last = newest;
    last.stamp_ns = 300 * MS;
    feed(1, last);
    feed(0, floor(300 * MS, 0));
    const Outcome next = only(monitor);
    EXPECT_TRUE(next.answered) << next.reason;
    EXPECT_EQ(*next.step->bodies[1].topology, *newest.topology);
    EXPECT_TRUE(next.contacts.empty());
  }
  expectAddsUp(monitor);
}

TEST_F(TwoBodies, WhatWaitedInVainAlreadyIsNotCountedAsReset) {
  monitor.setOptions([] {
    MonitorOptions options = loose();
    options.max_waiting = 1;
    return options;
  }());
  feed(0, floor(100 * MS, 0));
  only(monitor);
  feed(0, floor(200 * MS, 0));  // waits for the tip
  feed(0, floor(300 * MS, 0));  // and gives way to this one: NO_BODY
  monitor.reset(StepStatus::DISABLED);
  EXPECT_EQ(monitor.total().of(StepStatus::NO_BODY), 1u);
  EXPECT_EQ(monitor.total().of(StepStatus::DISABLED), 1u);
  expectAddsUp(monitor);
}

TEST_F(TwoBodies, TimeJumpDropsWhatWaits) {
  feed(0, floor(1000 * MS, 0));
  only(monitor);
  feed(0, floor(1050 * MS, 0));
  feed(0, floor(10 * MS, 0));
  Outcome outcome;
  ASSERT_TRUE(monitor.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::NO_BODY);
  ASSERT_TRUE(monitor.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::TIME_JUMP);
  expectAddsUp(monitor);
}

// At all times; a frame that cannot be used leaves the one before in its place.
TEST(StaticBody, HoldsAlsoWhenAFrameIsRefused) {
  Body table = named("table");
  table.motion = BodyMotionKind::STATIC;
  Monitor monitor(loose(), {named("tip"), table});
  monitor.push(1, floor(0, 0), NOW);
  monitor.push(0, tip(100 * MS, 1), NOW);
  only(monitor);
  MeshFrame bad = floor(0, 0);
  bad.positions.pop_back();
  EXPECT_EQ(monitor.push(1, bad, NOW), StepStatus::VERTEX_COUNT);
  monitor.push(0, tip(200 * MS, -1), NOW);
  const Outcome outcome = only(monitor);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-9);
}

}  // namespace
}  // namespace test
}  // namespace dccd
