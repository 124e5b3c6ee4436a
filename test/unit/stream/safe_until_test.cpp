// Until when nothing can touch, whether that was kept, and how fast one may go: from distances that are written by
// hand.
#include "dccd/monitor_extras.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <stdexcept>

#include "oracle/algebraic.h"
#include "support/claims.h"
#include "support/closed_meshes.h"
#include "support/said.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

constexpr double NONE = SpeedBound::NONE;

Body placed(const std::string& name, const MeshFrame& frame) {
  Body body = named(name);
  body.topology = frame.topology;
  body.t0 = body.t1 = share(frame.positions);
  return body;
}

ClearanceDistance apart(double lower_m, ClearanceStatus status = ClearanceStatus::MEASURED) {
  ClearanceDistance distance;
  distance.status = status;
  distance.lower_m = distance.upper_m = lower_m;
  return distance;
}

/// A floor and a tip above it, a map of one voxel far away; an answered, proved step that ends at one second.
Outcome answered(std::vector<Clearance> clearances) {
  Outcome outcome;
  Step step;
  step.bodies = {placed("floor", floor(1000 * MS, 0)), placed("tip", tip(1000 * MS, 1))};
  step.start_ns = 900 * MS;
  step.stamp_ns = 1000 * MS;
  step.map.surface = VoxelSurface::build(0.1, {{{40000, 40000, 40000}, 1}});
  outcome.obstacle = step.map.surface;
  outcome.step = std::make_shared<const Step>(std::move(step));
  outcome.status = StepStatus::OK;
  outcome.answered = true;
  outcome.claim = Claim::thatWasSaid({});
  outcome.start_ns = outcome.step->start_ns;
  outcome.stamp_ns = outcome.step->stamp_ns;
  outcome.clearances = std::move(clearances);
  return outcome;
}

/// With another step.
template <class Change>
Outcome changed(Outcome outcome, const Change& change) {
  Step step = *outcome.step;
  change(step);
  outcome.step = std::make_shared<const Step>(std::move(step));
  return outcome;
}

Clearance between(std::uint16_t a, std::uint16_t b, const ClearanceDistance& distance, bool expected = false) {
  return {{a, b}, expected, distance, distance};
}

TEST(SafeUntil, IsTheDistanceByTheSpeedsOfBoth) {
  const Outcome outcome = answered({between(0, 1, apart(0.6))});
  const SafeUntil promise = safeUntil(outcome, {{0.5}, {1.0}});
  EXPECT_TRUE(promise.isPromise());
  EXPECT_EQ(promise.stamp_ns, 1000 * MS);
  EXPECT_NEAR(promise.seconds(), 0.4, 3e-9);
  EXPECT_LE(promise.seconds(), 0.4);
  EXPECT_EQ(promise.limiting, 0u);
  EXPECT_EQ(promise.distance_m, 0.6);
  EXPECT_NEAR(promise.closing_m_s, 1.5, 1e-15);
}

TEST(SafeUntil, TheLeastOfAllPairsWithTheMapAtRestAndTwiceTheSpeedOfABodyItself) {
  const std::vector<SpeedBound> bounds{{0.5}, {1.0}};
  const Clearance self = between(0, 0, apart(0.9)), both = between(0, 1, apart(2)),
                  map = between(1, OBSTACLE_BODY, apart(0.8));
  EXPECT_NEAR(safeUntil(answered({self}), bounds).seconds(), 0.9, 3e-9);
  EXPECT_NEAR(safeUntil(answered({both}), bounds).seconds(), 2 / 1.5, 3e-9);
  EXPECT_NEAR(safeUntil(answered({map}), bounds).seconds(), 0.8, 3e-9);
  const SafeUntil least = safeUntil(answered({self, both, map}), bounds);
  EXPECT_NEAR(least.seconds(), 0.8, 3e-9);
  EXPECT_EQ(least.limiting, 2u);
}

TEST(SafeUntil, APairWithoutARowIsAsFarAsTheOneThatStandsForIt) {
  Outcome outcome = changed(answered({between(0, 1, apart(0.6)), between(0, 2, apart(0.5, ClearanceStatus::FARTHER))}),
                            [](Step& step) { step.bodies.push_back(placed("lamp", tip(1000 * MS, 9))); });
  const std::vector<SpeedBound> bounds{{0.1}, {1.0}, {9.0}};
  EXPECT_NEAR(safeUntil(outcome, bounds).seconds(), 0.5 / 9.1, 3e-9);
  EXPECT_EQ(safeUntil(outcome, bounds).limiting, 1u);
  outcome.stats[Effect::CLEARANCE].in = 6;  // 'tip' and 'lamp', and all of them and the map
  const SafeUntil promise = safeUntil(outcome, bounds);
  EXPECT_NEAR(promise.seconds(), 0.5 / 10, 3e-9) << "'tip' and 'lamp' are the fastest";
  EXPECT_EQ(promise.limiting, SafeUntil::NO_PAIR);
  EXPECT_EQ(promise.distance_m, 0.5);
  EXPECT_NEAR(promise.closing_m_s, 10, 1e-14);
  const SpeedLaw law{0.1, 0, 0};
  EXPECT_NEAR(speedScale(outcome, bounds, law).scale, 0.5, 1e-12);
  EXPECT_LT(speedScale(0.5, 10, 0, law), speedScale(0.5, 9.1, 0, law));
  EXPECT_EQ(safeUntil(outcome, {{0.1}, {1.0}}).reason, "no speed bound is known of body 'lamp'");
  outcome = changed(outcome, [](Step& step) { step.bodies[2].not_against = {1}; });
  EXPECT_NEAR(safeUntil(outcome, bounds).seconds(), 0.5 / 9.1, 3e-9) << "these two are not asked for";
  outcome.clearances.pop_back();
  EXPECT_FALSE(safeUntil(outcome, bounds).isPromise()) << "nothing stands for what has no row";
}

TEST(SafeUntil, NeverPastTheQuotientOfTheDoubles) {
  std::mt19937_64 random(4);
  std::uniform_real_distribution<double> exponent(-30, 3);
  for (int i = 0; i < 20000; ++i) {
    const double d = std::exp2(exponent(random)), va = std::exp2(exponent(random)), vb = std::exp2(exponent(random));
    const SafeUntil promise = safeUntil(answered({between(0, 1, apart(d))}), {{va, 0, i % 2 == 0}, {vb}});
    const Rational way = Rational(promise.until_ns - promise.stamp_ns) * (Rational(va) + Rational(vb));
    ASSERT_LE(way, Rational(d) * 1000000000) << d << " " << va << " " << vb;
    if (promise.seconds() == MOST_PROMISED_S) continue;
    // Nor more than a few nanoseconds, and bits, before it.
    ASSERT_GT((way + 3 * (Rational(va) + Rational(vb))) * Rational(1 + 1e-14), Rational(d) * 1000000000);
  }
}

TEST(SafeUntil, StopsAtItsCapAndIsNeverInfinite) {
  const Outcome far = answered({between(0, 1, apart(1e300, ClearanceStatus::FARTHER))});
  for (const double speed : {0.0, 1e-300, 1.0}) {
    const SafeUntil promise = safeUntil(far, {{speed}, {0}});
    EXPECT_EQ(promise.seconds(), MOST_PROMISED_S) << speed;
  }
  const Outcome farther = answered({between(0, 1, apart(0.5, ClearanceStatus::FARTHER))});
  EXPECT_NEAR(safeUntil(farther, {{1}, {0}}).seconds(), 0.5, 3e-9);
}

TEST(SafeUntil, PromisesNothingOfWhatIsNotKnown) {
  const std::vector<SpeedBound> bounds{{1}, {1}};
  const auto reasonOf = [&](const Outcome& outcome, const std::vector<SpeedBound>& some) {
    const SafeUntil promise = safeUntil(outcome, some);
    EXPECT_FALSE(promise.isPromise());
    EXPECT_EQ(promise.until_ns, outcome.stamp_ns);
    return promise.reason;
  };
  EXPECT_EQ(reasonOf(Outcome(), bounds), "no answer, FIRST_FRAME");
  EXPECT_EQ(reasonOf(answered({}), bounds), "no distances were computed");
  const Clearance good = between(0, 1, apart(1));
  EXPECT_EQ(reasonOf(answered({good, between(1, OBSTACLE_BODY, apart(0, ClearanceStatus::UNKNOWN))}), bounds),
            "the distance of 'tip' and octomap is not known");
  EXPECT_EQ(reasonOf(answered({between(0, 1, apart(0, ClearanceStatus::LOWER))}), bounds),
            "the distance of 'floor' and 'tip' may be 0");
  EXPECT_EQ(reasonOf(answered({good}), {{1}}), "no speed bound is known of body 'tip'");
  EXPECT_EQ(reasonOf(answered({good}), {{NONE}, {1}}), "no speed bound is known of body 'floor'");
  Outcome unproved = answered({good});
  unproved.claim = claimBut(Question::CONTENTS, "3 vertices are not finite and were not checked");
  EXPECT_EQ(reasonOf(unproved, bounds), "not proved: 3 vertices are not finite and were not checked");
  EXPECT_NE(reasonOf(answered({between(0, 1, apart(NONE))}), bounds), "");
  EXPECT_NE(reasonOf(answered({between(0, 1, apart(std::nan("")))}), bounds), "");
}

TEST(SafeUntil, OfABodyAndItselfIsToldApart) {
  const std::vector<SpeedBound> bounds{{1}, {1}};
  const Clearance other = between(0, 1, apart(1)), fold = between(0, 0, apart(0.05, ClearanceStatus::FARTHER)),
                  touch = between(0, 0, apart(0, ClearanceStatus::TOUCHING));
  const SafeUntil both = safeUntil(answered({fold, other}), bounds);
  EXPECT_NEAR(both.seconds(), 0.025, 3e-9);
  EXPECT_EQ(both.limiting, 0u);
  EXPECT_NEAR(both.othersSeconds(), 0.5, 3e-9);
  const SafeUntil touching = safeUntil(answered({touch, other}), bounds);
  EXPECT_EQ(touching.until_ns, touching.stamp_ns);
  EXPECT_EQ(touching.reason, "'floor' and itself touch, and nobody expects it");
  EXPECT_NEAR(touching.othersSeconds(), 0.5, 3e-9);
  EXPECT_TRUE(touching.isPromise());
  EXPECT_FALSE(safeUntil(answered({touch}), bounds).isPromise()) << "there are no others";
}

TEST(SafeUntil, ABudgetLeavesLowerBoundsThatHold) {
  Outcome cut = answered({between(0, 1, apart(0.25, ClearanceStatus::LOWER))});
  cut.status = StepStatus::DEADLINE;
  cut.claim = claimBut(Question::TIME, "the step budget ran out");
  EXPECT_NEAR(safeUntil(cut, {{1}, {0}}).seconds(), 0.25, 3e-9);
  cut.claim.answer(Question::CONTENTS, "vertices are not finite");
  EXPECT_FALSE(safeUntil(cut, {{1}, {0}}).isPromise());
}

TEST(SafeUntil, WhatIsExpectedToTouchDoesNotLimit) {
  const Clearance touches = between(0, 1, apart(0, ClearanceStatus::TOUCHING), true), other = between(0, 0, apart(1));
  EXPECT_NEAR(safeUntil(answered({touches, other}), {{0.5}, {0.5}}).seconds(), 1, 3e-9);
  EXPECT_TRUE(safeUntil(answered({touches}), {{0.5}, {0.5}}).isPromise());
}

TEST(SafeUntil, AMapThatNobodyMissesIsNoPartnerAndOneThatIsMissedIs) {
  Outcome outcome = answered({between(0, 1, apart(1)), between(0, OBSTACLE_BODY, apart(0, ClearanceStatus::UNKNOWN))});
  outcome.obstacle = nullptr;
  EXPECT_TRUE(safeUntil(outcome, {{1}, {1}}).isPromise());
  outcome.status = StepStatus::NO_MAP;
  outcome.claim = claimBut(Question::MAP_IS_THERE, "no map");
  EXPECT_FALSE(safeUntil(outcome, {{1}, {1}}).isPromise());
}

TEST(SafeUntil, AContactBeginsAtTheSeparation) {
  Outcome outcome = changed(answered({between(0, 1, apart(0.5))}), [](Step& step) {
    step.bodies[0].minimum_separation_m = 0.1;
    step.bodies[1].separations = {{OBSTACLE_BODY, 0.3}};
  });
  EXPECT_NEAR(safeUntil(outcome, {{1}, {0}}).seconds(), 0.4, 3e-9);
  outcome.clearances = {between(1, OBSTACLE_BODY, apart(0.5))};
  EXPECT_NEAR(safeUntil(outcome, {{1}, {1}}).seconds(), 0.2, 3e-9);
  outcome.clearances = {between(0, 1, apart(0.1))};
  EXPECT_FALSE(safeUntil(outcome, {{1}, {0}}).isPromise());
}

/// The tip, which dips by so much after so many tenths of the step and comes back.
Outcome dipped(const Outcome& outcome, double by_m, int tenths) {
  return changed(outcome, [&](Step& step) {
    Positions down = *step.bodies[1].t0;
    for (Vec3& p : down) p.z() -= by_m;
    step.bodies[1].waypoints = {{tenths / 10., {}, share(down)}};
  });
}

/// The same of a rigid body, that of its pose.
Outcome turnedAside(const Outcome& outcome, double by_m, int tenths) {
  return changed(outcome, [&](Step& step) {
    Waypoint aside{tenths / 10.};
    aside.pose.translation().z() = -by_m;
    step.bodies[1].rigid = step.bodies[1].turns = true;
    step.bodies[1].waypoints = {aside};
  });
}

// A hand in a box, away from its faces: how far the surfaces are is no distance of the two.
TEST(SafeUntil, WhatIsInsideOfAnotherBodyTouchesIt) {
  TestStep scene;
  scene.bodies = {box({-0.1, -0.1, -0.1}, {0.1, 0.1, 0.1}), box({-1, -1, -1}, {1, 1, 1})};
  const std::vector<SpeedBound> bounds{{0.5}, {0.5}};
  const SpeedLaw law{0.1, 0.2, 0.02};
  Options options;
  options.clearance.wanted = true;
  const auto look = [&] { return runOnce(scene, options); };
  const Outcome inside = look();
  EXPECT_EQ(inside.touching, Touching::LASTING);
  EXPECT_TRUE(assuranceOf(inside).proved);
  ASSERT_EQ(inside.clearances.size(), 1u);
  EXPECT_GT(inside.clearances[0].at_end.lower_m, 0.4) << "of the surfaces: at most max_m is looked for";
  const SafeUntil promise = safeUntil(inside, bounds);
  EXPECT_FALSE(promise.isPromise()) << promise.seconds();
  EXPECT_EQ(promise.distance_m, 0);
  EXPECT_EQ(promise.reason, "'body_0' is inside of 'body_1', or crosses it");
  const SpeedScale scale = speedScale(inside, bounds, law);
  EXPECT_EQ(scale.scale, 0);
  EXPECT_EQ(scale.reason, promise.reason);
  scene.bodies[1].shell = true;
  EXPECT_TRUE(safeUntil(look(), bounds).isPromise()) << "it is a container";
  EXPECT_EQ(speedScale(look(), bounds, law).scale, 1);
  scene.bodies[1].shell = false;
  options.expected.resize(1);
  options.expected[0].partners[1].body = 1;
  EXPECT_TRUE(safeUntil(look(), bounds).isPromise()) << "it is expected";
  EXPECT_EQ(speedScale(look(), bounds, law).scale, 1);
  options.expected.clear();
  // It goes in within one step, and is away from all faces at the end of it.
  for (Vec3& p : scene.bodies[0].t0) p.x() -= 3;
  const Outcome entered = look();
  EXPECT_EQ(entered.touching, Touching::NEW);
  EXPECT_GT(entered.clearances[0].at_end.lower_m, 0.4);
  EXPECT_FALSE(safeUntil(entered, bounds).isPromise());
  EXPECT_EQ(safeUntil(entered, bounds).reason, "'body_0' and 'body_1' may have met in this step");
}

TEST(SafeUntil, WhatMayBeInsideForWantOfTimeIsNoPromise) {
  Outcome cut = answered({between(0, 1, apart(0.25, ClearanceStatus::LOWER))});
  cut.status = StepStatus::DEADLINE;
  cut.claim = claimBut(Question::TIME, "the step budget ran out");
  cut.start_state_complete = false;
  EXPECT_TRUE(safeUntil(cut, {{1}, {0}}).isPromise()) << "one above the other: the boxes around them do not meet";
  cut = changed(cut, [](Step& step) { step.bodies[1] = placed("tip", tip(1000 * MS, -0.5)); });
  EXPECT_EQ(safeUntil(cut, {{1}, {0}}).reason,
            "it is not known whether one of 'floor' and 'tip' is inside of the other");
}

TEST(SafeUntil, RefusesSpeedsThatAreNone) {
  const Outcome outcome = answered({between(0, 1, apart(0.6))});
  for (const double bad : {-1.0, -NONE, std::nan("")}) {
    for (const SpeedBound& bound : {SpeedBound{bad}, SpeedBound{1, true, 0, bad}}) {
      const std::string text = said<std::invalid_argument>([&] { safeUntil(outcome, {{1}, bound}); });
      EXPECT_TRUE(mentions(text, "of body 'tip'")) << bad << text;
    }
  }
}

/// The tip's first vertex somewhere else, at a later stamp.
Outcome later(const Outcome& outcome, StampNs after_ns, const Vec3& by) {
  Outcome next = changed(outcome, [&](Step& step) {
    step.bodies[1].t0 = step.bodies[1].t1;
    Positions moved = *step.bodies[1].t1;
    moved[0] += by;
    step.bodies[1].t1 = share(moved);
    step.start_ns = outcome.stamp_ns;
    step.stamp_ns = outcome.stamp_ns + after_ns;
  });
  next.start_ns = next.step->start_ns;
  next.stamp_ns = next.step->stamp_ns;
  return next;
}

TEST(PromiseWatch, SeesABodyThatWasFasterByOneBit) {
  // 0.25 s at 0.5 m/s: exactly 0.125 m, from 1 m on, and the doubles beside it.
  for (const auto& [seconds_ns, way_m, kept] : {std::tuple{250 * MS, 0.125, true},
                                                {250 * MS, std::nextafter(0.125, 1) + 0x1p-52, false},
                                                {250 * MS, 0.125 - 0x1p-52, true},
                                                {100 * MS, 0.0499, true},
                                                {100 * MS, 0.0501, false}}) {
    PromiseWatch watch;
    watch.setBounds({{0}, {0.5}});
    const Outcome first = answered({between(0, 1, apart(1))});
    watch.follow(first);
    EXPECT_EQ(watch.broken(), "");
    watch.follow(later(first, seconds_ns, {0, 0, way_m}));
    EXPECT_EQ(watch.broken().empty(), kept) << way_m << ": " << watch.broken();
    EXPECT_EQ(watch.counts().made, 2u);
    EXPECT_EQ(watch.counts().kept, kept ? 1u : 0u);
    EXPECT_EQ(watch.counts().broken, kept ? 0u : 1u);
    EXPECT_EQ(watch.counts().unseen(), 1u) << "the next answer has not come";
  }
}

TEST(PromiseWatch, SeesABodyThatWasFasterBetweenTwoFrames) {
  for (const auto& [by_m, tenths, kept] :
       {std::tuple{0.0249, 5, true}, {0.0251, 5, false}, {0.0099, 8, true}, {0.0101, 8, false}}) {
    const Outcome first = answered({between(0, 1, apart(1))});
    const Outcome back = later(first, 100 * MS, {0, 0, 0});
    for (const Outcome& outcome : {dipped(back, by_m, tenths), turnedAside(back, by_m, tenths)}) {
      PromiseWatch watch;
      watch.setBounds({{0}, {0.5}});
      watch.follow(first);
      watch.follow(outcome);
      EXPECT_EQ(watch.broken().empty(), kept) << by_m << " " << tenths << ": " << watch.broken();
    }
  }
}

TEST(PromiseWatch, IsExactWhereDoublesOverflowOrVanish) {
  for (const double scale : {1e-250, 1e250}) {
    const Outcome start = changed(answered({between(0, 1, apart(1))}),
                                  [](Step& step) { step.bodies[1].t1 = share(Positions(3, Vec3::Zero())); });
    for (const double way_m : {scale, std::nextafter(scale, 1e300)}) {
      PromiseWatch watch;
      watch.setBounds({{0}, {scale}});
      watch.follow(start);
      const bool is_promise = watch.promise().isPromise();  // not at 1e250 m/s: less than a nanosecond
      watch.follow(later(start, 1000 * MS, {way_m, 0, 0}));
      EXPECT_EQ(watch.broken().empty(), way_m == scale || !is_promise) << way_m;
    }
  }
}

TEST(PromiseWatch, HoldsAPromiseUntilTheNextAnswerWhateverIsLostBetween) {
  PromiseWatch watch;
  watch.setBounds({{0}, {0.5}});
  const Outcome first = answered({between(0, 1, apart(1))});
  watch.follow(first);
  Outcome lost;
  lost.status = StepStatus::GAP;
  lost.stamp_ns = first.stamp_ns + 100 * MS;
  EXPECT_FALSE(watch.follow(lost).isPromise());
  EXPECT_EQ(watch.broken(), "");
  watch.follow(later(first, 200 * MS, {0, 0, 0.11}));
  EXPECT_EQ(watch.broken(), "body 'tip' was faster than 0.5 m/s: vertex 0 came 0.11 m in 0.2 s");
  watch.follow(first);
  watch.forget();
  watch.follow(later(first, 200 * MS, {0, 0, 0.11}));
  EXPECT_EQ(watch.broken(), "") << "after a reset nobody looks back";
  EXPECT_EQ(watch.counts().made, 4u);
  EXPECT_EQ(watch.counts().kept, 0u) << "what nobody has looked at is not kept";
  EXPECT_EQ(watch.counts().broken, 1u);
  EXPECT_EQ(watch.counts().unseen(), 3u);
}

TEST(PromiseWatch, WhatIsRevokedIsVoidAtOnceAndTheNextAnswerSaysSo) {
  const Outcome first = answered({between(0, 1, apart(1))});
  PromiseWatch watch;
  watch.setBounds({{0}, {0.5}});
  watch.revoke("there is none");
  EXPECT_EQ(watch.broken() + watch.promise().reason, "");
  watch.follow(first);
  ASSERT_TRUE(watch.promise().isPromise());
  EXPECT_FALSE(watch.isRevoked());
  watch.revoke("other contacts are expected now");
  watch.revoke("once more");
  EXPECT_TRUE(watch.isRevoked());
  EXPECT_FALSE(watch.promise().isPromise());
  EXPECT_EQ(watch.promise().stamp_ns, first.stamp_ns);
  EXPECT_EQ(watch.promise().until_ns, first.stamp_ns);
  EXPECT_EQ(watch.promise().reason, "other contacts are expected now");
  EXPECT_EQ(watch.broken(), "other contacts are expected now");
  EXPECT_EQ(watch.counts().broken, 1u);
  Outcome lost;
  lost.stamp_ns = first.stamp_ns + 50 * MS;
  watch.follow(lost);
  EXPECT_EQ(watch.broken(), "");
  const Outcome fast = later(first, 100 * MS, {0, 0, 0.5});
  watch.follow(fast);
  EXPECT_EQ(watch.broken(), "other contacts are expected now");
  EXPECT_EQ(watch.counts().made, 2u);
  EXPECT_EQ(watch.counts().kept, 0u);
  EXPECT_EQ(watch.counts().broken, 1u) << "once";
  watch.follow(later(fast, 100 * MS, Vec3::Zero()));
  EXPECT_EQ(watch.broken(), "") << "that was of another promise";
}

TEST(PromiseWatch, AStaticBodyThatMovesAnotherMeshAndLostVertices) {
  const Outcome first = answered({between(0, 1, apart(1))});
  PromiseWatch watch;
  watch.setBounds({{0}, {0}});
  watch.follow(first);
  watch.follow(later(first, 100 * MS, {1e-300, 0, 0}));
  EXPECT_NE(watch.broken(), "");
  watch.follow(later(first, 200 * MS, {1e-9, 0, 0}));
  EXPECT_NE(watch.broken(), "");
  watch.follow(changed(later(first, 300 * MS, Vec3::Zero()),
                       [](Step& step) { step.bodies[1] = placed("tip", pair(1300 * MS, 1)); }));
  EXPECT_EQ(watch.broken(), "body 'tip' has another mesh");
  watch.follow(first);
  watch.follow(later(first, 100 * MS, Vec3::Constant(std::nan(""))));
  EXPECT_EQ(watch.broken(), "") << "what is not finite tells nothing";
}

TEST(PromiseWatch, AMapThatGrowsOrMovesAndNotOneThatShrinks) {
  const auto withMap = [](StampNs after_ns, std::vector<OccupiedLeaf> leaves, double x = 0) {
    const Outcome first = answered({between(0, 1, apart(1))});
    Outcome outcome = changed(later(first, after_ns, Vec3::Zero()), [&](Step& step) {
      step.map.surface = VoxelSurface::build(0.1, std::move(leaves));
      step.map.map_from_fixed.translation().x() = x;
    });
    outcome.obstacle = outcome.measured = outcome.step->map.surface;
    return outcome;
  };
  const OccupiedLeaf a{{40000, 40000, 40000}, 4}, b{{100, 100, 100}, 1}, part{{40002, 40000, 40000}, 2};
  const auto brokenBy = [&](const Outcome& then, const Outcome& now) {
    PromiseWatch watch;
    watch.setBounds({{1}, {1}});
    watch.follow(then);
    watch.follow(now);
    return watch.broken();
  };
  EXPECT_EQ(brokenBy(withMap(1, {a, b}), withMap(2 * MS, {b, a})), "");
  EXPECT_EQ(brokenBy(withMap(1, {a, b}), withMap(2 * MS, {part})), "");
  EXPECT_EQ(brokenBy(withMap(1, {part}), withMap(2 * MS, {a})), "the map has new voxels");
  std::vector<OccupiedLeaf> parts;  // of a, as a map is before it is pruned
  for (std::uint16_t i = 0; i < 8; ++i) {
    const auto at = [i](int axis) { return static_cast<std::uint16_t>(40000 + 2 * (i >> axis & 1)); };
    parts.push_back({{at(0), at(1), at(2)}, 2});
  }
  EXPECT_EQ(brokenBy(withMap(1, parts), withMap(2 * MS, {a})), "");
  parts.pop_back();
  EXPECT_EQ(brokenBy(withMap(1, parts), withMap(2 * MS, {a})), "the map has new voxels");
  EXPECT_EQ(brokenBy(withMap(1, {a}), withMap(2 * MS, {a, b})), "the map has new voxels");
  EXPECT_EQ(brokenBy(withMap(1, {}), withMap(2 * MS, {b})), "the map has new voxels");
  EXPECT_EQ(brokenBy(withMap(1, {a}), withMap(2 * MS, {})), "");
  Outcome counted = withMap(1, {a});
  counted.measured = VoxelSurface::build(0.1, {a, b});
  EXPECT_EQ(brokenBy(counted, withMap(2 * MS, {a, b})), "") << "it was seen before, if too seldom for an obstacle";
  EXPECT_EQ(brokenBy(withMap(1, {a}), counted), "") << "what is seen too seldom voids nothing";
  EXPECT_EQ(brokenBy(withMap(1, {a}), withMap(2 * MS, {a}, 1e-3)), "the map is elsewhere");
}

// --- the law ---------------------------------------------------------------------------------------------------------

constexpr SpeedLaw LAW{0.15, 0.4, 0.02};

TEST(SpeedScale, IsTheSolutionOfTheSeparationDistance) {
  // S_r + S_s + Z = 0.5 * 0.15 s + 0.5 * 0.4 / 2 s^2 + 0.02, and with S_h = 0.3 (0.15 + 0.4 s).
  EXPECT_DOUBLE_EQ(separationDistance(1, 0.5, 0, LAW), 0.195);
  EXPECT_DOUBLE_EQ(separationDistance(0.5, 0.5, 0.3, LAW), 0.3 * 0.35 + 0.0375 + 0.025 + 0.02);
  EXPECT_EQ(speedScale(0.195 + 1e-12, 0.5, 0, LAW), 1);
  const double d = 0.1, v = 0.5, t = LAW.reaction_time_s, s = LAW.stopping_time_s;
  EXPECT_NEAR(speedScale(d, v, 0, LAW), (std::sqrt(t * t + 2 * s * (d - 0.02) / v) - t) / s, 1e-12);
  EXPECT_LT(speedScale(0.02, 0.5, 0, LAW), 1e-15) << "what is to be left at the end";
  EXPECT_EQ(speedScale(0.064, 0.5, 0.3, LAW), 0) << "what does not slow down comes 0.045 m in the reaction time";
  EXPECT_GT(speedScale(0.066, 0.5, 0.3, LAW), 0);
  EXPECT_EQ(speedScale(0.03, 0, 0, LAW), 1) << "nothing moves";
}

TEST(SpeedScale, IsMonotoneAndNeedsNoMoreThanThereIs) {
  std::mt19937_64 random(5);
  std::uniform_real_distribution<double> value(0, 1);
  for (int i = 0; i < 20000; ++i) {
    const SpeedLaw law{value(random), i % 7 == 0 ? 0 : value(random), 0.1 * value(random)};
    const double d = value(random), more = d + (i % 2 == 0 ? value(random) : 1e-16);
    const double vr = value(random), vh = i % 3 == 0 ? 0 : value(random), faster = i % 5 == 0 ? 0x1p-50 : value(random);
    const double scale = speedScale(d, vr, vh, law);
    ASSERT_GE(scale, 0);
    ASSERT_LE(scale, 1);
    ASSERT_LE(scale, speedScale(more, vr, vh, law));
    ASSERT_GE(scale, speedScale(d, vr + faster, vh, law));
    ASSERT_GE(scale, speedScale(d, vr, vh + faster, law));
    if (scale == 0) continue;
    ASSERT_LE(separationDistance(scale, vr, vh, law), d);
    ASSERT_TRUE(scale == 1 || separationDistance(scale + 1e-9, vr, vh, law) > d - 1e-15);
  }
}

TEST(SpeedScale, OfWhatIsNoNumberIsZero) {
  for (const double d : {std::nan(""), -1.0, NONE}) EXPECT_EQ(speedScale(d, 1, 1, LAW), 0) << d;
  EXPECT_EQ(speedScale(1, NONE, 0, LAW), 0);
  EXPECT_EQ(speedScale(1, std::nan(""), 0, LAW), 0);
}

TEST(SpeedScale, IsTheLeastOfAllPairsAndSaysWhich) {
  const std::vector<SpeedBound> bounds{{0.5}, {0.5, false}};
  const SpeedScale free = speedScale(answered({between(0, 1, apart(3))}), bounds, LAW);
  EXPECT_EQ(free.scale, 1);
  EXPECT_EQ(free.reason, "");
  const Clearance expected = between(0, OBSTACLE_BODY, apart(0, ClearanceStatus::TOUCHING), true);
  EXPECT_EQ(speedScale(answered({expected, between(0, 1, apart(3))}), bounds, LAW).scale, 1);
  const Clearance others = between(1, OBSTACLE_BODY, apart(0.01));
  EXPECT_EQ(speedScale(answered({between(0, 0, apart(0.01)), between(0, 1, apart(3))}), bounds, LAW).scale, 1)
      << "folds are not the arm's matter";
  EXPECT_EQ(speedScale(answered({others, between(0, 1, apart(3))}), bounds, LAW).scale, 1)
      << "what does not slow down, and the map";
  const SpeedScale near = speedScale(answered({between(0, 0, apart(2)), between(0, 1, apart(0.3))}), bounds, LAW);
  EXPECT_EQ(near.scale, speedScale(0.3, 0.5, 0.5, LAW));
  EXPECT_LT(near.scale, 1);
  EXPECT_EQ(near.limiting, 1u);
  EXPECT_EQ(near.reason, "'floor' and 'tip' are 0.3 m apart, and 0.47 m are needed at full speed");
  const SpeedScale far = speedScale(answered({between(0, 1, apart(0.3, ClearanceStatus::FARTHER))}), bounds, LAW);
  EXPECT_EQ(far.scale, near.scale);
  EXPECT_EQ(far.reason,
            "'floor' and 'tip' are at least 0.3 m apart (farther is not measured: clearance/max_m), and 0.47 m are "
            "needed at full speed");
}

// What an arm did of late says nothing of what it does once it may: it creeps or rests before a wall, and sets off.
TEST(SpeedScale, IsAShareOfFullSpeedHoweverSlowTheLastStepWas) {
  const SpeedLaw law{0.3, 0.3, 0.02};
  for (const double way_m : {0.0, 1e-4, 0.005}) {  // in 0.1 s
    const Outcome hand = changed(answered({between(1, OBSTACLE_BODY, apart(0.025))}), [&](Step& step) {
      Positions before = *step.bodies[1].t1;
      for (Vec3& p : before) p.z() += way_m;
      step.bodies[1].t0 = share(before);
    });
    const SpeedScale scale = speedScale(hand, {{0}, {0.5}}, law);
    EXPECT_EQ(scale.scale, speedScale(0.025, 0.5, 0, law)) << way_m;
    EXPECT_LT(scale.scale, 0.05) << way_m;
    EXPECT_EQ(scale.needed_m, separationDistance(1, 0.5, 0, law));
    Outcome person = hand;
    person.clearances = {between(0, 1, apart(0.005))};
    EXPECT_EQ(speedScale(person, {{1.6, false}, {0.5}}, law).scale, 0) << way_m << ": a person is 5 mm away";
    EXPECT_EQ(speedScale(hand, {{0}, {NONE}}, law).scale, 0);
    EXPECT_EQ(speedScale(hand, {{0}, {NONE}}, law).reason, "no speed bound is known of body 'tip'");
  }
}

TEST(SpeedScale, IsZeroWhereNothingIsKnownOrSomethingTouchesAnew) {
  const std::vector<SpeedBound> bounds{{0.5}, {0.5}};
  Outcome outcome = answered({between(0, 1, apart(3))});
  EXPECT_EQ(speedScale(outcome, {{0.5}}, LAW).reason, "no speed bound is known of body 'tip'");
  EXPECT_EQ(speedScale(outcome, {{0.5}}, LAW).scale, 0);
  outcome.touching = Touching::LASTING;
  EXPECT_EQ(speedScale(outcome, bounds, LAW).scale, 1);
  outcome.touching = Touching::NEW;
  EXPECT_EQ(speedScale(outcome, bounds, LAW).scale, 0);
  EXPECT_EQ(speedScale(Outcome(), bounds, LAW).scale, 0);
  for (const SpeedLaw& bad : {SpeedLaw{-1, 0, 0}, SpeedLaw{0, NONE, 0}, SpeedLaw{0, 0, std::nan("")}}) {
    EXPECT_THROW(speedScale(outcome, bounds, bad), std::invalid_argument);
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
