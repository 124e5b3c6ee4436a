#include "dccd/stream.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace dccd {
namespace {

constexpr StampNs MS = 1000000;
constexpr std::int64_t NOW = 0, LATER = 10000 * MS;

/// A triangle in the plane z = 0 and one above it that points down with vertex 3.
std::shared_ptr<const Topology> twoTriangles() {
  static const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}}));
  return topology;
}
MeshFrame pair(StampNs stamp_ns, double tip_z) {
  return {stamp_ns,
          twoTriangles(),
          {{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}, {0, 0, tip_z}, {0.5, 0, tip_z + 1}, {-0.5, 0, tip_z + 1}},
          false,
          Eigen::Isometry3d::Identity()};
}

std::shared_ptr<const Topology> oneTriangle() {
  static const auto topology = std::make_shared<const Topology>(Topology::fromTriangles(3, {{0, 1, 2}}));
  return topology;
}
MeshFrame floor(StampNs stamp_ns, double z) {
  return {stamp_ns, oneTriangle(), {{-1, -1, z}, {1, -1, z}, {0, 1, z}}, false, Eigen::Isometry3d::Identity()};
}
MeshFrame tip(StampNs stamp_ns, double z) {
  return {
      stamp_ns, oneTriangle(), {{0, 0, z}, {0.5, 0, z + 1}, {-0.5, 0, z + 1}}, false, Eigen::Isometry3d::Identity()};
}

MonitorOptions loose() {
  MonitorOptions options;
  options.store.max_vertex_step_m = 0;
  return options;
}

Body named(const std::string& name) {
  Body body;
  body.name = name;
  return body;
}

Outcome only(Monitor& monitor, std::int64_t now = NOW) {
  Outcome outcome, more;
  EXPECT_TRUE(monitor.next(now, outcome));
  EXPECT_FALSE(monitor.next(now, more));
  return outcome;
}

void expectAddsUp(const Monitor& monitor) {
  const FrameCounters all = monitor.total();
  EXPECT_EQ(all.received, all.processed() + all.started() + all.skipped() + all.waiting());
}

class OneBody : public ::testing::Test {
 protected:
  Monitor monitor{loose(), {named("cloth")}};
  Outcome feed(MeshFrame frame) {
    monitor.countReceived(0);
    monitor.push(0, std::move(frame), NOW);
    return only(monitor);
  }
};

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

/// What ends a step that has no budget ends it also where frames come as a stream, which makes a deadline of its own.
TEST(StreamLimits, AStepWithoutABudgetEndsAtMaxCompute) {
  for (const bool budget : {false, true}) {
    MonitorOptions options = loose();
    (budget ? options.detector.step_budget_ms : options.detector.max_compute_ms) = 1e-6;
    Monitor monitor(options, {named("cloth")});
    for (const double z : {1.0, -3.0}) {
      monitor.countReceived(0);
      monitor.push(0, pair(z > 0 ? 100 * MS : 200 * MS, z), NOW);
    }
    Outcome outcome;
    ASSERT_TRUE(monitor.next(NOW, outcome));
    ASSERT_TRUE(monitor.next(NOW, outcome));
    EXPECT_EQ(outcome.status, StepStatus::DEADLINE) << outcome.reason;
    EXPECT_FALSE(assuranceOf(outcome).proved);
  }
}

/// A step and the prediction after it share the time that a step may take.
TEST(StreamLimits, APredictionHasItsShareOfTheTime) {
  MonitorOptions options = loose();
  const auto stepMs = [&] { return Monitor(options, {named("cloth")}).stepMs(); };
  EXPECT_EQ(stepMs(), 0);
  options.detector.max_compute_ms = 400;
  EXPECT_EQ(stepMs(), 400);
  options.look_ahead_s = 0.1;
  EXPECT_EQ(stepMs(), 300);
  options.detector.step_budget_ms = 2e-6;
  EXPECT_EQ(stepMs(), 1.5e-6);
  Monitor monitor(options, {named("cloth")});
  for (const double z : {1.0, -3.0}) {
    monitor.countReceived(0);
    monitor.push(0, pair(z > 0 ? 100 * MS : 200 * MS, z), NOW);
  }
  Outcome outcome;
  while (monitor.next(NOW, outcome)) {
  }
  EXPECT_EQ(outcome.status, StepStatus::DEADLINE);
  EXPECT_EQ(monitor.predict().status, StepStatus::DEADLINE);
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

// A flat sheet cannot touch itself, which takes no pair and no time; whether it did so at the start is left open.
TEST_F(OneBody, AStartStateWithoutTimeIsNoClearStep) {
  feed(floor(100 * MS, 0));
  EXPECT_TRUE(assuranceOf(feed(floor(200 * MS, 1))).clear());
  monitor.reset(StepStatus::RESET);
  MonitorOptions hurried = loose();
  hurried.detector.step_budget_ms = 1e-6;
  monitor.setOptions(hurried);
  feed(floor(300 * MS, 0));
  const Outcome outcome = feed(floor(400 * MS, 1));
  EXPECT_EQ(outcome.status, StepStatus::DEADLINE);
  EXPECT_EQ(outcome.start_state, StartState::NOT_CHECKED);
  EXPECT_FALSE(outcome.complete);
  EXPECT_FALSE(assuranceOf(outcome).clear());
  EXPECT_TRUE(std::isinf(outcome.unchecked_toc_lower)) << "no pair was left out";
  EXPECT_NE(outcome.reason.find("start state"), std::string::npos) << outcome.reason;
  const Outcome question = monitor.checkNow();
  EXPECT_TRUE(question.complete) << "a question takes the time that it takes";
  EXPECT_TRUE(assuranceOf(question).clear());
}

TEST_F(OneBody, NeverAcrossASeam) {
  feed(pair(1000 * MS, 1));
  EXPECT_EQ(feed(pair(2000 * MS, -1)).status, StepStatus::GAP);
  EXPECT_EQ(feed(pair(500 * MS, 1)).status, StepStatus::TIME_JUMP);
  EXPECT_EQ(feed(pair(500 * MS, 1)).status, StepStatus::DUPLICATE);
  MeshFrame other{600 * MS, oneTriangle(), {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, false, Eigen::Isometry3d::Identity()};
  EXPECT_EQ(feed(other).status, StepStatus::TOPOLOGY_CHANGED);
  other.stamp_ns = 650 * MS;
  EXPECT_TRUE(assuranceOf(feed(other)).clear()) << "recovered with the second frame";
  expectAddsUp(monitor);
  EXPECT_EQ(monitor.total().started(), 4u);
  EXPECT_EQ(monitor.total().skipped(), 1u);
}

TEST_F(OneBody, RefusedFramesYieldOutcomesInOrder) {
  feed(pair(0, 1));
  monitor.countReceived(0, 2);
  monitor.skip(0, StepStatus::BAD_MESSAGE, 10 * MS, "index 7");
  monitor.push(0, pair(20 * MS, 0.9), NOW);
  Outcome outcome;
  ASSERT_TRUE(monitor.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::BAD_MESSAGE);
  EXPECT_EQ(outcome.reason, "index 7");
  EXPECT_FALSE(outcome.answered);
  EXPECT_FALSE(assuranceOf(outcome).clear());
  ASSERT_TRUE(monitor.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::OK) << "from the frame before the refused one";
  EXPECT_EQ(outcome.start_ns, 0);
  expectAddsUp(monitor);
}

TEST_F(OneBody, ResetForgets) {
  feed(pair(0, 1));
  monitor.reset();
  EXPECT_EQ(feed(pair(10 * MS, -1)).status, StepStatus::FIRST_FRAME);
}

TEST_F(OneBody, MapIsMissedOnlyWhenExpected) {
  feed(pair(0, 1));
  EXPECT_EQ(feed(pair(10 * MS, 0.9)).status, StepStatus::OK);
  MonitorOptions options = loose();
  options.detector.obstacle_expected = true;
  monitor.setOptions(options);
  const Outcome none = feed(pair(20 * MS, 0.8));
  EXPECT_EQ(none.status, StepStatus::NO_MAP);
  EXPECT_FALSE(assuranceOf(none).clear());
  monitor.setMap({VoxelSurface::build(0.1, {}), 0, Eigen::Isometry3d::Identity(), {}});
  EXPECT_EQ(feed(pair(30 * MS, 0.7)).status, StepStatus::OK) << "an empty map is a map";
}

// What the meshes are to each other does not change with the map.
TEST_F(OneBody, AMapThatComesStartsNoSearchOfTheMeshes) {
  // Folded, and turned so that the bounds of the two layers overlap.
  const auto topology = std::make_shared<const Topology>(Topology::grid(12, 12));
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.7, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  StampNs stamp_ns = 0;
  const auto searched = [&] {
    MeshFrame frame{stamp_ns += 100 * MS, topology, {}, false, Eigen::Isometry3d::Identity()};
    for (int i = 0; i < 144; ++i) {
      const int y = i / 12;
      const Vec3 folded = y < 6 ? Vec3(i % 12, y, 0) : Vec3(i % 12, 11 - y, 0.05);
      frame.positions.push_back(turn * folded + Vec3(0, 0, static_cast<double>(stamp_ns) * 1e-9));
    }
    return feed(std::move(frame)).stats[Stage::START_STATE].in;
  };
  searched();
  EXPECT_GT(searched(), 0u);
  EXPECT_EQ(searched(), 0u);
  for (int i = 0; i < 3; ++i) {
    monitor.setMap({VoxelSurface::build(0.1, {}), stamp_ns, Eigen::Isometry3d::Identity(), {}});
    EXPECT_EQ(searched(), 0u);
  }
  monitor.reset(StepStatus::RESET);
  searched();
  EXPECT_GT(searched(), 0u);
}

TEST_F(OneBody, OldMapIsNoMap) {
  MonitorOptions options = loose();
  options.detector.obstacle_expected = true;
  options.octomap_timeout_s = 1;
  monitor.setOptions(options);
  monitor.setMap({VoxelSurface::build(0.1, {}), 1000 * MS, Eigen::Isometry3d::Identity(), {}});
  feed(pair(1900 * MS, 1));
  EXPECT_EQ(feed(pair(1950 * MS, 1)).status, StepStatus::OK);
  EXPECT_EQ(feed(pair(2001 * MS, 1)).status, StepStatus::NO_MAP);
}

TEST_F(OneBody, VoxelContactInTheMapsFrame) {
  // The map's frame stands 10 m above the fixed frame's: voxel [0, 1]^3 there is [0, 1]^2 x [10, 11] here.
  ObstacleMap map{VoxelSurface::build(1.0, {{{32768, 32768, 32768}, 1}}), 0, Eigen::Isometry3d::Identity(), {}};
  map.map_from_fixed.translation() = Vec3(0, 0, -10);
  monitor.setMap(std::move(map));
  const auto at = [](StampNs stamp_ns, double z) {
    return MeshFrame{stamp_ns,
                     oneTriangle(),
                     {{0.5, 0.5, z}, {0.6, 0.5, z + 1}, {0.5, 0.6, z + 1}},
                     false,
                     Eigen::Isometry3d::Identity()};
  };
  feed(at(0, 12));
  const Outcome outcome = feed(at(100 * MS, 10));
  ASSERT_FALSE(outcome.contacts.empty());
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-9);
  const Contact& contact = outcome.contacts.front();
  EXPECT_EQ(contact.body[1], OBSTACLE_BODY);
  const ContactGeometry geometry = contactGeometry(outcome, contact);
  EXPECT_NEAR(geometry.point.z(), 11, 1e-6);
  EXPECT_NEAR(geometry.normal.z(), 1, 1e-9);
  EXPECT_NEAR(geometry.approach_speed, 2, 1e-9);

  MonitorOptions options = loose();
  options.detector.exclude_boxes = {{{0, 0, 10}, {1, 1, 11}}};
  monitor.setOptions(options);
  feed(at(200 * MS, 12));
  const Outcome excluded = feed(at(300 * MS, 10));
  EXPECT_TRUE(excluded.contacts.empty());
  EXPECT_EQ(excluded.excluded_voxels, 1u);
  EXPECT_TRUE(assuranceOf(excluded).clear()) << "what is excluded is not looked at";
}

// An excluded voxel is free space, so what lies behind it is exposed.
TEST_F(OneBody, WhatLiesBehindAnExcludedVoxelIsTouched) {
  MonitorOptions options = loose();
  options.detector.exclude_boxes = {{{0, 0, 1}, {2, 2, 2}}};
  monitor.setOptions(options);
  monitor.setMap({VoxelSurface::build(1.0, {{{32768, 32768, 32768}, 2}}), 0, Eigen::Isometry3d::Identity(), {}});
  const auto at = [](StampNs stamp_ns, double z) {
    return MeshFrame{stamp_ns,
                     oneTriangle(),
                     {{0.5, 0.5, z}, {0.6, 0.5, z + 1}, {0.5, 0.6, z + 1}},
                     false,
                     Eigen::Isometry3d::Identity()};
  };
  feed(at(0, 3));
  const Outcome outcome = feed(at(100 * MS, 0.5));
  EXPECT_EQ(outcome.excluded_voxels, 4u);
  ASSERT_FALSE(outcome.contacts.empty());
  EXPECT_NEAR(outcome.earliest_toc, 0.8, 1e-9) << "from 3 m to the upper face of what is left, at 1 m";
  monitor.setOptions(loose());
  feed(at(200 * MS, 3));
  EXPECT_NEAR(feed(at(300 * MS, 0.5)).earliest_toc, 0.4, 1e-9) << "nothing is excluded any more";
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
}

TEST_F(OneBody, MaskedVerticesMeetNothing) {
  Body masked = named("cloth");
  masked.vertex_mask = {3};
  Monitor other(loose(), {masked});
  other.push(0, pair(0, 1), NOW);
  other.push(0, pair(100 * MS, 0.2 - 1), NOW);
  Outcome outcome;
  other.next(NOW, outcome);
  ASSERT_TRUE(other.next(NOW, outcome));
  for (const Contact& contact : outcome.contacts) {
    for (const Index v : contact.vertex) EXPECT_NE(v, 3u);
  }
  masked.vertex_mask = {6};
  Monitor wrong(loose(), {masked});
  wrong.push(0, pair(0, 1), NOW);
  wrong.push(0, pair(100 * MS, 0.9), NOW);
  wrong.next(NOW, outcome);
  ASSERT_TRUE(wrong.next(NOW, outcome));
  EXPECT_EQ(outcome.status, StepStatus::INTERNAL_ERROR);
  EXPECT_NE(outcome.reason.find("vertex_mask"), std::string::npos);
}

TEST_F(OneBody, PredictionMeetsWhatIsObservedLater) {
  MonitorOptions options = loose();
  options.look_ahead_s = 0.4;
  monitor.setOptions(options);
  EXPECT_FALSE(monitor.predict().answered);
  feed(pair(0, 2));
  ASSERT_TRUE(assuranceOf(feed(pair(100 * MS, 1.5))).clear());
  const Outcome ahead = monitor.predict();
  ASSERT_EQ(ahead.status, StepStatus::OK) << ahead.reason;
  EXPECT_NEAR(ahead.earliest_toc, 0.75, 1e-9) << "0.3 s of 0.4 s";
  EXPECT_EQ(ahead.stamp_ns, 500 * MS);
  const Outcome next = feed(pair(200 * MS, 1));
  EXPECT_TRUE(assuranceOf(next).clear()) << "a prediction leaves the observed steps alone";
}

// What the last step knows of its end is the prediction's start, without a search; a question searches.
TEST_F(OneBody, PredictionsKnowTheirStartFromTheLastStep) {
  for (const Accuracy rung : {Accuracy::EXACT, Accuracy::CONSERVATIVE, Accuracy::FAST}) {
    MonitorOptions options = loose();
    options.look_ahead_s = 0.1;
    options.detector.accuracy.rung = rung;
    monitor.reset(StepStatus::RESET);
    monitor.setOptions(options);
    StampNs stamp_ns = 0;
    feed(pair(stamp_ns, 1));
    for (const double tip_z : {0.5, -0.5, -0.25, 1.0, 1.25}) {
      ASSERT_TRUE(feed(pair(stamp_ns += 100 * MS, tip_z)).answered);
      const Outcome ahead = monitor.predict(), question = monitor.checkNow();
      EXPECT_EQ(ahead.start_state, tip_z < 0 ? StartState::INTERSECTING : StartState::CLEAR) << tip_z;
      EXPECT_TRUE(std::equal(ahead.intersections.begin(), ahead.intersections.end(), question.intersections.begin(),
                             question.intersections.end(),
                             [](const auto& a, const auto& b) { return a.body == b.body && a.vertex == b.vertex; }));
      // `fast` may have missed what led there. Where the bounds are apart, a search comes to no pair either.
      EXPECT_EQ(ahead.stats[Stage::START_STATE].in > 0, rung == Accuracy::FAST && tip_z < 0) << toString(rung) << tip_z;
      EXPECT_EQ(question.stats[Stage::START_STATE].in > 0, tip_z < 0) << tip_z;
    }
  }
}

TEST_F(OneBody, CheckNowLooksAtTheNewestFrame) {
  EXPECT_FALSE(monitor.checkNow().answered);
  feed(pair(0, 0));
  const Outcome touching = monitor.checkNow();
  EXPECT_TRUE(touching.answered);
  EXPECT_FALSE(touching.contacts.empty());
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

// Seen through the floor and back between two frames of it: whatever the straight path says, that is not clear.
TEST_F(TwoBodies, FramesBetweenTheEndsThatLeaveThePathAreNoClearStep) {
  const auto lastOf = [](double middle) {
    Monitor two(loose(), {named("floor"), named("tip")});
    two.push(1, tip(0, 1), NOW);
    two.push(0, floor(0, 0), NOW);
    only(two);
    two.push(1, tip(50 * MS, middle), NOW);
    two.push(1, tip(100 * MS, 1), NOW);
    two.push(0, floor(100 * MS, 0), NOW);
    return only(two);
  };
  const Outcome straight = lastOf(1.0005);
  EXPECT_EQ(straight.status, StepStatus::OK);
  EXPECT_TRUE(assuranceOf(straight).clear());
  const Outcome through = lastOf(-1);
  EXPECT_EQ(through.status, StepStatus::PARTIAL);
  EXPECT_FALSE(assuranceOf(through).clear());
  EXPECT_NE(through.reason.find("body 'tip' was seen up to 2 m off the path"), std::string::npos) << through.reason;
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

TEST(StaticBody, HoldsAtAllTimes) {
  Body table = named("table");
  table.motion = BodyMotionKind::STATIC;
  Monitor monitor(loose(), {named("tip"), table});
  Outcome outcome;
  monitor.push(0, tip(0, 1), NOW);
  monitor.push(1, floor(5, 0), NOW);
  monitor.push(0, tip(100 * MS, -1), NOW);
  ASSERT_TRUE(monitor.next(NOW, outcome));
  ASSERT_TRUE(monitor.next(NOW, outcome));
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  EXPECT_NEAR(outcome.earliest_toc, 0.5, 1e-9);
}

// A static body's frame that cannot be used leaves the one before in its place.
TEST(StaticBody, KeepsItsPlaceWhenAFrameIsRefused) {
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

// Options that are refused change nothing, not even those that could have been taken.
TEST(MonitorOptionsTest, RefusedOnesLeaveTheOldOnesInForce) {
  MonitorOptions options;
  options.detector.accuracy.rung = Accuracy::CONSERVATIVE;
  Body felt = named("felt");
  felt.minimum_separation_m = 0.01;
  Monitor monitor(options, {felt});
  monitor.push(0, tip(0, 0), NOW);
  only(monitor);
  monitor.push(0, tip(100 * MS, 0), NOW);
  EXPECT_EQ(only(monitor).status, StepStatus::OK);
  MonitorOptions wrong = options;
  wrong.detector.accuracy.rung = Accuracy::EXACT;
  wrong.store.max_vertex_step_m = 0;
  EXPECT_THROW(monitor.setOptions(wrong), std::invalid_argument);
  EXPECT_EQ(monitor.push(0, tip(200 * MS, 3), NOW), StepStatus::TELEPORT);
}

TEST(MonitorOptionsTest, OutOfRangeNamesTheOption) {
  MonitorOptions options;
  options.sync_timeout_s = -1;
  EXPECT_THROW(Monitor(options, {named("a")}), std::invalid_argument);
  options = {};
  options.clock_body = 1;
  EXPECT_THROW(Monitor(options, {named("a")}), std::invalid_argument);
  options = {};
  options.detector.exclude_boxes = {Box{}};
  EXPECT_THROW(Monitor(options, {named("a")}), std::invalid_argument);
}

}  // namespace
}  // namespace dccd
