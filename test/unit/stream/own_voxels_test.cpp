// Which voxels of a map are a body's own, as a monitor has them: what is beside the table of voxel_states_test.cpp.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <set>
#include <thread>

#include "dccd/assurance.h"
#include "obstacle/voxel_tree.h"
#include "support/closed_meshes.h"
#include "support/shapes.h"
#include "unit/failing_allocations.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

constexpr double VOXEL_M = 0.1;

/// A voxel's place from the map's origin, in voxels.
using Cell = std::array<int, 3>;
using Cells = std::set<Cell>;

Cells operator+(Cells a, const Cells& b) {
  a.insert(b.begin(), b.end());
  return a;
}

/// One layer of voxels, from x and y on to before `to`.
Cells layer(int z, int from, int to) {
  Cells cells;
  for (int x = from; x < to; ++x) {
    for (int y = from; y < to; ++y) cells.insert({x, y, z});
  }
  return cells;
}
/// 10 x 10 voxels below z = `top` * 0.1 m.
Cells slab(int top) { return layer(top - 1, 0, 10); }
/// The voxels in which a sheet lies.
Cells voxelsOf(double z) { return layer(static_cast<int>(std::floor(z / VOXEL_M)), 3, 8); }

std::vector<OccupiedLeaf> leavesOf(const Cells& cells) {
  std::vector<OccupiedLeaf> leaves;
  for (const auto& [x, y, z] : cells) leaves.push_back(voxelAt(x, y, z));
  return leaves;
}

ObstacleMap mapOf(double resolution_m, std::vector<OccupiedLeaf> leaves, StampNs stamp_ns,
                  const std::string& frame_id = "map") {
  ObstacleMap map;
  map.surface = VoxelSurface::build(resolution_m, std::move(leaves));
  map.stamp_ns = stamp_ns;
  map.frame_id = frame_id;
  return map;
}

/// A square sheet of 0.4 m side at x, y in [0.31, 0.71], flat at the height z.
MeshFrame sheet(StampNs stamp_ns, double z) {
  static const auto topology = share(Topology::grid(9, 9));
  return {stamp_ns, topology, gridAt(9, 9, 0.05, {0.31, 0.31, z})};
}

class OwnVoxels : public ::testing::Test {
 protected:
  void SetUp() override { start(0.05); }
  void start(double reach_m, bool trust = false, double lag_s = 0, bool beside = false) {
    Body body = named("cloth");
    body.own_voxels_m = reach_m;
    MonitorOptions options = loose();
    options.detector.obstacle_expected = true;
    options.own_voxels_lag_s = lag_s;
    options.own_voxels_trust = trust;
    options.own_voxels_beside = beside;
    options.store.max_step_s = 2;
    monitor_ = std::make_unique<Monitor>(options, std::vector<Body>{body});
  }
  /// known: what is free; null: what is left out. found: where the sensor saw something; null: it does not tell.
  void map(StampNs stamp_ns, const Cells& cells, const Cells* known = nullptr, const Cells* found = nullptr) {
    ObstacleMap map = mapOf(VOXEL_M, leavesOf(cells), stamp_ns);
    if (known) map.known = KnownSpace::build(VOXEL_M, leavesOf(cells + *known));
    if (found) {
      std::vector<OccupiedLeaf> leaves = leavesOf(*found);
      std::sort(leaves.begin(), leaves.end(), [](const auto& a, const auto& b) { return codeOf(a) < codeOf(b); });
      map.known = KnownSpace::build(VOXEL_M, leavesOf(cells + *known), leaves);
    }
    monitor_->setMap(std::move(map));
  }
  Outcome feed(StampNs stamp_ns, double z) {
    monitor_->countReceived(0);
    monitor_->push(0, sheet(stamp_ns, z), NOW);
    return only(*monitor_);
  }
  /// The sheet at z = 0.55 m, 0.5 m above a floor that a map showed before it came.
  void hoverAboveFloor() {
    map(-100 * MS, slab(1));
    feed(0, 0.55);
    map(0, slab(1));
    ASSERT_TRUE(assuranceOf(feed(100 * MS, 0.55)).clear());
  }
  static std::uint64_t own(const Outcome& outcome) { return outcome.step->map.own.own; }
  static std::uint64_t doubted(const Outcome& outcome) { return outcome.step->map.own.doubted; }

  std::unique_ptr<Monitor> monitor_;
};

TEST_F(OwnVoxels, WhatAMapFirstShowsWhereTheBodyIsIsNoObstacle) {
  hoverAboveFloor();
  map(150 * MS, slab(1) + voxelsOf(0.55));
  const Outcome outcome = feed(200 * MS, 0.55);
  EXPECT_TRUE(assuranceOf(outcome).clear()) << describe(assuranceOf(outcome));
  EXPECT_EQ(own(outcome), 25u);
  EXPECT_EQ(outcome.excluded, std::vector<std::string>{
                                  "25 voxels of the map as own of body 'cloth', by a map that shows nothing as free"});
  EXPECT_EQ(outcome.stats[Effect::OWN_VOXELS].out, 25u);
  EXPECT_GE(outcome.stats[Effect::OWN_VOXELS].in, 25u);
  start(0);
  hoverAboveFloor();
  map(150 * MS, slab(1) + voxelsOf(0.55));
  EXPECT_EQ(assuranceOf(feed(200 * MS, 0.55)).touching, Touching::LASTING) << "none are own where none may be";
}

/// Each map is told by the frames that were there when it came, also where more come until that is done.
TEST_F(OwnVoxels, BesideTheStepsTheyAreTheSame) {
  start(0.05, false, 0, true);
  const std::unique_ptr<Monitor> beside = std::move(monitor_);
  start(0.05);
  const std::unique_ptr<Monitor> within = std::move(monitor_);
  const auto both = [&](const auto& act) {
    std::array<Outcome, 2> outcomes;
    for (int m = 0; m < 2; ++m) {
      Monitor& monitor = m == 0 ? *beside : *within;
      act(monitor);
      while (monitor.next(NOW, outcomes[m])) {
      }
    }
    return outcomes;
  };
  const Cells around = layer(8, 0, 60) + layer(9, 0, 60);  // so that it takes its time
  StampNs now_ns = 0;
  double z = 0.55;
  int waited = 0;
  for (int n = 0; n < 20; ++n) {
    const StampNs map_ns = now_ns;
    const Cells seen = n < 2 ? slab(1) : slab(1) + (n % 3 == 0 ? around : Cells()) + voxelsOf(z) + voxelsOf(z + 0.05);
    both([&](Monitor& monitor) { monitor.setMap(mapOf(VOXEL_M, leavesOf(seen), map_ns)); });
    std::array<Outcome, 2> outcomes;
    do {
      now_ns += 10 * MS;
      z -= 0.002;
      outcomes = both([&](Monitor& monitor) { monitor.push(0, sheet(now_ns, z), NOW); });
      waited += beside->mapWaitsSince().has_value();
    } while ((!outcomes[0].obstacle || outcomes[0].step->map.stamp_ns < map_ns) && now_ns < 100000 * MS);
    for (const Outcome& outcome : outcomes) ASSERT_EQ(outcome.step->map.stamp_ns, map_ns);
    EXPECT_EQ(own(outcomes[0]), own(outcomes[1])) << n;
    EXPECT_EQ(doubted(outcomes[0]), doubted(outcomes[1])) << n;
    EXPECT_EQ(outcomes[0].obstacle->leafCount(), outcomes[1].obstacle->leafCount()) << n;
  }
  EXPECT_GT(waited, 0) << "some step had the map before";
}

TEST_F(OwnVoxels, BesideTheStepsAMapGivesWayToNoneAndToTheEnd) {
  const Cells many = layer(8, 0, 100) + layer(6, 0, 100);
  for (const bool ends : {false, true}) {
    start(0.05, false, 0, true);
    map(-100 * MS, slab(1));
    feed(0, 0.55);
    map(0, many);
    if (ends) continue;
    monitor_->setMap({});
    EXPECT_EQ(feed(100 * MS, 0.55).status, StepStatus::NO_MAP);
    EXPECT_FALSE(monitor_->mapWaitsSince());
    map(150 * MS, slab(1) + voxelsOf(0.55));
    StampNs now_ns = 100 * MS;
    while (monitor_->mapInUse().stamp_ns < 150 * MS && now_ns < 100000 * MS) {
      feed(now_ns += 10 * MS, 0.55);
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    EXPECT_EQ(monitor_->mapInUse().stamp_ns, 150 * MS);
  }
}

/// The boom comes to the voxels in which the hand is, and the hand leaves them.
TEST_F(OwnVoxels, OfARobotOneLinkFollowsAnotherAndWhatItHoldsIt) {
  enum How { LINKS, HOLDS, NEITHER };
  for (const How how : {LINKS, HOLDS, NEITHER}) {
    Body hand = named("hand"), boom = named("boom");
    hand.own_voxels_m = boom.own_voxels_m = 0.05;
    if (how == LINKS) {
      hand.link = "hand";
      boom.link = "boom";
    }
    hand.not_against = {1};
    boom.not_against = {0};
    MonitorOptions options = loose();
    options.detector.obstacle_expected = true;
    options.own_voxels_lag_s = 0;
    if (how == HOLDS) options.held = {{{ExpectedPartner{0, {}, ""}, ExpectedPartner{1, {}, ""}}, ""}};
    monitor_ = std::make_unique<Monitor>(options, std::vector<Body>{hand, boom});
    const auto feedBoth = [&](StampNs stamp_ns, double hand_z, double boom_z) {
      monitor_->push(1, sheet(stamp_ns, boom_z), NOW);
      monitor_->push(0, sheet(stamp_ns, hand_z), NOW);
      Outcome outcome;
      while (monitor_->next(NOW, outcome)) {
      }
      return outcome;
    };
    map(-100 * MS, slab(1));
    feedBoth(0, 0.55, 2);
    map(50 * MS, slab(1) + voxelsOf(0.55));
    EXPECT_EQ(own(feedBoth(100 * MS, 0.55, 2)), 25u);
    feedBoth(200 * MS, 0.55, 0.62);
    feedBoth(300 * MS, 2, 0.62);
    feedBoth(400 * MS, 2, 0.62);
    map(310 * MS, slab(1) + voxelsOf(0.55));
    feedBoth(500 * MS, 2, 0.62);
    map(450 * MS, slab(1) + voxelsOf(0.55));
    const Outcome outcome = feedBoth(600 * MS, 2, 0.62);
    EXPECT_EQ(own(outcome), how == NEITHER ? 0u : 25u) << how;
    EXPECT_EQ(doubted(outcome), how == NEITHER ? 25u : 0u) << "what the hand brought may have stayed below the boom";
  }
}

TEST_F(OwnVoxels, OfARopeTheyLieAlongIt) {
  const auto topology = share(Topology::polyline(9));
  const auto feedRope = [&](StampNs stamp_ns) {
    monitor_->push(0, {stamp_ns, topology, gridAt(1, 9, 0.05, {0.31, 0.55, 0.55})}, NOW);
    return only(*monitor_);
  };
  map(0, slab(1));
  feedRope(50 * MS);
  feedRope(100 * MS);
  const Cells along{{3, 5, 5}, {4, 5, 5}, {5, 5, 5}, {6, 5, 5}, {7, 5, 5}}, beside{{5, 7, 5}};
  map(150 * MS, slab(1) + along + beside);
  const Outcome outcome = feedRope(200 * MS);
  EXPECT_TRUE(assuranceOf(outcome).clear()) << describe(assuranceOf(outcome));
  EXPECT_EQ(own(outcome), 5u);
  EXPECT_EQ(outcome.obstacle->leafCount(), 101u) << "what is beside it is an obstacle";
}

TEST_F(OwnVoxels, OfAStaticBodyTheyLieWhereItStands) {
  Body held = named("board");
  held.motion = BodyMotionKind::STATIC;
  held.own_voxels_m = 0.05;
  MonitorOptions options = loose();
  options.detector.obstacle_expected = true;
  monitor_ = std::make_unique<Monitor>(options, std::vector<Body>{named("cloth"), held});
  map(-100 * MS, slab(1));
  monitor_->push(1, sheet(0, 0.55), NOW);
  feed(0, 5);
  map(0, slab(1));
  feed(100 * MS, 5);
  map(150 * MS, slab(1) + voxelsOf(0.55) + Cells{{5, 5, 7}});
  const Outcome outcome = feed(200 * MS, 5);
  EXPECT_TRUE(assuranceOf(outcome).clear()) << describe(assuranceOf(outcome));
  EXPECT_EQ(own(outcome), 25u);
  EXPECT_EQ(outcome.obstacle->leafCount(), 101u) << "what is above it is an obstacle";
}

TEST_F(OwnVoxels, WhatWasThereBeforeStaysAnObstacle) {
  hoverAboveFloor();
  map(150 * MS, slab(1) + voxelsOf(0.55));
  feed(200 * MS, 0.12);
  map(200 * MS, slab(1) + voxelsOf(0.12));
  const Outcome near = feed(300 * MS, 0.12);
  EXPECT_TRUE(assuranceOf(near).clear());
  EXPECT_EQ(own(near), 25u) << "the floor's voxels lie within reach, and are older";
  const Outcome on = feed(400 * MS, 0.09);
  EXPECT_EQ(assuranceOf(on).touching, Touching::NEW);
  EXPECT_NEAR(on.earliest_toc, 2.0 / 3, 1e-6);
}

/// The step that takes a map fails at one allocation after the other; the next one has it, or proves nothing.
TEST_F(OwnVoxels, AMapOfAStepThatFailedIsNotLost) {
  const int allocations = failingEverywhere([&](int n) {
    SetUp();
    hoverAboveFloor();
    map(150 * MS, slab(1) + voxelsOf(0.25));
    monitor_->countReceived(0);
    monitor_->push(0, sheet(200 * MS, 0.55), NOW);
    Outcome outcome;
    const bool met = failsAt(n, false, [&] { monitor_->next(NOW, outcome); });
    while (monitor_->next(NOW, outcome)) {
    }
    EXPECT_EQ(assuranceOf(feed(300 * MS, 0.22)).touching, Touching::NEW);
    return met;
  });
  EXPECT_GE(allocations, 10);
}

TEST_F(OwnVoxels, WhatTheBodyLeftIsInDoubtUntilAMapHasClearedIt) {
  hoverAboveFloor();
  map(150 * MS, slab(1) + voxelsOf(0.55));
  feed(200 * MS, 0.25);
  map(200 * MS, slab(1) + voxelsOf(0.55) + voxelsOf(0.25));  // slow to clear
  const Outcome left = feed(300 * MS, 0.25);
  EXPECT_EQ(own(left), 25u);
  EXPECT_EQ(doubted(left), 25u);
  EXPECT_TRUE(assuranceOf(left).clear()) << "it touches nothing of its trail";
  const Outcome through = feed(400 * MS, 0.55);
  EXPECT_EQ(through.touching, Touching::NONE);
  EXPECT_FALSE(assuranceOf(through).proved) << "back through its own trail";
  feed(500 * MS, 0.25);
  map(500 * MS, slab(1) + voxelsOf(0.25));
  const Outcome cleared = feed(600 * MS, 0.25);
  EXPECT_EQ(own(cleared), 25u);
  EXPECT_EQ(doubted(cleared), 0u);
  map(600 * MS, slab(1) + voxelsOf(0.25));
  feed(700 * MS, 0.25);
  map(700 * MS, slab(1) + voxelsOf(0.55) + voxelsOf(0.25));
  const Outcome back = feed(800 * MS, 0.55);
  EXPECT_EQ(assuranceOf(back).touching, Touching::NEW) << "it was cleared, and came back where no body was";
}

TEST_F(OwnVoxels, WhatTheFirstMapShowsWithinReachIsInDoubt) {
  feed(0, 0.55);
  map(0, slab(1) + voxelsOf(0.55));
  const Outcome first = feed(100 * MS, 0.55);
  EXPECT_EQ(first.touching, Touching::NONE) << "no alarm";
  EXPECT_EQ(doubted(first), 25u);
  ASSERT_EQ(first.missing().size(), 1u);
  EXPECT_NE(first.missing()[0].find(
                "the step touches one of 25 voxels near body 'cloth' that no look has told from an obstacle"),
            std::string::npos)
      << first.missing()[0];
  EXPECT_TRUE(first.excluded.empty());
  feed(200 * MS, 0.35);
  map(200 * MS, slab(1) + voxelsOf(0.35));
  const Outcome cleared = feed(300 * MS, 0.35);
  EXPECT_TRUE(assuranceOf(cleared).clear());
  EXPECT_EQ(own(cleared), 25u);
}

// A map that does not tell where it found something may just not have cleared it.
TEST_F(OwnVoxels, WhatIsFoundThereWithoutTheBodyIsAnObstacle) {
  const Cells free{{0, 0, 20}}, nothing;
  for (const bool is_found : {true, false}) {
    start(0.05);
    const Cells cloth = voxelsOf(0.55);
    const auto show = [&](StampNs stamp_ns) { map(stamp_ns, slab(1) + cloth, &free, is_found ? &cloth : &nothing); };
    feed(0, 0.55);
    show(0);
    feed(100 * MS, 0.35);
    show(100 * MS);
    const Outcome beside = feed(200 * MS, 0.35);
    EXPECT_EQ(doubted(beside), 25u) << "since the first map the body was there";
    EXPECT_TRUE(assuranceOf(beside).clear()) << "but it does not touch them now";
    show(200 * MS);
    EXPECT_TRUE(assuranceOf(feed(300 * MS, 0.35)).clear());
    const Assurance onto = assuranceOf(feed(400 * MS, 0.55));
    EXPECT_EQ(onto.touching, is_found ? Touching::NEW : Touching::NONE);
    EXPECT_EQ(onto.proved, is_found);
  }
}

TEST_F(OwnVoxels, TheFirstMapOnTrust) {
  start(0.05, true);
  feed(0, 0.55);
  map(0, slab(1) + voxelsOf(0.55));
  const Outcome first = feed(100 * MS, 0.55);
  EXPECT_TRUE(assuranceOf(first).clear());
  ASSERT_EQ(first.excluded.size(), 1u);
  EXPECT_NE(first.excluded[0].find("own_voxels_doubt: trust"), std::string::npos);
}

// The price: an obstacle that appears within reach. But none that comes from outside.
TEST_F(OwnVoxels, WhatAppearsWithinReachOfABodyIsNamedAsLeftOut) {
  for (const bool reaches_out : {false, true}) {
    start(0.1);
    hoverAboveFloor();
    Cells beside{{8, 5, 5}};  // 0.09 m away
    for (int x = 9; reaches_out && x < 13; ++x) beside.insert({x, 5, 5});
    map(150 * MS, slab(1) + voxelsOf(0.55) + beside);
    const Outcome outcome = feed(200 * MS, 0.55);
    EXPECT_EQ(own(outcome), reaches_out ? 0u : 26u);
    EXPECT_EQ(doubted(outcome), reaches_out ? 26u : 0u);
    EXPECT_EQ(assuranceOf(outcome).clear(), !reaches_out);
    EXPECT_EQ(outcome.obstacle->leafAt({0.85, 0.55, 0.55}), nullptr);
    if (!reaches_out) continue;
    ASSERT_NE(outcome.obstacle->leafAt({0.95, 0.55, 0.55}), nullptr) << "beyond reach it is an obstacle";
  }
}

TEST_F(OwnVoxels, WhatTheCameraSawBeforeItsStampIsOwnWithinTheLag) {
  for (const double lag_s : {0.0, 0.06}) {
    start(0.05, false, lag_s);
    hoverAboveFloor();
    feed(110 * MS, 0.85);
    map(150 * MS, slab(1) + voxelsOf(0.55));
    feed(150 * MS, 0.85);
    map(200 * MS, slab(1) + voxelsOf(0.85) + voxelsOf(0.55));
    const Outcome both = feed(200 * MS, 0.85);
    EXPECT_EQ(own(both), lag_s > 0 ? 50u : 25u) << "of its trail what lies on the way since the map before";
    EXPECT_EQ(doubted(both), lag_s > 0 ? 0u : 25u);
    map(250 * MS, slab(1) + voxelsOf(0.85));
    feed(260 * MS, 0.25);
    map(270 * MS, slab(1) + voxelsOf(0.85));
    feed(300 * MS, 0.25);
    map(320 * MS, slab(1) + voxelsOf(0.55));
    const Outcome late = feed(320 * MS, 0.25);
    EXPECT_EQ(own(late), lag_s > 0 ? 25u : 0u) << "passed there at 0.255 s, 0.065 s before the map";
  }
}

TEST_F(OwnVoxels, AnObstacleThatABodyHidesForAWhileStaysOne) {
  hoverAboveFloor();
  feed(150 * MS, 0.12);
  map(150 * MS, voxelsOf(0.12));  // the floor is gone below the sheet
  feed(200 * MS, 0.12);
  map(200 * MS, slab(1) + voxelsOf(0.12));
  const Outcome outcome = feed(300 * MS, 0.09);
  EXPECT_EQ(own(outcome), 9u);
  EXPECT_EQ(doubted(outcome), 16u) << "beside the rest of the floor, which appears out of reach";
  EXPECT_EQ(assuranceOf(outcome).touching, Touching::NEW);
}

// octomap_server restarted: what it knew is gone, which is not the same as seen free.
TEST_F(OwnVoxels, AnObstacleThatAMapForgetsStaysOne) {
  for (const bool tells_free : {true, false}) {
    start(0.05);
    const Cells above = slab(3), nothing;
    feed(0, 0.55);
    map(0, slab(1), &above);
    feed(100 * MS, 0.55);
    map(100 * MS, {}, tells_free ? &nothing : nullptr);
    feed(200 * MS, 0.12);
    map(200 * MS, slab(1) + voxelsOf(0.12), &nothing);
    feed(300 * MS, 0.12);
    const Outcome outcome = feed(400 * MS, 0.09);
    EXPECT_EQ(assuranceOf(outcome).touching, tells_free ? Touching::NEW : Touching::NONE);
    EXPECT_EQ(own(outcome), tells_free ? 25u : 0u);
    EXPECT_EQ(doubted(outcome), tells_free ? 0u : 25u + 36u) << "with the floor below it, which appears all at once";
    EXPECT_FALSE(assuranceOf(outcome).clear());
  }
}

TEST_F(OwnVoxels, OfALargeLeafOnlyWhatIsWithinReach) {
  hoverAboveFloor();
  const auto large = [&](StampNs stamp_ns) { monitor_->setMap(mapOf(VOXEL_M, {voxelAt(0, 0, 0, 8)}, stamp_ns)); };
  large(150 * MS);
  const Outcome outcome = feed(200 * MS, 0.551);
  EXPECT_EQ(doubted(outcome), 36u + 25u) << "of its own layer, and of the one that begins 0.049 m above it";
  EXPECT_EQ(outcome.obstacle->leafAt({0.55, 0.55, 0.55}), nullptr);
  std::uint64_t left = 0;
  for (const OccupiedLeaf& leaf : outcome.obstacle->leaves()) left += leaf.size * leaf.size * leaf.size;
  EXPECT_EQ(left, 512u - 61u);
}

TEST_F(OwnVoxels, AMapWaitsUntilTheBodyIsKnownAtItsStamp) {
  feed(0, 0.55);
  map(150 * MS, slab(1));
  const Outcome before = feed(100 * MS, 0.55);
  EXPECT_EQ(before.status, StepStatus::NO_MAP);
  EXPECT_NE(before.reason.find("stamped after the end of the step"), std::string::npos) << before.reason;
  EXPECT_TRUE(assuranceOf(feed(200 * MS, 0.55)).clear());
  map(250 * MS, slab(1) + voxelsOf(0.55));
  map(260 * MS, {});
  const Outcome newest = feed(300 * MS, 0.09);
  EXPECT_TRUE(assuranceOf(newest).clear()) << "of several the newest";
}

// Of more than sixteen there is no room for all, and what the others showed is not known.
TEST_F(OwnVoxels, MapsThatComeFasterThanFramesHideNothing) {
  for (const int count : {10, 40}) {
    start(0.1);
    hoverAboveFloor();
    const auto stampOf = [&](int i) { return (101 + 997 * i / count) * MS; };
    map(stampOf(0), slab(1));
    for (int i = 1; i < count; ++i) map(stampOf(i), slab(1) + voxelsOf(0.85));  // while the sheet is 0.2 m away
    const Outcome outcome = feed(1100 * MS, 0.85);
    const Assurance said = assuranceOf(outcome);
    EXPECT_EQ(said.touching, count > 16 ? Touching::NONE : Touching::NEW) << count;
    EXPECT_EQ(said.proved, count <= 16) << describe(said);
    EXPECT_EQ(own(outcome), 0u) << count;
    if (count <= 16) continue;
    EXPECT_NE(describe(said).find("s without a look, in which 24 maps were not looked at (too many came"),
              std::string::npos)
        << describe(said);
    map(1110 * MS, slab(1));
    feed(1200 * MS, 0.55);
    map(1200 * MS, slab(1) + voxelsOf(0.55));
    EXPECT_EQ(own(feed(1300 * MS, 0.55)), 25u) << "once they are cleared all is as before";
  }
}

// Maps that are missing are no gap, and a body that stays within reach keeps what is its own over one.
TEST_F(OwnVoxels, AfterMapsThatWereNotLookedAtWhatRestsIsOwn) {
  for (const int gap_ms : {40, 700}) {
    hoverAboveFloor();
    map(150 * MS, slab(1) + voxelsOf(0.55));
    ASSERT_EQ(own(feed(200 * MS, 0.55)), 25u);
    for (int i = 1; i < 40; ++i) map((200 + gap_ms * i / 40) * MS, slab(1) + voxelsOf(0.55));
    const Outcome outcome = feed((300 + gap_ms) * MS, 0.55);
    EXPECT_EQ(own(outcome), 25u);
    EXPECT_TRUE(assuranceOf(outcome).clear());
    start(0.05);
  }
}

// After one that was refused, that waited when such a one came, or that does not fit octomap_file, and half a second:
// the obstacle above the sheet was in it before the sheet came near.
TEST_F(OwnVoxels, AfterAMapThatWasRefusedNothingThatItCameToIsOwn) {
  enum Why { REFUSED, WAITED, MISFIT };
  for (const Why why : {REFUSED, WAITED, MISFIT}) {
    start(0.1);
    if (why == MISFIT) monitor_->setMapBeside(mapOf(VOXEL_M, {voxelAt(20, 20, 0)}, 0));
    hoverAboveFloor();
    if (why == WAITED) map(150 * MS, slab(1) + voxelsOf(0.85));
    ObstacleMap refused;
    refused.problem = "a test";
    monitor_->setMap(why == MISFIT ? mapOf(0.2, leavesOf(layer(4, 1, 4)), 150 * MS) : refused);
    EXPECT_EQ(feed(600 * MS, 0.78).status, StepStatus::NO_MAP);
    map(650 * MS, slab(1) + voxelsOf(0.85));
    const Outcome outcome = feed(700 * MS, 0.85);
    EXPECT_EQ(own(outcome), 0u) << why;
    EXPECT_EQ(doubted(outcome), 25u) << why;
    EXPECT_FALSE(assuranceOf(outcome).proved) << why;
  }
  start(0.1);
  hoverAboveFloor();
  monitor_->setMap({});  // as where the fixed frame is learnt anew
  feed(200 * MS, 0.55);
  map(250 * MS, slab(1) + voxelsOf(0.55));
  EXPECT_EQ(own(feed(300 * MS, 0.55)), 25u);
}

// With a map that is sent once there is no next one in which its voxels were obstacles.
class OwnVoxelsOfTwo : public OwnVoxels {
 protected:
  /// A cup below the cloth, of which a map shows 25 voxels.
  void SetUp() override {
    startBoth();
    map(-100 * MS, slab(1));
    feedBoth(0);
    map(0, slab(1));
    feedBoth(100 * MS);
    map(150 * MS, slab(1) + voxelsOf(0.55));
    ASSERT_EQ(own(feedBoth(200 * MS)), 25u);
  }
  void startBoth(double reach_of_cloth_m = 0) {
    Body cup = named("cup"), cloth = named("cloth");
    cloth.own_voxels_m = reach_of_cloth_m;
    cup.own_voxels_m = 0.05;
    MonitorOptions options = loose();
    options.detector.obstacle_expected = true;
    options.own_voxels_lag_s = 0;
    monitor_ = std::make_unique<Monitor>(options, std::vector<Body>{cloth, cup});
  }
  Outcome feedBoth(StampNs stamp_ns) {
    monitor_->push(1, sheet(stamp_ns, 0.55), NOW);
    return feed(stamp_ns, 0.95);
  }
  void removeCup() { monitor_->setBody(1, named("nothing")); }
  /// The cloth, onto where the cup was.
  Outcome feedOntoIt() {
    const auto nothing = share(Topology::fromTriangles(0, {}));
    for (const StampNs stamp_ns : {200 * MS, 300 * MS}) monitor_->push(1, {stamp_ns, nothing, {}}, NOW);
    return feed(300 * MS, 0.55);
  }
};

TEST_F(OwnVoxelsOfTwo, OfABodyThatIsRemovedAreObstaclesAtOnce) {
  removeCup();
  const Outcome onto = feedOntoIt();
  ASSERT_EQ(onto.status, StepStatus::OK) << onto.reason;
  EXPECT_EQ(own(onto), 0u);
  EXPECT_TRUE(onto.step->map.own.excluded.empty());
  EXPECT_EQ(assuranceOf(onto).touching, Touching::NEW);
  EXPECT_EQ(onto.step->map.surface->leafCount(), 125u) << "the floor and what stood there";
}

// What was in doubt beside the cup was hidden by it; once it was removed the cloth had it for its own.
TEST_F(OwnVoxelsOfTwo, WhatItMayHaveHiddenIsAnObstacleOnceItIsRemoved) {
  startBoth(0.05);
  feedBoth(0);
  map(0, slab(1) + voxelsOf(0.55));
  ASSERT_EQ(doubted(feedBoth(100 * MS)), 25u);
  map(150 * MS, slab(1));
  feedBoth(200 * MS);
  removeCup();
  feedOntoIt();
  map(350 * MS, slab(1) + voxelsOf(0.55));
  monitor_->push(1, {400 * MS, share(Topology::fromTriangles(0, {})), {}}, NOW);
  const Outcome onto = feed(400 * MS, 0.55);
  ASSERT_EQ(onto.status, StepStatus::OK) << onto.reason;
  EXPECT_EQ(own(onto), 0u);
  EXPECT_NE(assuranceOf(onto).touching, Touching::NONE);
  EXPECT_FALSE(assuranceOf(onto).clear());
}

// The removal fails at one allocation after the other, and is tried again: there are the obstacles, or no map.
TEST_F(OwnVoxelsOfTwo, ARemovalThatFailedLeavesNothingFree) {
  const int allocations = failingEverywhere([&](int n) {
    SetUp();
    const bool met = failsAt(n, false, [&] { removeCup(); });
    removeCup();
    const Outcome onto = feedOntoIt();
    EXPECT_TRUE(assuranceOf(onto).touching == Touching::NEW || onto.status == StepStatus::NO_MAP) << onto.reason;
    return met;
  });
  EXPECT_GE(allocations, 5);
}

// A map of what is near the sensor alone forgets all else: what is remembered of it must not grow for ever.
TEST_F(OwnVoxels, WhereTooMuchIsRememberedTheNextMapIsAFirstOne) {
  const Cells free = voxelsOf(0.55), nothing;
  for (const int rows : {1, 513}) {
    start(0.05);
    Cells wall;
    for (int x = 0; x < 512; ++x) {
      for (int y = 0; y < rows; ++y) wall.insert({x, y, -100});
    }
    map(-100 * MS, wall, &free);
    feed(0, 0.55);
    map(0, wall, &free);
    feed(100 * MS, 0.55);
    map(100 * MS, {}, &free);
    feed(200 * MS, 0.55);
    map(200 * MS, voxelsOf(0.55), &nothing);
    const Outcome outcome = feed(300 * MS, 0.55);
    EXPECT_EQ(own(outcome), rows == 1 ? 25u : 0u);
    EXPECT_EQ(doubted(outcome), rows == 1 ? 0u : 25u);
    EXPECT_EQ(assuranceOf(outcome).proved, rows == 1);
  }
}

TEST_F(OwnVoxels, AmongVoxelsInDoubtNothingIsProved) {
  start(0.35);
  Cells block;
  for (int z = 2; z < 9; ++z) {
    for (const Cell& cell : voxelsOf(0.55)) block.insert({cell[0], cell[1], z});
  }
  feed(0, 0.55);
  map(0, block);
  const Outcome outcome = feed(100 * MS, 0.551);
  EXPECT_EQ(doubted(outcome), block.size());
  EXPECT_FALSE(assuranceOf(outcome).proved) << "it lies in the middle of them and touches none of their outer faces";
}

// A cell that was mapped before the tracker began.
TEST_F(OwnVoxels, MapsOfBeforeTheFirstFrameAreLookedAtInTheirOrder) {
  map(-1600 * MS, slab(1));
  for (const int ms : {-1300, -900, -500, -100}) map(ms * MS, slab(1) + Cells{{5, 5, 5}});
  map(0, slab(1) + voxelsOf(0.55));
  feed(0, 0.55);
  const Outcome outcome = feed(100 * MS, 0.55);
  EXPECT_EQ(own(outcome), 24u);
  EXPECT_EQ(doubted(outcome), 1u) << "where the body was at -1.3 s nobody knows";
  EXPECT_FALSE(assuranceOf(outcome).proved);
}

// A bag that loops: what is kept of the bodies' ways follows the clock.
TEST_F(OwnVoxels, AfterAClockThatWentBackAllIsInDoubt) {
  start(0.05, false, 0.15);
  hoverAboveFloor();
  feed(300 * MS, 0.55);
  map(300 * MS, slab(1) + voxelsOf(0.55));
  ASSERT_EQ(own(feed(400 * MS, 0.55)), 25u);
  EXPECT_EQ(feed(10 * MS, 0.85).status, StepStatus::TIME_JUMP);
  feed(60 * MS, 0.85);
  feed(110 * MS, 0.55);
  feed(150 * MS, 0.55);
  feed(190 * MS, 0.55);
  map(190 * MS, slab(1) + voxelsOf(0.55) + voxelsOf(0.85));
  EXPECT_EQ(doubted(feed(200 * MS, 0.55)), 50u);
  map(250 * MS, slab(1));
  feed(300 * MS, 0.85);
  map(300 * MS, slab(1) + voxelsOf(0.85) + voxelsOf(0.55));
  const Outcome after = feed(400 * MS, 0.85);
  EXPECT_EQ(own(after) + doubted(after), 50u) << "it was at 0.55 m 0.1 s before the map";
}

TEST_F(OwnVoxels, AnotherFrameOrResolutionIsAFirstMap) {
  hoverAboveFloor();
  monitor_->setMap(mapOf(0.2, {voxelAt(1, 1, 2)}, 150 * MS));
  EXPECT_EQ(doubted(feed(200 * MS, 0.55)), 1u);
  monitor_->setMap(mapOf(0.2, {voxelAt(1, 1, 2)}, 250 * MS, "odom"));
  EXPECT_EQ(doubted(feed(300 * MS, 0.55)), 1u);
}

TEST_F(OwnVoxels, HugeReachesAndPlacesAndWhatIsNoReach) {
  for (const double reach_m : {1e9, 1e300}) {
    start(reach_m);
    hoverAboveFloor();
    EXPECT_EQ(own(feed(110 * MS, 0.55)), 0u) << "the floor is older";
    map(150 * MS, slab(1) + voxelsOf(0.55) + Cells{{-32768, 0, 32767}});
    EXPECT_EQ(own(feed(200 * MS, 0.55)), 26u) << "all that appears";
  }
  for (const double far : {1e9, 1e300}) {
    start(0.05);
    MonitorOptions options = monitor_->options();
    options.store.max_vertex_step_m = 0;
    monitor_->setOptions(options);
    hoverAboveFloor();
    feed(200 * MS, far);
    map(200 * MS, slab(1) + voxelsOf(0.55) + voxelsOf(2.05));
    EXPECT_EQ(own(feed(300 * MS, 0.55)), 25u) << "at most places on a way that long are not asked: obstacles";
  }
  for (const double wrong : {-0.01, -2.0, std::nan(""), HUGE_VAL})
    EXPECT_THROW(start(wrong), std::invalid_argument) << wrong;
}

TEST_F(OwnVoxels, OverATeleportAllThatAppearsIsInDoubt) {
  MonitorOptions options = monitor_->options();
  options.store.max_vertex_step_m = 0.3;
  monitor_->setOptions(options);
  hoverAboveFloor();
  map(150 * MS, slab(1) + voxelsOf(0.55));
  EXPECT_EQ(own(feed(200 * MS, 0.55)), 25u);
  EXPECT_EQ(feed(300 * MS, 2.05).status, StepStatus::TELEPORT);
  map(350 * MS, slab(1) + voxelsOf(0.55) + voxelsOf(1.25) + voxelsOf(2.05));
  const Outcome outcome = feed(400 * MS, 2.05);
  EXPECT_EQ(doubted(outcome), 75u) << "where it was, where it is, and where it may have been";
  EXPECT_EQ(outcome.touching, Touching::NONE);
  EXPECT_FALSE(assuranceOf(outcome).proved);
}

// What a camera sees through the gaps of a robot's link, or what noise puts there.
TEST_F(OwnVoxels, WhatAppearsInsideOfAClosedRigidBodyIsItsOwn) {
  for (const bool closed : {true, false}) {
    for (const auto& [inside_out, shell, finite] : {std::tuple(true, false, true), std::tuple(false, false, true),
                                                    std::tuple(false, true, true), std::tuple(false, false, false)}) {
      Body body = named("link");
      body.own_voxels_m = 0.05;
      body.rigid = true;
      body.shell = shell;
      MonitorOptions options = loose();
      options.own_voxels_lag_s = 0;
      Monitor monitor(options, {body});
      const StepBody whole = box(Vec3::Zero(), Vec3::Ones());
      std::vector<Face> faces = whole.topology.faces();
      if (!closed) faces.pop_back();
      for (Face& face : faces) {
        if (inside_out) std::swap(face[1], face[2]);
      }
      MeshFrame frame{0, share(Topology::fromTriangles(8, faces)), whole.t0, true};
      if (!finite) frame.positions[7].setConstant(std::nan(""));
      monitor.setMap(mapOf(VOXEL_M, {}, -100 * MS));
      monitor.push(0, frame, NOW);
      only(monitor);
      monitor.setMap(mapOf(VOXEL_M, {}, 0));
      frame.stamp_ns = 100 * MS;
      monitor.push(0, frame, NOW);
      only(monitor);
      monitor.setMap(mapOf(VOXEL_M, {voxelAt(5, 5, 5), voxelAt(15, 5, 5)}, 150 * MS));
      frame.stamp_ns = 200 * MS;
      monitor.push(0, frame, NOW);
      EXPECT_EQ(own(only(monitor)), closed && finite && !shell ? 1u : 0u);
    }
  }
}

// As the node does it while ~enable is false: the cloth is carried up by 0.3 m and rests there, and maps come all the
// time. Else all that they showed meanwhile would be in doubt for as long as it rests.
TEST_F(OwnVoxels, OverStepsThatAreNotWantedWhatIsOwnIsFollowed) {
  const Cells late_obstacle{{5, 5, 10}};
  for (const bool obstacle : {false, true}) {
    start(0.05);
    hoverAboveFloor();
    const auto height = [](int k) { return 0.55 + 0.015 * std::min(k, 20); };
    monitor_->reset(StepStatus::DISABLED);
    for (int k = 2; k < 40; ++k) {
      map(k * 100 * MS, slab(1) + voxelsOf(height(k)) + (obstacle && k > 10 ? late_obstacle : Cells()));
      monitor_->countReceived(0);
      monitor_->push(0, sheet(k * 100 * MS, height(k)), NOW);
      monitor_->dropSteps(StepStatus::DISABLED, "a test");
      Outcome outcome;
      ASSERT_TRUE(monitor_->next(NOW, outcome));
      EXPECT_FALSE(outcome.answered);
    }
    monitor_->reset(StepStatus::DISABLED);
    feed(4000 * MS, 0.85);
    map(4000 * MS, slab(1) + voxelsOf(0.85) + (obstacle ? late_obstacle : Cells()));
    const Outcome rests = feed(4100 * MS, 0.85);
    EXPECT_TRUE(assuranceOf(rests).clear()) << describe(assuranceOf(rests));
    EXPECT_EQ(own(rests), 25u);
    const Outcome rises = feed(4200 * MS, 1.02);
    EXPECT_EQ(assuranceOf(rises).touching, obstacle ? Touching::NEW : Touching::NONE) << "one that came meanwhile";
    expectAddsUp(*monitor_);
  }
}

/// The lag of a map reaches back to frames that a reset took: they were looked at, and are gone. What is own stays so;
/// who else was near then nobody can tell.
TEST_F(OwnVoxels, WhileTheLagReachesBackBeyondAResetTheyStay) {
  const Cells aloft{{5, 5, 12}};
  start(0.05, false, 0.1);
  hoverAboveFloor();
  map(100 * MS, slab(1) + voxelsOf(0.55));
  EXPECT_EQ(own(feed(140 * MS, 0.55)), 25u);
  monitor_->reset(StepStatus::DISABLED);
  for (int k = 0; k < 6; ++k) {
    const StampNs map_ns = (160 + 40 * k) * MS;
    map(map_ns, slab(1) + voxelsOf(0.55) + (k >= 2 ? aloft : Cells()));
    const Outcome outcome = feed(map_ns + 20 * MS, 0.55);
    if (k == 0) continue;
    EXPECT_TRUE(assuranceOf(outcome).clear()) << k << ": " << describe(assuranceOf(outcome));
    EXPECT_EQ(own(outcome), 25u) << k;
    EXPECT_EQ(doubted(outcome), k >= 2 ? 1u : 0u) << k;
  }
}

TEST_F(OwnVoxels, WhatIsTrustedIsNeverOwn) {
  ObstacleMap table = mapOf(VOXEL_M, {voxelAt(4, 4, 4)}, 0);
  monitor_->setMapBeside(table);
  feed(0, 0.55);
  EXPECT_EQ(feed(50 * MS, 0.55).status, StepStatus::NO_MAP) << "it is no map by itself";
  map(50 * MS, slab(1) + voxelsOf(0.55) + Cells{{4, 4, 4}});
  const Outcome outcome = feed(100 * MS, 0.545);
  EXPECT_EQ(doubted(outcome), 25u);
  EXPECT_NE(outcome.obstacle->leafAt({0.45, 0.45, 0.45}), nullptr);
  EXPECT_EQ(outcome.obstacle->leafCount(), 101u);
  EXPECT_EQ(assuranceOf(feed(200 * MS, 0.49)).touching, Touching::NEW);
  monitor_->setMap(mapOf(0.2, {}, 150 * MS));
  const Outcome other = feed(300 * MS, 0.55);
  EXPECT_EQ(other.status, StepStatus::NO_MAP);
  EXPECT_NE(other.reason.find("octomap_file of 0.1 m"), std::string::npos) << other.reason;

  const double as_float = static_cast<double>(0.1f);
  monitor_->setMap(mapOf(as_float, leavesOf(slab(1)), 350 * MS));
  const Outcome both = feed(400 * MS, 0.55);
  ASSERT_TRUE(both.obstacle) << both.reason;
  EXPECT_EQ(both.obstacle->resolution(), as_float) << "the live map's";
  EXPECT_NE(both.obstacle->leafAt({0.45, 0.45, 0.45}), nullptr);
  monitor_->setMap(mapOf(VOXEL_M * (1 + 2e-7), leavesOf(slab(1)), 450 * MS));
  const Outcome apart = feed(500 * MS, 0.55);
  EXPECT_EQ(apart.status, StepStatus::NO_MAP);
  EXPECT_NE(apart.reason.find("voxels of 0.10000002 m"), std::string::npos) << apart.reason;

  start(0.05);
  feed(0, 0.545);
  table.trusted = true;
  monitor_->setMap(table);
  const Outcome alone = feed(50 * MS, 0.545);
  EXPECT_TRUE(alone.missing().empty()) << "a first map, but nothing of it is in doubt";
  EXPECT_EQ(alone.obstacle->leafCount(), 1u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
