// Bounds of bodies and groups that a separation or a radius widens: what comes within it is never culled, however large
// it is against the scene, and whichever vertices and bodies have it.
#include <gtest/gtest.h>

#include <limits>

#include "dccd/detect.h"
#include "support/brute_force.h"
#include "support/step_support.h"

namespace dccd {
namespace test {
namespace {

struct Radii {
  std::vector<std::vector<double>> of_body;  // empty: none
};

Outcome run(const TestStep& step, const Radii& radii, bool sought = true) {
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  Step motion = step.motion();
  for (std::size_t b = 0; b < radii.of_body.size(); ++b) {
    if (!radii.of_body[b].empty()) motion.bodies[b].radius_m = share(radii.of_body[b]);
  }
  return sought ? Detector(options).run(motion) : bruteForce(motion, options);
}

StepBody flat(std::size_t size, double z) {
  StepBody body;
  body.topology = Topology::grid(size, size);
  for (std::size_t i = 0; i < size * size; ++i) {
    const double cells = static_cast<double>(size - 1);
    body.t0.push_back(Vec3(static_cast<double>(i % size) / cells, static_cast<double>(i / size) / cells, z));
  }
  body.t1 = body.t0;
  body.self_collision = false;
  return body;
}

// The records of two flat bodies span no more than the distance between them, and a radius may be many times that
// range: on one body alone it has to reach over all of it.
TEST(SeparationBounds, RadiusOfOneBodyLargerThanTheScene) {
  TestStep step;
  step.bodies = {flat(2, 0), flat(3, 0.02)};
  for (const std::size_t with : {0u, 1u}) {
    for (const double radius_m : {0.0101, 0.02, 0.03, 1.0, 1e6, 1e300}) {
      Radii radii;
      radii.of_body.resize(2);
      radii.of_body[with].assign(step.bodies[with].t0.size(), radius_m);
      const Outcome result = run(step, radii, true);
      EXPECT_EQ(result.contacts.empty(), radius_m < 0.02) << "radius " << radius_m << " m of body " << with;
      EXPECT_EQ(result.earliest_toc == 0, radius_m >= 0.02);
      EXPECT_EQ(difference(result.contacts, run(step, radii, false).contacts), "")
          << "radius " << radius_m << " m of body " << with;
    }
  }
}

// A feature reaches as far as the most uncertain of its vertices. Here that vertex is in another group than the
// feature's outermost one, so that no group of vertices reaches as far as the feature does.
TEST(SeparationBounds, FeatureReachesFartherThanItsVertices) {
  TestStep step;
  step.bodies.resize(2);
  StepBody &rope = step.bodies[0], &bar = step.bodies[1];
  rope.topology = Topology::polyline(17);  // sixteen vertices in a group: the last has one of its own
  for (int i = 0; i < 17; ++i) rope.t0.push_back(Vec3(0.1 * i, 0, 0));
  bar.topology = Topology::polyline(2);
  bar.t0 = {Vec3(1.7, -1, 0), Vec3(1.7, 1, 0)};
  for (StepBody& body : step.bodies) {
    body.t1 = body.t0;
    body.self_collision = false;
  }
  Radii radii;
  radii.of_body = {std::vector<double>(17, 0.0), {}};
  radii.of_body[0][15] = 0.15;  // at x = 1.5; the edge from there to x = 1.6 is 0.1 from the bar
  const Outcome result = run(step, radii, true);
  ASSERT_EQ(result.contacts.size(), 1u);
  EXPECT_EQ(result.contacts[0].kind, PairKind::EDGE_EDGE);
  EXPECT_EQ(result.contacts[0].vertex, (std::array<Index, 4>{15, 16, 0, 1}));
  EXPECT_EQ(difference(result.contacts, run(step, radii, false).contacts), "");
}

// A body that is not seen at all has no place in the range of the records, which may lie anywhere.
TEST(SeparationBounds, BodyWithoutAnyPositionFarFromTheOthers) {
  constexpr double NONE = std::numeric_limits<double>::quiet_NaN();
  TestStep step = crossing();
  for (const double at : {5e5, -5e5}) {
    TestStep far = step;
    for (StepBody& body : far.bodies) {
      for (Positions* x : {&body.t0, &body.t1}) {
        for (Vec3& p : *x) p += Vec3::Constant(at);
      }
    }
    const std::size_t seen = runOnce(far, {}).contacts.size();
    StepBody lost = step.bodies[0];
    for (Positions* x : {&lost.t0, &lost.t1}) {
      for (Vec3& p : *x) p.setConstant(NONE);
    }
    far.bodies.push_back(lost);
    const Outcome result = runOnce(far, {});
    EXPECT_EQ(result.contacts.size(), seen);
    EXPECT_GT(seen, 0u);
    EXPECT_EQ(result.stats.unchecked_vertices, 3u);
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
