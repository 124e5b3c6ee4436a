// Small steps of every hard kind: the detector's contacts, cells of time and start state are the truth's.
// Seeds are fixed; DEFORMABLE_CCD_LONG=1 runs many more.
#include <gtest/gtest.h>

#include <iostream>
#include <limits>

#include "support/query_property.h"
#include "support/step_judge.h"

namespace dccd {
namespace test {
namespace {

class StepProperty : public testing::TestWithParam<int> {
 protected:
  Coordinates coordinates() const { return static_cast<Coordinates>(GetParam()); }
  // Coordinates of all scales need long, here and in the oracle.
  int rounds(int usual, int long_factor) const {
    return (coordinates() == Coordinates::EXTREME ? usual / 6 : usual) * (longRun() ? long_factor : 1);
  }
};

TEST_P(StepProperty, DetectorGivesTheTruth) {
  const int steps = rounds(30, 400);  // long, all kinds: 110,000
  for (int seed = 0; seed < steps; ++seed) {
    const Draw draw = drawFrom(static_cast<std::uint64_t>(seed));
    const int triangles = 1 + 11 * seed / steps;  // small ones first, so that what fails first is simple
    const TestStep step = randomStep(draw, triangles, coordinates());
    ASSERT_EQ(judgeStep(step), "") << "seed " << seed << ", " << triangles << " triangles";
  }
  std::cout << steps << " steps of 1 to 12 triangles, each clustered and by brute force on every SIMD target\n";
}

// Sequences in which some steps rest, so that touching and crossing pairs stay as they are, too.
TEST_P(StepProperty, StartStateIsCarriedOver) {
  int carried = 0, full = 0;
  const int sequences = rounds(30, 100);
  for (int seed = 0; seed < sequences; ++seed) {
    const Draw draw = drawFrom(77777 + static_cast<std::uint64_t>(seed));
    std::vector<TestStep> steps{randomStep(draw, draw(2, 30), coordinates())};
    for (int i = 0; i < 4; ++i) {
      std::vector<Positions> t1;
      for (const StepBody& body : steps.back().bodies) {
        t1.push_back(draw(0, 2) == 0 ? body.t1 : randomMotion(draw, body.t1, coordinates()));
      }
      const bool broken = draw(0, 9) == 0 && !t1[0].empty();
      if (broken) t1[0][0][0] = std::numeric_limits<double>::infinity();
      steps.push_back(steps.back().continued(t1));
      if (broken) {  // and whole again, so that the next steps have something to say
        std::vector<Positions> whole;
        for (const StepBody& body : steps.front().bodies) whole.push_back(body.t0);
        steps.push_back(steps.back().continued(whole));
      }
    }
    ASSERT_EQ(judgeSequence(steps, carried, full), "") << "seed " << seed;
  }
}

std::string nameOf(const testing::TestParamInfo<int>& info) {
  static const char* const NAMES[] = {"SmallIntegers", "FewBits", "Real",       "LittleMotion", "HugeOffset",
                                      "Flat",          "AtRest",  "Coincident", "Subnormal",    "Extreme"};
  return NAMES[info.param];
}

INSTANTIATE_TEST_SUITE_P(Coordinates, StepProperty, testing::Range(0, static_cast<int>(Coordinates::COUNT)), nameOf);

// Bodies that start clear and come near each other a little at a time: most steps end clear, and some do not. A step
// that starts CLEAR and has no contact must end CLEAR, which the full test of the next one shows.
TEST(StepSequence, ClearWithoutContactEndsClear) {
  int carried = 0, full = 0, clear_steps = 0, steps_with_contact = 0;
  const int sequences = longRun() ? 3000 : 60;
  for (int seed = 0; seed < sequences; ++seed) {
    const Draw draw = drawFrom(31000 + static_cast<std::uint64_t>(seed));
    TestStep first;
    for (int b = 0; b < 3; ++b) {
      StepBody body;
      body.topology = Topology::grid(3, 4);
      for (int i = 0; i < 12; ++i) {
        body.t0.push_back(Vec3(i % 4, i / 4, b) + Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9)) / 50);
      }
      body.t1 = body.t0;
      first.bodies.push_back(body);
    }
    std::vector<TestStep> steps{first};
    for (int i = 0; i < 8; ++i) {
      std::vector<Positions> t1;
      for (const StepBody& body : steps.back().bodies) {
        Positions x = body.t1;
        const Vec3 drift = Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9)) / 20;
        for (Vec3& p : x) p += drift + Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9)) / 90;
        t1.push_back(x);
      }
      steps.push_back(steps.back().continued(t1));
    }
    ASSERT_EQ(judgeSequence(steps, carried, full), "") << "seed " << seed;
    Detector detector;
    for (const TestStep& step : steps) {
      const Outcome result = detector.run(step.motion());
      clear_steps += result.start_state == StartState::CLEAR && result.contacts.empty();
      steps_with_contact += !result.contacts.empty();
    }
  }
  std::cout << clear_steps << " clear steps without contact, " << steps_with_contact << " with contact; " << carried
            << " edge-face tests carried over, " << full << " by full tests\n";
  EXPECT_GT(clear_steps, sequences);
  EXPECT_GT(steps_with_contact, sequences);
  EXPECT_LT(carried, full);
}

}  // namespace
}  // namespace test
}  // namespace dccd
