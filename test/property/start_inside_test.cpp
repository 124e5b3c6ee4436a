// Closed bodies of every hard kind, their insides judged by the oracle; and what is carried over, by fresh histories.
// Seeds are fixed; DEFORMABLE_CCD_LONG=1 runs many more.
#include <gtest/gtest.h>

#include <iostream>
#include <limits>

#include "oracle/exact_inside.h"
#include "step/start/inside.h"
#include "support/closed_meshes.h"
#include "support/query_property.h"
#include "support/step_judge.h"
#include "support/step_truth.h"

namespace dccd {
namespace test {
namespace {

class InsideProperty : public testing::TestWithParam<int> {
 protected:
  Coordinates coordinates() const { return static_cast<Coordinates>(GetParam()); }
};

/// Two or three bodies, most of them closed.
TestStep closedBodies(const Draw& draw, Coordinates coordinates) {
  TestStep step;
  for (int b = draw(2, 3); b > 0; --b) {
    StepBody body;
    if (draw(0, 4) == 0) {
      body.topology = randomTopology(draw, draw(1, 4));
      body.t0 = randomPositions(draw, body.topology.vertexCount(), coordinates);
      body.t1 = randomMotion(draw, body.t0, coordinates);
    } else if (b == 1 && draw(0, 1) == 0) {  // all of it in one place, most likely within the first body
      const Positions& x = step.bodies[0].t0;
      const Vec3 at = x[0] / 4 + x[1] / 4 + x[2] / 4 + x[x.size() - 1] / 4;
      body = tetrahedron(at, at, at, at);
      body.t1 = randomMotion(draw, body.t0, coordinates);
    } else {
      body = randomClosed(draw, coordinates);
    }
    if (draw(0, 5) == 0) {  // and loose faces beside it
      StepBody loose;
      loose.topology = randomTopology(draw, draw(1, 2));
      loose.t0 = randomPositions(draw, loose.topology.vertexCount(), coordinates);
      loose.t1 = randomMotion(draw, loose.t0, coordinates);
      body = together(body, loose);
    }
    if (body.topology.hasFaces() && draw(0, 3) == 0) body = withOwnCorners(body);
    body.shell = draw(0, 9) == 0;
    body.self_collision = false;
    if (draw(0, 9) == 0) body.vertex_active.assign(body.t0.size(), 1);
    if (!body.vertex_active.empty()) body.vertex_active[static_cast<std::size_t>(draw(0, 2))] = 0;
    if (draw(0, 15) == 0) body.t0[0][1] = std::numeric_limits<double>::quiet_NaN();
    step.bodies.push_back(std::move(body));
  }
  return step;
}

// Every vertex of every body against every closed one.
TEST_P(InsideProperty, EveryPointIsWhereTheOracleSaysItIs) {
  const int rounds = (coordinates() == Coordinates::EXTREME ? 20 : 150) * (longRun() ? 100 : 1);
  std::size_t inside = 0, all = 0, edgeless = 0;
  for (int seed = 0; seed < rounds; ++seed) {
    const Draw draw = drawFrom(52000 + static_cast<std::uint64_t>(seed));
    const StepBody body = randomClosed(draw, coordinates());
    ASSERT_TRUE(body.topology.isClosed());
    Positions points = randomPositions(draw, 12, coordinates());
    for (std::size_t i = 0; i + 1 < body.t0.size(); i += 2) {
      points.push_back(body.t0[i] / 2 + body.t0[i + 1] / 2);  // on the surface or in a plane of it, now and then
      points.push_back(body.t0[i]);
      points.push_back(body.t0[i] + Vec3(0, 0, body.t0[i + 1][2] / 4 - body.t0[i][2] / 4));
    }
    std::vector<std::array<Vec3, 3>> faces;
    for (const Face& f : body.topology.faces()) faces.push_back({body.t0[f[0]], body.t0[f[1]], body.t0[f[2]]});
    for (const Vec3& point : points) {
      bool touched = false, enclosed = false;
      for (const auto& f : faces) {
        const Sight sight = sightOf(point.data(), f[0].data(), f[1].data(), f[2].data());
        touched = touched || sight == Sight::TOUCHED;
        enclosed = enclosed != (sight == Sight::ABOVE);
      }
      const bool truth = isInSolid(point, faces);
      ASSERT_EQ(touched || enclosed, truth) << "seed " << seed << ", point " << point.transpose();
      inside += truth;
      edgeless += truth && !touched;
      ++all;
    }
  }
  std::cout << all << " points, " << inside << " in the solid, " << edgeless << " of them on no face\n";
  EXPECT_GT(inside, all / 50);
  EXPECT_LT(inside, all);
}

TEST_P(InsideProperty, DetectorGivesTheTruth) {
  const int rounds = (coordinates() == Coordinates::EXTREME ? 3 : 12) * (longRun() ? 300 : 1);
  std::size_t inside = 0, alone = 0;
  for (int seed = 0; seed < rounds; ++seed) {
    const Draw draw = drawFrom(54000 + static_cast<std::uint64_t>(seed));
    const TestStep step = closedBodies(draw, coordinates());
    ASSERT_EQ(judgeStep(step), "") << "seed " << seed;
    inside += trueInsides(step).size();
    alone += !trueInsides(step).empty() && trueIntersections(step).empty();
  }
  std::cout << inside << " pieces inside, " << alone << " of " << rounds << " steps with nothing else\n";
}

// Steps that continue each other, some at rest: what is carried over is what a fresh history finds.
TEST_P(InsideProperty, CarriedOverIsWhatAFreshHistoryFinds) {
  const int rounds = (coordinates() == Coordinates::EXTREME ? 2 : 12) * (longRun() ? 200 : 1);
  int carried = 0, full = 0;
  for (int seed = 0; seed < rounds; ++seed) {
    const Draw draw = drawFrom(56000 + static_cast<std::uint64_t>(seed));
    std::vector<TestStep> steps{closedBodies(draw, coordinates())};
    for (int i = 0; i < 5; ++i) {
      std::vector<Positions> t1;
      for (const StepBody& body : steps.back().bodies) {
        t1.push_back(draw(0, 2) == 0 ? body.t1 : randomMotion(draw, body.t1, coordinates()));
        // One that was lost is there again, or is lost now.
        if (!t1.back()[0].allFinite()) t1.back()[0] = t1.back()[1];
        if (draw(0, 19) == 0) t1.back()[0][2] = std::numeric_limits<double>::infinity();
      }
      steps.push_back(steps.back().continued(t1));
    }
    ASSERT_EQ(judgeSequence(steps, carried, full), "") << "seed " << seed;
  }
}

std::string nameOf(const testing::TestParamInfo<int>& info) {
  static const char* const NAMES[] = {"SmallIntegers", "FewBits", "Real",       "LittleMotion", "HugeOffset",
                                      "Flat",          "AtRest",  "Coincident", "Subnormal",    "Extreme"};
  return NAMES[info.param];
}

INSTANTIATE_TEST_SUITE_P(Coordinates, InsideProperty, testing::Range(0, static_cast<int>(Coordinates::COUNT)), nameOf);

// A ball and small things about as large as its bumps, with little motion: most steps have no contact, some go in
// through the wall, many are inside without an edge near it.
TEST(InsideSequence, SmallThingsGoInAndOut) {
  int carried = 0, full = 0;
  std::size_t inside_alone = 0, clear = 0, touching = 0;
  for (int seed = 0; seed < (longRun() ? 2000 : 60); ++seed) {
    const Draw draw = drawFrom(58000 + static_cast<std::uint64_t>(seed));
    const auto small = [&](int range) { return Vec3(draw(-range, range), draw(-range, range), draw(-range, range)); };
    TestStep step;
    step.bodies = {ball(Vec3::Zero(), 1, 1), tetrahedron(small(4) / 5, small(4) / 5, small(4) / 5, small(4) / 5),
                   sheet(2, 3, small(9) / 9, 0.2)};
    for (Vec3& p : step.bodies[1].t0) p = p / 4 + step.bodies[1].t0[3];
    std::vector<TestStep> steps;
    for (int i = 0; i < 8; ++i) {
      for (StepBody& body : step.bodies) {
        const Vec3 drift = small(9) / 30;
        body.t1 = body.t0;
        for (Vec3& p : body.t1) p += drift + small(9) / 200;
      }
      steps.push_back(step);
      step = step.continued({step.bodies[0].t1, step.bodies[1].t1, step.bodies[2].t1});
    }
    ASSERT_EQ(judgeSequence(steps, carried, full), "") << "seed " << seed;
    Detector detector;
    for (const TestStep& one : steps) {
      const Outcome outcome = detector.run(one.motion());
      ASSERT_EQ(outcome.intersections.size(), trueStart(one).size()) << "seed " << seed;
      inside_alone += outcome.start_state == StartState::INTERSECTING && trueIntersections(one).empty();
      clear += outcome.start_state == StartState::CLEAR;
      touching += !outcome.contacts.empty();
    }
  }
  std::cout << inside_alone << " steps with nothing but insides, " << clear << " clear, " << touching
            << " with contacts; " << carried << " tests carried over, " << full << " by full ones\n";
  EXPECT_GT(inside_alone, 50u);
  EXPECT_GT(clear, 50u);
  EXPECT_GT(touching, 50u);
  EXPECT_LT(carried, full);
}

}  // namespace
}  // namespace test
}  // namespace dccd
