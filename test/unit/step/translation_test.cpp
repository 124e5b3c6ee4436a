// A body that only translates skips its self-collision, and only then.
#include <gtest/gtest.h>

#include <cmath>

#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

const Topology TWO_TRIANGLES = Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}});

struct Fixture : testing::Test {
  // Two parallel triangles, apart in the direction x-z, which is not among the linear filter's: pairs get past it.
  const Positions rest{{0, 0, 0},           {1, 0, 1},           {0, 1, 0}, {-0.0625, 0, 0.0625},
                       {0.9375, 0, 1.0625}, {-0.0625, 1, 0.0625}};
  Detector detector{[] {
    Options o;
    o.check_start_state = false;
    return o;
  }()};

  Positions moved(const Vec3& by) const { return movedBy(rest, by); }
  std::uint64_t selfPairs(const Positions& t0, const Positions& t1, bool continues) {
    if (!continues) detector.history().clear();
    const Outcome result = detector.run(stepOf(bodyOf("cloth", TWO_TRIANGLES), t0, t1));
    EXPECT_TRUE(result.contacts.empty());
    return result.stats[Effect::SELF_COLLISION].in;
  }
};

TEST_F(Fixture, TranslationThatContinuesAFreeStepTestsNothing) {
  // Multiples of a power of two: the rounded positions are exact translations.
  const Positions a = moved({0.25, 0, 0}), b = moved({0.5, 0.125, 0});
  EXPECT_GT(selfPairs(rest, a, false), 0u) << "nothing is known of the first step";
  EXPECT_EQ(selfPairs(a, b, true), 0u);
  EXPECT_EQ(selfPairs(b, b, true), 0u) << "rest is a translation by nothing";
  EXPECT_GT(selfPairs(b, a, false), 0u) << "a step that does not continue the last one is tested";
}

TEST_F(Fixture, OneUlpOfDeformationIsNoTranslation) {
  const Positions a = moved({0.25, 0, 0});
  selfPairs(rest, a, false);
  Positions b = moved({0.5, 0, 0});
  b[2].x() = std::nextafter(b[2].x(), 2.0);
  EXPECT_GT(selfPairs(a, b, true), 0u);
}

TEST_F(Fixture, RotationIsNoTranslation) {
  selfPairs(rest, rest, false);
  Positions turned = rest;
  for (Vec3& v : turned) v = Eigen::AngleAxisd(0.1, Vec3::UnitZ()) * v;
  EXPECT_GT(selfPairs(rest, turned, true), 0u);
}

TEST(Translation, ABodyThatTouchedItselfIsTestedAgain) {
  // Two triangles that coincide in a point for ever.
  const Positions x{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0.25, 0.25, 0}, {1, 1, 1}, {0, 1, 1}};
  Detector detector;
  const Step step = stepOf(bodyOf("pair", TWO_TRIANGLES), x, x);
  const std::size_t first = detector.run(step).contacts.size();
  ASSERT_GT(first, 0u);
  EXPECT_EQ(detector.run(step).contacts.size(), first);
}

}  // namespace
}  // namespace test
}  // namespace dccd
