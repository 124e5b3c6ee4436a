#include "step/start/start_state.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/closed_meshes.h"
#include "support/shapes.h"
#include "support/step_truth.h"

namespace dccd {
namespace test {
namespace {

bool meet(const Vec3& p, const Vec3& q, const Vec3& a, const Vec3& b, const Vec3& c) {
  return segmentMeetsTriangle(p.data(), q.data(), a.data(), b.data(), c.data());
}

TEST(SegmentTriangle, DegenerateCases) {
  const Vec3 o(0, 0, 0), x(4, 0, 0), mid(1, 0, 0);
  EXPECT_TRUE(meet(mid, mid, o, o, x)) << "a point on a line";
  EXPECT_FALSE(meet({5, 0, 0}, {5, 0, 0}, o, o, x));
  EXPECT_TRUE(meet(o, o, o, o, o)) << "all in one place";
  EXPECT_FALSE(meet(o, o, x, x, x));
  EXPECT_TRUE(meet({1, -1, 0}, {1, 1, 0}, o, mid, x)) << "across a triangle without area";
  EXPECT_FALSE(meet({1, -1, 1}, {1, 1, 1}, o, mid, x));
  EXPECT_TRUE(meet({3, 0, 0}, {9, 0, 0}, o, mid, x)) << "along it";
  EXPECT_FALSE(meet({5, 0, 0}, {9, 0, 0}, o, mid, x));
}

// One ulp decides, far from what doubles can tell.
TEST(SegmentTriangle, OneUlp) {
  const double tiny = 5e-324;
  const Vec3 a(0, 0, 0), b(1, 0, 0), c(0, 1, 0);
  EXPECT_TRUE(meet({0.25, 0.25, 0}, {0.25, 0.25, 1}, a, b, c));
  EXPECT_FALSE(meet({0.25, 0.25, tiny}, {0.25, 0.25, 1}, a, b, c));
  EXPECT_TRUE(meet({0.5, 0.5, -1}, {0.5, 0.5, 1}, a, b, c));
  EXPECT_FALSE(meet({0.5, std::nextafter(0.5, 1), -1}, {0.5, 0.5, -tiny}, a, b, c));
  EXPECT_FALSE(meet({0.5, std::nextafter(0.5, 1), -1}, {0.5, std::nextafter(0.5, 1), 1}, a, b, c));
  EXPECT_TRUE(
      meet({1e308, 1e308, -1e308}, {1e308, 1e308, 1e308}, {-1.7e308, 0, 0}, {1.7e308, 0, 0}, {1.7e308, 1.7e308, 0}));
  EXPECT_FALSE(
      meet({1e308, 1e308, tiny}, {1e308, 1e308, 1e308}, {-1.7e308, 0, 0}, {1.7e308, 0, 0}, {1.7e308, 1.7e308, 0}));
}

// Touching on purpose, then rounded or moved by an ulp: the answer is at the mercy of the last bit.
TEST(SegmentTriangle, AgreesWithTheOracleWhereItIsClose) {
  const Draw draw = drawFrom(99);
  std::size_t meeting = 0;
  const int all = 2000;
  for (int i = 0; i < all; ++i) {
    Vec3 x[5];
    for (Vec3& point : x) point = Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9));
    const int s = draw(0, 8), r = draw(0, 8 - s);
    const Vec3 at = x[2] + s / 8.0 * (x[3] - x[2]) + r / 8.0 * (x[4] - x[2]);
    const Vec3 along = draw(0, 3) == 0 ? Vec3(x[3] - x[2]) : x[1];
    x[0] = at - draw(0, 4) / 4.0 * along;
    x[1] = at + draw(0, 4) / 4.0 * along;
    if (draw(0, 1) == 0) {
      const double f = draw(1, 1000) / 999.0, g = draw(-1000, 1000) / 777.0;
      for (Vec3& point : x) point = Vec3(f * point[0] + g * point[1], f * point[1] - g * point[2], f * point[2] + g);
    }
    if (draw(0, 1) == 0) {
      double& value = x[draw(0, 4)][draw(0, 2)];
      value = std::nextafter(value, draw(0, 1) == 0 ? -HUGE_VAL : HUGE_VAL);
    }
    const bool truth = trulyMeet(x[0], x[1], x[2], x[3], x[4]);
    ASSERT_EQ(meet(x[0], x[1], x[2], x[3], x[4]), truth) << i;
    ASSERT_EQ(meet(x[1], x[0], x[4], x[2], x[3]), truth) << i << ", in another order";
    meeting += truth;
  }
  EXPECT_GT(meeting, std::size_t{all} / 4);
  EXPECT_LT(meeting, std::size_t{all} - std::size_t{all} / 10);
}

// --- the whole test --------------------------------------------------------------------------------------------------

const Deadline NO_DEADLINE;

std::vector<Contact> contactsOf(const TestStep& step) {
  std::vector<Contact> contacts;
  for (const TrueContact& truth : trueContacts(step)) contacts.push_back(truth.contact);
  return contacts;
}

struct Scene {
  SceneArrays arrays;
  explicit Scene(const TestStep& step) {
    arrays.setBodies(step.motion().bodies);
    record(step);
  }
  void record(const TestStep& step) {
    StepStats stats;
    arrays.record(step.motion(), stats);
    arrays.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
  }
};

TEST(StartState, FullTestListsWhatTheOracleLists) {
  std::size_t found = 0;
  for (std::uint64_t seed = 0; seed < 60; ++seed) {
    const Draw draw = drawFrom(500 + seed);
    TestStep step = randomStep(draw, 8);
    if (seed % 5 == 0) {
      StepBody& body = step.bodies[0];
      body.t0[body.topology.edges()[0][0]] = Vec3::Constant(std::numeric_limits<double>::quiet_NaN());
    }
    Scene scene(step);
    StartStateSearch test;
    StepStats stats;
    const auto expected = trueIntersections(step);
    const auto& listed = test.run(scene.arrays, false, NO_DEADLINE, stats);
    ASSERT_TRUE(same(listed, expected)) << "seed " << seed << ": " << listed.size() << " listed, " << expected.size()
                                        << " in truth";
    EXPECT_EQ(stats[Stage::START_STATE].out, expected.size());
    EXPECT_EQ(stats[Effect::START_STATE].out, expected.size());
    EXPECT_GE(stats[Stage::START_STATE].in, expected.size());
    found += expected.size();
  }
  EXPECT_GT(found, 200u);
}

// A cloth that comes down on a spike: carried over, only the surroundings of contacts are looked at.
class FallingCloth : public testing::Test {
 protected:
  FallingCloth() {
    StepBody cloth, spike;
    cloth.topology = Topology::grid(5, 5);
    // Tilted, so that the bounds of cloth and spike overlap while they are apart.
    for (int i = 0; i < 25; ++i) cloth.t0.push_back(Vec3(i % 5, i / 5, 1 + 0.25 * (i % 5)));
    spike.topology = Topology::fromTriangles(3, {{0, 1, 2}});
    spike.t0 = {Vec3(1.7, 1.2, 1.3), Vec3(1.7, 1.2, -2), Vec3(2.7, 1.2, -2)};
    for (StepBody* body : {&cloth, &spike}) body->t1 = body->t0;
    for (Vec3& x : cloth.t1) x[2] = 0.25;
    step.bodies = {cloth, spike};
  }
  TestStep step;
};

TEST_F(FallingCloth, ForgetsWhereItMust) {
  Scene scene(step);
  StartStateSearch test;
  StepStats stats;
  const auto tested = [&](bool continues) {
    StepStats s;
    test.run(scene.arrays, continues, NO_DEADLINE, s);
    return s[Stage::START_STATE].in;
  };
  const std::uint64_t full = tested(false);
  ASSERT_GT(full, 0u);
  EXPECT_EQ(tested(true), full) << "nothing was remembered";
  test.remember(scene.arrays, {}, true);
  EXPECT_EQ(tested(true), 0u) << "no contact, nothing to test";
  EXPECT_EQ(tested(true), full) << "what is remembered holds for one step";
  test.remember(scene.arrays, {}, false);
  EXPECT_EQ(tested(true), full) << "an incomplete step";
  test.remember(scene.arrays, {}, true);
  test.clear();
  EXPECT_EQ(tested(true), full) << "a step without the test";
  test.remember(scene.arrays, {}, true);
  test.clear();
  test.keepBodies(0);
  EXPECT_EQ(tested(true), full) << "other bodies";
  test.remember(scene.arrays, {}, true);
  EXPECT_EQ(tested(false), full) << "a step that does not continue";
}

// What certainly does not fold crosses nothing of itself. It still crosses others, and itself once it is folded.
TEST(StartState, ASurfaceThatCertainlyDoesNotFoldIsNotSearched) {
  TestStep scene;
  StepBody sheet;
  sheet.topology = Topology::grid(8, 8);
  sheet.t0 = gridAt(8, 8, 1);
  sheet.t1 = movedBy(sheet.t0, Vec3(0, 0, 0.1));
  scene.bodies = {sheet};
  Detector detector;
  const Outcome flat = detector.run(scene.motion());
  ASSERT_EQ(flat.stats.unfolded_bodies, 1u);
  EXPECT_EQ(flat.start_state, StartState::CLEAR);
  EXPECT_EQ(flat.stats[Stage::START_STATE].in, 0u);

  StepBody& folded = scene.bodies[0];
  folded.t0 = folded.t1;
  for (Vec3& p : folded.t1) {
    if (p.x() > 3.5) p = Vec3(7.2 - p.x(), p.y() + 0.3, 1.5 - 0.5 * (p.x() - 3.5));
  }
  EXPECT_EQ(detector.run(scene.motion()).start_state, StartState::CLEAR);
  folded.t0 = folded.t1;
  const std::vector<StartIntersection> crossings = trueIntersections(scene);
  ASSERT_GT(crossings.size(), 10u);
  EXPECT_TRUE(same(detector.run(scene.motion()).intersections, crossings)) << "by what the step before touched";
  EXPECT_TRUE(same(Detector().run(scene.motion()).intersections, crossings)) << "by the search";

  StepBody upright;
  upright.topology = Topology::fromTriangles(3, {{0, 1, 2}});
  upright.t0 = upright.t1 = {Vec3(2.2, 2.3, 1), Vec3(2.2, 2.3, -1), Vec3(3.3, 2.4, -1)};
  scene.bodies = {sheet, upright};
  const Outcome crossed = Detector().run(scene.motion());
  EXPECT_EQ(crossed.stats.unfolded_bodies, 2u);
  EXPECT_TRUE(same(crossed.intersections, trueIntersections(scene)));
  EXPECT_FALSE(crossed.intersections.empty());
}

// A search that is cut goes on in the next step, while everything moves: cut at any place, it lists nothing that is
// not there, and once it has come to the end, all that is.
TEST(StartState, ASearchThatIsCutGoesOnInTheNextStep) {
  std::size_t cuts = 0, found_later = 0;
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const Draw draw = drawFrom(900 + seed);
    TestStep step = randomStep(draw, 8);
    Scene scene(step);
    StartStateSearch test;
    bool whole = false;
    for (int i = 0; i < 20; ++i) {
      std::atomic<std::int64_t> looks{draw(0, 3)};
      StepStats stats;
      const auto listed = test.run(scene.arrays, i > 0, Deadline::afterLooks(looks), stats);
      const auto expected = trueIntersections(step);
      if (test.isWhole()) {
        ASSERT_TRUE(same(listed, expected)) << "seed " << seed << ", step " << i;
        found_later += i > 0 && !whole && !expected.empty();
        whole = true;
      } else {
        ++cuts;
        for (const StartIntersection& one : listed) {
          ASSERT_TRUE(std::any_of(expected.begin(), expected.end(), [&](const auto& x) { return x == one; })) << seed;
        }
      }
      test.remember(scene.arrays, contactsOf(step), true);
      std::vector<Positions> ends;
      for (const StepBody& body : step.bodies) {
        ends.push_back(body.t1);
        for (Vec3& x : ends.back()) x += Vec3(draw(-4, 4), draw(-4, 4), draw(-4, 4)) / 8.0;
      }
      step = step.continued(ends);
      scene.record(step);
    }
    EXPECT_TRUE(whole) << "seed " << seed;
  }
  EXPECT_GT(cuts, 50u);
  EXPECT_GT(found_later, 0u);
}

// Where only the first contact is wanted, one edge through a face says that the step begins too late for it.
TEST(StartState, OneCrossingIsEnoughForTheFirstContact) {
  const TestStep step = crumpled(3, 2, 24);
  Options options;
  const Outcome whole = runOnce(step, options);
  ASSERT_GT(whole.intersections.size(), 100u);
  options.earliest_only = true;
  const Outcome first = runOnce(step, options);
  ASSERT_EQ(first.intersections.size(), 1u);
  EXPECT_TRUE(std::any_of(whole.intersections.begin(), whole.intersections.end(),
                          [&](const StartIntersection& one) { return one == first.intersections[0]; }));
  EXPECT_EQ(first.start_state, StartState::INTERSECTING);
  EXPECT_TRUE(first.start_state_complete);
  EXPECT_FALSE(first.cut);
  EXPECT_TRUE(assuranceOf(first).proved);
  EXPECT_LT(2 * first.stats[Stage::START_STATE].in, whole.stats[Stage::START_STATE].in);
  forEachSimdTarget([&](const std::string& target) {
    for (const int threads : {1, 2, 3}) {
      options.num_threads = threads;
      const Outcome other = runOnce(step, options);
      EXPECT_TRUE(same(other.intersections, first.intersections)) << target << ", " << threads << " threads";
      EXPECT_EQ(other.stats[Stage::START_STATE].in, first.stats[Stage::START_STATE].in) << target << ' ' << threads;
    }
  });
}

// Also where no part of the search finds so much alone.
TEST(StartState, TheSearchEndsWhereItHasFoundEnough) {
  const TestStep step = crumpled(3, 2, 48);
  Options options;
  const Outcome whole = runOnce(step, options);
  options.max_found = whole.intersections.size() / 8;
  options.num_threads = 2;
  const Outcome some = runOnce(step, options);
  EXPECT_TRUE(some.cut);
  EXPECT_EQ(some.intersections.size(), options.max_found);
  EXPECT_LT(2 * some.stats[Stage::START_STATE].in, whole.stats[Stage::START_STATE].in);
}

// In a stream without a contact its end is known, as with all contacts; a contact, or a crossing, ends that.
TEST(StartState, WithoutAFirstContactTheEndIsKnown) {
  TestStep step;
  step.bodies = {sheet(6, 6, Vec3::Zero(), 0.25), sheet(6, 6, Vec3(0, 0, 0.1), 0.25)};
  for (std::size_t i = 0; i < 36; ++i) step.bodies[1].t0[i][2] += 0.05 * static_cast<double>(i % 6);  // bounds overlap
  const Positions low = step.bodies[0].t0, high = step.bodies[1].t0, through = movedBy(high, {0, 0, -0.2});
  Options options;
  options.earliest_only = true;
  options.unfolded_test = false;  // a sheet without a fold is not searched
  History history;
  std::vector<std::uint64_t> tested;
  const std::vector<Positions> ends = {high, high, through, through, through};
  for (const Positions& end : ends) {
    step = step.continued({low, end});
    const Outcome outcome = detect(step.motion(), options, history);
    EXPECT_EQ(outcome.start_state == StartState::INTERSECTING, !trueIntersections(step).empty()) << tested.size();
    tested.push_back(outcome.stats[Stage::START_STATE].in);
  }
  EXPECT_GT(tested[0], 0u);
  EXPECT_EQ(tested[1], 0u);
  EXPECT_EQ(tested[2], 0u) << "it begins where nothing touched";
  EXPECT_GT(tested[3], 0u) << "more than the first contact may have begun";
  EXPECT_GT(tested[4], 0u);
}

// The same with many groups of edges a body, at rest: cut after any number of them, the parts are the whole.
TEST(StartState, PartsOfASearchAreTheWhole) {
  TestStep step = crumpled(3, 2, 24);
  for (StepBody& body : step.bodies) body.t1 = body.t0;
  Scene scene(step);
  StartStateSearch full_test;
  StepStats full;
  const std::vector<StartIntersection> expected = full_test.run(scene.arrays, false, NO_DEADLINE, full);
  ASSERT_GT(expected.size(), 100u);
  for (const int looks_a_step : {2, 3, 5, 8}) {
    StartStateSearch test;
    std::vector<StartIntersection> listed;
    int steps = 0;
    for (bool whole = false; !whole && steps < 1000; ++steps) {
      // What was found is looked at again first, at one look at the clock for many of them.
      std::atomic<std::int64_t> looks{looks_a_step + (steps > 0 ? static_cast<int>(expected.size() / 1024) + 1 : 0)};
      StepStats stats;
      listed = test.run(scene.arrays, steps > 0, Deadline::afterLooks(looks), stats);
      whole = test.isWhole();
      test.remember(scene.arrays, {}, true);
    }
    EXPECT_TRUE(same(listed, expected)) << looks_a_step << " looks a step: " << listed.size() << " of "
                                        << expected.size();
    EXPECT_GT(steps, 12 / looks_a_step) << "hardly cut";
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
