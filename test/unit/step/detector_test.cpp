#include "dccd/detect.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "step/conclude.h"
#include "support/heap.h"
#include "support/said.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

constexpr double NOT_A_NUMBER = std::numeric_limits<double>::quiet_NaN();

std::string differenceOfResults(const Outcome& x, const Outcome& y) {
  std::string text = difference(x.contacts, y.contacts);
  if (x.start_state != y.start_state) text += " start states differ";
  if (!same(x.intersections, y.intersections)) text += " intersections differ";
  return text;
}

TEST(Detector, TheSameForAnyNumberOfThreadsAndAnyTarget) {
  const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 4);
  const TestStep step = crumpled(1, 3, 14);
  for (const Accuracy rung : {Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    Options options;
    options.accuracy.rung = rung;
    const Outcome expected = runOnce(step, options);
    ASSERT_GT(expected.contacts.size(), 1000u);
    ASSERT_TRUE(expected.complete);
    EXPECT_TRUE(std::is_sorted(expected.contacts.begin(), expected.contacts.end(), canonicalLess)) << toString(rung);
    EXPECT_EQ(expected.start_state, StartState::INTERSECTING);
    for (const int threads : {1, 2, 3}) {
      options.num_threads = threads;
      forEachSimdTarget([&](const std::string& target) {
        const Outcome result = runOnce(step, options);
        EXPECT_EQ(differenceOfResults(result, expected), "")
            << toString(rung) << ", " << threads << " threads, " << target;
        EXPECT_EQ(result.stats.vf_candidates, expected.stats.vf_candidates) << target;
        EXPECT_EQ(result.stats.ee_candidates, expected.stats.ee_candidates) << target;
        EXPECT_EQ(result.stats[Stage::PLANAR].out, expected.stats[Stage::PLANAR].out) << target;
      });
    }
  }
}

/// A scene's size changes neither its contacts nor what the filters leave: be it that of denormal numbers.
TEST(Detector, TheSameOfAnySize) {
  TestStep step = crumpled(1, 3, 14);
  const auto times = [&](int exponent) {
    TestStep scaled = step;
    for (StepBody& body : scaled.bodies) {
      for (Positions* positions : {&body.t0, &body.t1}) {
        for (Vec3& p : *positions) {
          for (int k = 0; k < 3; ++k) p[k] = std::ldexp(std::floor(std::ldexp(p[k], 20)), exponent - 20);
        }
      }
    }
    return scaled;
  };
  const Outcome expected = runOnce(times(0), {});
  ASSERT_GT(expected.contacts.size(), 1000u);
  for (const int exponent : {1000, 160, -160, -1050}) {
    const Outcome result = runOnce(times(exponent), {});
    EXPECT_EQ(differenceOfResults(result, expected), "") << exponent;
    EXPECT_EQ(result.stats[Stage::PLANAR].out, expected.stats[Stage::PLANAR].out) << exponent;
    EXPECT_EQ(result.stats.tiers.settled, expected.stats.tiers.settled) << exponent;
  }
}

TEST(Detector, ManyBodies) {
  TestStep step;
  for (int b = 0; b < 300; ++b) {
    TestStep two = crossing();
    for (StepBody& body : two.bodies) {
      moveBy(body, Vec3(10.0 * (b % 20), 10.0 * (b / 20), 0));
      step.bodies.push_back(body);
    }
  }
  const std::size_t each = runOnce(crossing(), {}).contacts.size();
  ASSERT_GT(each, 0u);
  const Outcome result = runOnce(step, {});
  EXPECT_EQ(result.contacts.size(), 300 * each);
  EXPECT_TRUE(std::is_sorted(result.contacts.begin(), result.contacts.end(), canonicalLess));
  for (const Contact& c : result.contacts) EXPECT_EQ(c.body[0] / 2, c.body[1] / 2);
}

// Which of the two names the other does not matter; all other pairs are as they were.
TEST(Detector, BodiesThatAreNamedAreNotTestedAgainstEachOther) {
  TestStep step = crumpled(5, 3, 8);
  for (StepBody& body : step.bodies) body.self_collision = false;
  Step motion = step.motion();
  const auto answer = [](const Step& to_do) { return Detector().run(to_do); };
  const Outcome all = answer(motion);
  for (const auto& [namer, named] : {std::pair<std::size_t, std::uint16_t>{0, 2}, {2, 0}}) {
    motion = step.motion();
    motion.bodies[namer].not_against = {named};
    const Outcome some = answer(motion);
    std::vector<Contact> expected;
    std::copy_if(all.contacts.begin(), all.contacts.end(), std::back_inserter(expected),
                 [](const Contact& c) { return c.body[0] == 1 || c.body[1] == 1; });
    EXPECT_LT(expected.size(), all.contacts.size());
    EXPECT_EQ(difference(some.contacts, expected), "");
    for (const StartIntersection& one : some.intersections) EXPECT_TRUE(one.body[0] == 1 || one.body[1] == 1);
    EXPECT_LT(some.intersections.size(), all.intersections.size());
  }
  motion.bodies[0].not_against = {3};
  EXPECT_THROW(answer(motion), std::invalid_argument) << "there is no body 3";
}

// Bodies come near each other and go away again, move and rest. Without what is kept, all have bounds in every step.
TEST(Detector, NothingIsLostOfBodiesThatAreFarFromAllOthers) {
  std::uint64_t far = 0, contacts = 0, crossings = 0;
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    const Draw draw = drawFrom(seed);
    TestStep step = randomStep(draw, 12, Coordinates::REAL);
    History with, without;
    Options all;
    all.keep_bounds = false;
    for (int i = 0; i < 6 && step.bodies.size() > 1; ++i) {
      Step motion = step.motion();
      for (std::size_t b = 0; b < motion.bodies.size(); ++b) {
        motion.bodies[b].self_collision = b == 0 && seed % 2 == 0;
        motion.bodies[b].against_obstacle = b == 1 && seed % 3 == 0;
      }
      const Outcome expected = detect(motion, all, without);
      const Outcome result = detect(motion, {}, with);
      ASSERT_EQ(differenceOfResults(result, expected), "") << "seed " << seed << ", step " << i;
      EXPECT_EQ(expected.stats.bodies_far, 0u);
      far += result.stats.bodies_far;
      contacts += result.contacts.size();
      crossings += result.intersections.size();
      std::vector<Positions> next;
      for (const StepBody& body : step.bodies) {
        next.push_back(body.t1);
        const Vec3 move(draw(-3, 3), draw(0, 3) == 0 ? 0.25 : 0, 0);
        if (draw(0, 2) > 0) next.back() = movedBy(body.t1, move);
      }
      step = step.continued(next);
    }
  }
  EXPECT_GT(far, 100u);
  EXPECT_GT(contacts, 100u);
  EXPECT_GT(crossings, 100u);
}

// That they are left out, and masked ones, is StepProperty's matter.
TEST(Detector, VerticesThatAreNotFiniteAreCounted) {
  TestStep step = crumpled(6, 2, 9);
  step.bodies[0].t0[10][1] = NOT_A_NUMBER;
  step.bodies[0].t1[40][2] = HUGE_VAL;
  step.bodies[1].t1[3][0] = -HUGE_VAL;
  const Outcome result = runOnce(step, {});
  EXPECT_EQ(result.stats.unchecked_vertices, 3u);
  std::size_t faces = 0;
  const auto isBad = [](std::size_t b, Index v) { return b == 0 ? v == 10 || v == 40 : v == 3; };
  for (std::size_t b = 0; b < 2; ++b) {
    for (const Face& f : step.bodies[b].topology.faces()) faces += isBad(b, f[0]) || isBad(b, f[1]) || isBad(b, f[2]);
  }
  EXPECT_EQ(result.stats.unchecked_faces, faces);
}

// A rope that repeats a point has the edges of the first one: the second goes where that goes.
TEST(Detector, AVertexWithoutAnEdgeIsLookedAtWhereOneWithAnEdgeIs) {
  const Positions t0 = {{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {1, 0, 0}}, t1 = {{0, 0, 1}, {1, 0, 1}, {2, 0, 1}, {1, 0, 1}};
  Body body;
  body.topology = share(Topology::fromEdges(4, {{0, 1}, {1, 2}}));
  const auto loose = [&](Positions start, Positions end) {
    body.t0 = share(std::move(start));
    body.t1 = share(std::move(end));
    return looseVertices(body);
  };
  Positions elsewhere = t1, lost = t1;
  elsewhere[3][1] = 1e-300;
  lost[3][1] = NOT_A_NUMBER;
  EXPECT_EQ(loose(t0, t1), 0u);
  EXPECT_EQ(loose(t0, elsewhere), 1u);
  EXPECT_EQ(loose(t0, lost), 1u);
  lost[1] = lost[3];
  EXPECT_EQ(loose(t0, lost), 1u) << "neither is looked at";
  body.waypoints = {{0.5, {}, share(elsewhere)}};
  EXPECT_EQ(loose(t0, t1), 1u) << "it leaves in between";
  body.waypoints = {};
  body.vertex_mask = {1};
  EXPECT_EQ(loose(t0, t1), 1u) << "what is left out looks at nothing";
  body.vertex_mask = {};
  body.radius_m = share(std::vector<double>{0, 0, 0, 1});
  EXPECT_EQ(loose(t0, t1), 1u) << "it may be elsewhere";
  body.radius_m = share(std::vector<double>(4, 1.0));
  EXPECT_EQ(loose(t0, t1), 0u);
}

// The same detector, with vertices that come and go: what is left out of one step must be back in the next.
TEST(Detector, VerticesComeBack) {
  const TestStep step = crumpled(6, 1, 9);
  TestStep broken = step;
  for (std::size_t v = 0; v < 30; ++v) broken.bodies[0].t1[v][0] = NOT_A_NUMBER;
  TestStep gone = step;
  for (Vec3& x : gone.bodies[0].t0) x[0] = NOT_A_NUMBER;
  Detector detector;
  const Outcome expected = detector.run(step.motion());
  const Outcome expected_broken = runOnce(broken, {});
  for (int i = 0; i < 2; ++i) {
    EXPECT_EQ(difference(detector.run(broken.motion()).contacts, expected_broken.contacts), "");
    const Outcome nothing = detector.run(gone.motion());
    EXPECT_TRUE(nothing.contacts.empty());
    EXPECT_EQ(nothing.stats.unchecked_vertices, 81u);
    EXPECT_EQ(difference(detector.run(step.motion()).contacts, expected.contacts), "");
  }
  // Also when the first frame, which guides the order in memory, was not finite.
  Detector other;
  other.run(gone.motion());
  EXPECT_EQ(difference(other.run(step.motion()).contacts, expected.contacts), "");
}

template <class Call>
std::string refusal(const Call& call) {
  return said<std::invalid_argument>(call, "accepted");
}

void expectContains(const std::string& text, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    EXPECT_NE(text.find(part), std::string::npos) << text << " does not say " << part;
}

TEST(Detector, RefusesWhatDoesNotFitAndSaysWhere) {
  const TestStep step = crossing();
  Detector detector;
  const auto refused = [&](const Step& motion, const Options& options = {}) {
    return refusal([&] { Detector(options).run(motion); }) + refusal([&] {
             detector.setOptions(options);
             detector.run(motion);
           });
  };
  Step motion = step.motion();
  motion.bodies[1].t1 = share(Positions(2, Vec3::Zero()));
  expectContains(refused(motion), {"body_1", "3", "2"});
  motion = step.motion();
  motion.bodies[0].t0 = nullptr;
  expectContains(refused(motion), {"body_0", "3", "0"});
  motion = step.motion();
  motion.bodies[1].topology = nullptr;
  expectContains(refused(motion), {"body_1", "topology"});
  motion = step.motion();
  motion.bodies[0].vertex_mask = {7};
  expectContains(refused(motion), {"body_0", "7", "3"});
  for (const double separation : {-1.0, NOT_A_NUMBER, HUGE_VAL}) {
    motion = step.motion();
    motion.bodies[1].minimum_separation_m = separation;
    EXPECT_EQ(refused(motion).find("accepted"), std::string::npos) << separation;
  }
  motion.bodies[1].minimum_separation_m = 0.1;
  expectContains(refused(motion), {"exact", "0.1", "conservative"});
  Options options;
  options.num_threads = 0;
  expectContains(refused(step.motion(), options), {"num_threads", "0"});
  options = Options();
  options.step_budget_ms = -1;
  expectContains(refused(step.motion(), options), {"step_budget_ms", "-1"});
  options = Options();
  options.max_compute_ms = NOT_A_NUMBER;
  expectContains(refused(step.motion(), options), {"max_compute_ms", "nan"});
  motion = step.motion();
  motion.bodies[0].reference = share(Positions(2, Vec3::Zero()));
  expectContains(refused(motion), {"body_0", "needs 3 positions in its reference frame, got 2"});
  detector.setOptions(Options());
  // And goes on as if nothing had happened.
  EXPECT_EQ(difference(detector.run(step.motion()).contacts, runOnce(step, {}).contacts), "");
}

// Several bodies and a map: the canonical order puts kinds before bodies.
TEST(Detector, ContactsWithAMapAreInOrder) {
  TestStep step = crossing();
  for (StepBody& body : step.bodies) body.against_bodies = false;
  Step motion = step.motion();
  motion.map.surface = VoxelSurface::build(1.0, voxelsOfBox({0, 0, 0}, {4, 1, 1}));
  const Outcome result = Detector().run(motion);
  std::set<std::uint16_t> bodies;
  std::set<PairKind> kinds;
  for (const Contact& c : result.contacts) {
    EXPECT_EQ(c.body[1], OBSTACLE_BODY);
    bodies.insert(c.body[0]);
    kinds.insert(c.kind);
  }
  EXPECT_EQ(bodies.size(), 2u);
  EXPECT_GT(kinds.size(), 1u);
  EXPECT_TRUE(std::is_sorted(result.contacts.begin(), result.contacts.end(), canonicalLess));
  EXPECT_EQ(result.stats[Effect::OCTOMAP].out, result.contacts.size());
}

TEST(Detector, NothingToDo) {
  TestStep step;
  EXPECT_TRUE(runOnce(step, {}).contacts.empty()) << "no bodies";
  StepBody empty;
  step.bodies = {empty, empty};
  const Outcome result = runOnce(step, {});
  EXPECT_TRUE(result.contacts.empty());
  EXPECT_EQ(result.start_state, StartState::CLEAR);
  EXPECT_EQ(result.earliest_toc, std::numeric_limits<double>::infinity());
  StepBody loose;  // vertices without a feature
  loose.topology = Topology::fromTriangles(5, {});
  loose.t0 = loose.t1 = Positions(5, Vec3::Zero());
  step.bodies = {loose, crossing().bodies[0]};
  EXPECT_TRUE(runOnce(step, {}).contacts.empty());
}

// After warm-up a step allocates nothing that stays. The heap in use is compared after each round of the same steps.
TEST(Detector, MemoryIsFlat) {
  const TestStep step = crumpled(8, 2, 12);
  const TestStep back = step.continued({step.bodies[0].t0, step.bodies[1].t0});
  for (const int threads : {1, 2}) {
    Options options;
    options.num_threads = threads;
    Detector detector(options);
    const auto round = [&] {
      detector.run(step.motion());
      detector.run(back.motion());
    };
    for (int i = 0; i < 10; ++i) round();
    const std::size_t before = heapInUse();
    for (int i = 0; i < 20; ++i) round();
    const std::size_t after = heapInUse();
    // Which worker does which piece varies with more threads, and with it how far each one's buffers grow.
    if (threads == 1) {
      EXPECT_LE(after, before) << "bytes in use after and before 40 steps";
    } else {
      EXPECT_LE(after, before + (std::size_t{4} << 20));
    }
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
