// Bodies at rest are not refitted, bodies that are apart are not paired, and neither changes any answer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "step/history.h"
#include "support/brute_force.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

/// A cloth that rests (body 0) and one that is waved through it (body 1).
struct Waved {
  std::vector<Body> setups;
  Positions rest, moving;
  Waved() {
    for (const char* name : {"resting", "waved"}) setups.push_back(bodyOf(name, Topology::grid(9, 9)));
    for (int i = 0; i < 81; ++i) rest.emplace_back(0.1 * (i % 9), 0.1 * (i / 9), 0.01 * ((i * 7) % 5));
    moving = at(0);
  }
  Positions at(int k) const {
    Positions x = rest;
    for (Vec3& p : x) p += Vec3(0.03, 0.02, 0.3 * std::cos(0.7 * k) + 0.05 * std::sin(5 * p.x() + k));
    return x;
  }
};

TEST(BodiesAtRest, ARangeThatIsLeftIsWidenedAnew) {
  const Waved scene;
  Detector detector;
  const auto run = [&](double away) {
    Step step;
    step.bodies = {test::moving(scene.setups[0], scene.rest, scene.rest),
                   test::moving(scene.setups[1], movedBy(scene.moving, {away, 0, 0}), scene.at(5))};
    const Outcome result = detector.run(step);
    EXPECT_EQ(difference(result.contacts, Detector().run(step).contacts), "") << away;
    return result.stats.bodies_kept;
  };
  run(0);
  run(0.01);
  EXPECT_EQ(run(0.02), 1u);
  EXPECT_EQ(run(100), 0u) << "far out of the range";
  EXPECT_EQ(run(101), 1u);
  EXPECT_EQ(run(0), 0u) << "far too wide a range";
  EXPECT_EQ(run(0.01), 1u);
}

TEST(BodiesAtRest, ChangesOfAnyKindAreSeen) {
  const Waved scene;
  Detector detector;
  const Positions rest = scene.rest, beside = movedBy(rest, {0.03, 0.02, 0.03});  // so near that both need bounds
  const auto run = [&](const Positions& t0, const Positions& t1) {
    Step step;
    step.bodies = {test::moving(scene.setups[0], t0, t1), test::moving(scene.setups[1], beside, beside)};
    return detector.run(step);
  };
  run(rest, rest);
  run(rest, rest);
  EXPECT_EQ(run(rest, rest).stats.bodies_kept, 2u);
  Positions moved = rest;
  moved[40].z() = std::nextafter(moved[40].z(), 1.0);
  EXPECT_EQ(run(rest, moved).stats.bodies_kept, 1u) << "one vertex by one representable number";
  EXPECT_EQ(run(moved, moved).stats.bodies_kept, 1u);
  EXPECT_EQ(run(moved, moved).stats.bodies_kept, 2u);
  Options always;
  always.keep_bounds = false;
  detector.setOptions(always);
  EXPECT_EQ(run(moved, moved).stats.bodies_kept, 0u) << "by choice";
  detector.setOptions(Options());
  run(moved, moved);  // chooses a range that can be kept
  EXPECT_EQ(run(moved, moved).stats.bodies_kept, 2u);
  Positions lost = moved;
  lost[3].x() = std::nan("");
  EXPECT_EQ(run(lost, lost).stats.bodies_kept, 1u);
  EXPECT_EQ(run(lost, lost).stats.unchecked_vertices, 1u) << "and stays unchecked";
  Step wrong;
  const Positions few(3);
  wrong.bodies = {test::moving(scene.setups[0], rest, rest), test::moving(scene.setups[1], few, few)};
  EXPECT_THROW(detector.run(wrong), std::invalid_argument);
  EXPECT_EQ(run(rest, rest).stats.bodies_kept, 0u) << "after a refused step nothing is known to be in order";
}

// Bodies that are far are passed by for what all positions span, of which some are no numbers, or have no sum.
TEST(BodiesAtRest, WhatIsNotFiniteHidesNoContact) {
  const Topology one = Topology::fromTriangles(3, {{0, 1, 2}}),
                 two = Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}});
  const Positions tip{{0.2, 0.2, 0.5}, {0.2, 0.3, 2}, {0.3, 0.2, 2}};
  const Positions cloth{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {5, 0, 0}, {6, 0, 0}, {5, 1, 0}};
  for (const double odd : {std::nan(""), HUGE_VAL, -HUGE_VAL, 1e308}) {
    for (const int when : {1, 2, 3}) {
      Positions ends[] = {cloth, cloth};
      for (int end = 0; end < 2; ++end) {
        if (when >> end & 1) ends[end][4] = Vec3::Constant(odd);
      }
      Step step = stepOf(bodyOf("cloth", two), ends[0], ends[1]);
      for (const double x : {0.0, 1000.0}) {
        Body body = bodyOf(x == 0 ? "tool" : "far", one);
        body.rigid = true;
        body.against_obstacle = false;
        step.bodies.push_back(moving(body, movedBy(tip, {x, 0, 0}), movedBy(tip, {x, 0, -1})));
      }
      Options slow;
      slow.keep_bounds = false;
      const Outcome result = Detector().run(step);
      EXPECT_EQ(result.contacts.size(), 1u) << odd << " at " << when;
      EXPECT_EQ(difference(result.contacts, bruteForce(step, slow).contacts), "") << odd << " at " << when;
    }
  }
}

/// Everything that can happen to a stream, at random.
TEST(BodiesAtRest, RandomStreamsAreAnsweredAsIfNothingWereKept) {
  const Waved scene;
  std::uint64_t kept = 0, contacts = 0, contacts_after_rest = 0;
  for (unsigned seed = 1; seed <= 30; ++seed) {
    std::mt19937 random(seed);
    const auto oneIn = [&](unsigned n) { return random() % n == 0; };
    Options with, without;
    with.num_threads = 1 + static_cast<int>(seed % 2);
    without.keep_bounds = false;
    const bool distant = oneIn(3), rests = oneIn(2);  // so long that what was made of it is given back
    if (distant) with.accuracy.rung = without.accuracy.rung = Accuracy::CONSERVATIVE;
    Detector keeps(with), forgets(without);
    Positions at[2] = {scene.rest, scene.moving};
    bool both = true;
    for (int k = 0; k < 40; ++k) {
      if (oneIn(15)) both = !both;
      if (oneIn(15)) {  // a seam
        keeps.history().clear();
        forgets.history().clear();
      }
      if (oneIn(15)) at[1] = movedBy(at[1], {0.2, 0, 0});  // a teleport
      Step step;
      for (int b = 0; b < (both ? 2 : 1); ++b) {
        const bool stays = rests && b == 0 && k < 30;
        Positions t1 = !stays && oneIn(6) ? scene.at(k + 7 * b) : at[b];
        if (!stays && oneIn(15)) t1[random() % 81].x() = std::nan("");
        step.bodies.push_back(moving(scene.setups[static_cast<std::size_t>(b)], at[b], t1));
        if (distant) step.bodies.back().minimum_separation_m = 0.002;
        if (std::all_of(t1.begin(), t1.end(), [](const Vec3& p) { return p.allFinite(); })) at[b] = t1;
      }
      const Outcome a = keeps.run(step), b = forgets.run(step);
      const std::string where = "seed " + std::to_string(seed) + ", step " + std::to_string(k);
      ASSERT_EQ(difference(a.contacts, b.contacts), "") << where;
      ASSERT_EQ(a.status, b.status) << where;
      ASSERT_EQ(a.start_state, b.start_state) << where;
      ASSERT_TRUE(same(a.intersections, b.intersections)) << where;
      EXPECT_EQ(b.stats.bodies_kept, 0u);
      kept += a.stats.bodies_kept;
      contacts += a.contacts.size();
      const SceneBody& first = History::Impl::of(keeps.history()).scene.bodies()[0];
      contacts_after_rest += first.rests > RESTS ? a.contacts.size() : 0;
    }
  }
  EXPECT_GT(kept, 300u);
  EXPECT_GT(contacts_after_rest, 100u);
  EXPECT_GT(contacts, 1000u);
}

TEST(BodiesApart, AreNotPaired) {
  Step step;
  for (int b = 0; b < 5; ++b) {
    // Bodies 0 and 1 overlap, all others are far from each other.
    const Positions x = gridAt(4, 4, 1, b < 2 ? Vec3(0, 0, 0) : Vec3(10 * b, 0, 0.1 * b));
    step.bodies.push_back(moving(bodyOf(std::to_string(b), Topology::grid(4, 4)), x, x));
  }
  Detector detector;
  const Outcome result = detector.run(step);
  EXPECT_EQ(result.stats.body_pairs, 1u);
  EXPECT_GT(result.stats[Effect::BODY_BODY].in, 0u);
  step.bodies[1].t0 = step.bodies[1].t1 = share(gridAt(4, 4, 1, {0, 50, 0}));
  const Outcome none = detector.run(step);
  EXPECT_EQ(none.stats.body_pairs, 0u);
  EXPECT_EQ(none.stats[Effect::BODY_BODY].in, 0u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
