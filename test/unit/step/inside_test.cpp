// What is inside of a closed body at the start of a step, though no edge meets a face.
#include "step/start/inside.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "dccd/stream.h"
#include "support/closed_meshes.h"
#include "support/shapes.h"
#include "support/step_truth.h"
#include "unit/failing_allocations.h"

namespace dccd {
namespace test {
namespace {

const double NAN_M = std::numeric_limits<double>::quiet_NaN();

StartIntersection insideOf(std::uint16_t body, Index vertex, std::uint16_t closed) {
  return {{body, closed}, {vertex, NO_INDEX, NO_INDEX, NO_INDEX, NO_INDEX}};
}

StepBody clothAt(const Vec3& corner) { return sheet(4, 5, corner, 0.1); }

/// A cloth in the middle of a box, of which neither has an edge near a face of the other.
TestStep clothInABox() {
  TestStep step;
  step.bodies = {clothAt({0.2, 0.1, 0}), box({-1, -1, -1}, {1, 1, 1})};
  return step;
}

Outcome startOf(const TestStep& step) { return runOnce(step, {}); }

TEST(Inside, AClothInAClosedBodyIsNoClearStart) {
  const Outcome outcome = startOf(clothInABox());
  EXPECT_EQ(outcome.start_state, StartState::INTERSECTING);
  EXPECT_TRUE(same(outcome.intersections, {insideOf(0, 0, 1)})) << outcome.intersections.size();
  EXPECT_FALSE(assuranceOf(outcome).clear());
  EXPECT_EQ(outcome.touching, Touching::LASTING);
  EXPECT_TRUE(outcome.contacts.empty()) << "and yet nothing touches";
  EXPECT_EQ(outcome.status, StepStatus::OK);
}

TEST(Inside, ABodyThatIsOutsideOrNotAskedForIsClear) {
  TestStep beside = clothInABox();
  moveBy(beside.bodies[0], {5, 0, 0});
  EXPECT_EQ(startOf(beside).start_state, StartState::CLEAR);
  TestStep unasked = clothInABox();
  unasked.bodies[0].against_bodies = false;
  EXPECT_EQ(startOf(unasked).start_state, StartState::CLEAR);
  TestStep container = clothInABox();
  container.bodies[1].shell = true;
  const Outcome contained = startOf(container);
  EXPECT_EQ(contained.start_state, StartState::CLEAR);
  EXPECT_TRUE(assuranceOf(contained).proved);
  EXPECT_EQ(contained.excluded, (std::vector<std::string>{"body 'body_1': others may be inside of it"}));
  Options options;
  options.check_start_state = false;
  const Outcome off = runOnce(clothInABox(), options);
  EXPECT_EQ(off.start_state, StartState::NOT_CHECKED);
  EXPECT_TRUE(off.intersections.empty());
}

TEST(Inside, WhatHasABorderHasNoInside) {
  TestStep open = clothInABox();
  std::vector<Face> faces = open.bodies[1].topology.faces();
  faces.pop_back();
  open.bodies[1].topology = Topology::fromTriangles(8, faces);
  EXPECT_EQ(startOf(open).start_state, StartState::CLEAR);
  TestStep masked = clothInABox();
  masked.bodies[1].vertex_active.assign(8, 1);
  masked.bodies[1].vertex_active[3] = 0;
  EXPECT_EQ(startOf(masked).start_state, StartState::CLEAR) << "a hole where the vertex is left out";
  TestStep lost = clothInABox();
  lost.bodies[1].t1[3][0] = NAN_M;
  const Outcome partial = startOf(lost);
  EXPECT_EQ(partial.start_state, StartState::CLEAR);
  EXPECT_EQ(partial.status, StepStatus::PARTIAL);
  EXPECT_FALSE(assuranceOf(partial).clear());
}

TEST(Inside, ALooseFaceDoesNotOpenAShell) {
  StepBody loose;
  loose.t0 = loose.t1 = {{1.5, 0, 0}, {2.5, 0, 0}, {1.5, 1, 0}};
  loose.topology = Topology::fromTriangles(3, {{0, 1, 2}});
  TestStep step = clothInABox();
  step.bodies[1] = together(step.bodies[1], loose);
  ASSERT_FALSE(step.bodies[1].topology.isClosed());
  EXPECT_TRUE(same(startOf(step).intersections, {insideOf(0, 0, 1)}));
  EXPECT_TRUE(same(trueInsides(step), {insideOf(0, 0, 1)}));
  moveBy(step.bodies[0], {0, 0, -3});
  EXPECT_EQ(startOf(step).start_state, StartState::CLEAR);
  TestStep below = clothInABox();  // above it are the lid, and a face that encloses nothing
  moveBy(loose, {-1.5, 0, 2});
  below.bodies[1] = together(below.bodies[1], loose);
  EXPECT_TRUE(same(startOf(below).intersections, {insideOf(0, 0, 1)}));
  TestStep joined = clothInABox();  // an edge with three faces: what it encloses is not told
  std::vector<Face> faces = joined.bodies[1].topology.faces();
  faces.push_back({0, 1, 8});
  for (Positions* x : {&joined.bodies[1].t0, &joined.bodies[1].t1}) x->push_back({-3, -3, -3});
  joined.bodies[1].topology = Topology::fromTriangles(9, faces);
  EXPECT_EQ(startOf(joined).start_state, StartState::CLEAR);
  EXPECT_TRUE(trueInsides(joined).empty());
}

TEST(Inside, OneBoxHasOneAnswerHoweverItsCornersAreNumbered) {
  TestStep step = clothInABox();
  step.bodies[1] = withOwnCorners(step.bodies[1]);
  ASSERT_FALSE(step.bodies[1].topology.isClosed());
  EXPECT_TRUE(same(startOf(step).intersections, {insideOf(0, 0, 1)}));
  EXPECT_FALSE(assuranceOf(startOf(step)).clear());
  EXPECT_TRUE(same(trueInsides(step), {insideOf(0, 0, 1)}));
  step.bodies[1].t0[4] += 0.0 * step.bodies[1].t0[4];  // zeros of either sign are one place
  for (int axis = 0; axis < 3; ++axis) {
    double& x = step.bodies[1].t0[7][axis];
    x = x == 0 ? -0.0 : x;
  }
  EXPECT_TRUE(same(startOf(step).intersections, {insideOf(0, 0, 1)}));
  // As a soup of two layers, one for either side, and with a face that is a line in it.
  TestStep layers = clothInABox();
  StepBody two = together(withOwnCorners(layers.bodies[1]), withOwnCorners(layers.bodies[1]));
  std::vector<Face> faces = two.topology.faces();
  const Index last = static_cast<Index>(two.t0.size());
  faces.push_back({last, last + 1, 0});
  for (Positions* x : {&two.t0, &two.t1}) x->insert(x->end(), {(*x)[0], (*x)[1]});
  two.topology = Topology::fromTriangles(two.t0.size(), faces);
  two.self_collision = false;
  layers.bodies[1] = two;
  EXPECT_TRUE(same(startOf(layers).intersections, {insideOf(0, 0, 1)}));
  moveBy(layers.bodies[0], {0, 0, -3});
  EXPECT_EQ(startOf(layers).start_state, StartState::CLEAR) << "under it, with all layers above";
}

/// `last`, after `before` and an attempt at it in which one allocation after the other fails, is answered as ever.
void expectNothingHalfDone(const std::vector<Step>& before, const Step& last) {
  const Outcome expected = Detector().run(last);
  const int allocations = failingEverywhere([&](int n) {
    Detector detector;
    for (const Step& step : before) detector.run(step);
    const bool met = failsAt(n, false, [&] { detector.run(last); });
    const Outcome outcome = detector.run(last);
    EXPECT_TRUE(same(outcome.intersections, expected.intersections));
    EXPECT_EQ(difference(outcome.contacts, expected.contacts), "");
    return met;
  });
  EXPECT_GE(allocations, 50);
}

TEST(Inside, IsFoundAfterAnAllocationThatFailedWhileSeamsWereSought) {
  TestStep step = clothInABox();
  step.bodies[1] = withOwnCorners(step.bodies[1]);
  ASSERT_TRUE(same(startOf(step).intersections, {insideOf(0, 0, 1)}));
  expectNothingHalfDone({}, step.motion());
}

TEST(Inside, EveryPieceIsFoundAfterAnAllocationThatFailedWhileTheyWereListed) {
  TestStep step = clothInABox();
  for (int i = 0; i < 4; ++i) step.bodies[0] = together(step.bodies[0], clothAt({0.2, 0.1, 0.1 + 0.1 * i}));
  ASSERT_EQ(startOf(step).intersections.size(), 5u);
  expectNothingHalfDone({}, step.motion());
}

TEST(Inside, SeamsThatComeApartAreApartAfterAnAllocationThatFailedForAnotherBody) {
  TestStep sewn = clothInABox();
  sewn.bodies[1] = withOwnCorners(sewn.bodies[1]);
  sewn.bodies.insert(sewn.bodies.begin(), withOwnCorners(box({4, 4, 4}, {5, 5, 5})));
  TestStep apart = sewn;
  apart.bodies[2].t1[5][0] += 0.1;
  sewn.bodies[0].t0[5][0] += 0.1;  // what is sought anew
  ASSERT_EQ(startOf(sewn).start_state, StartState::INTERSECTING);
  ASSERT_EQ(startOf(apart).start_state, StartState::CLEAR);
  expectNothingHalfDone({sewn.motion()}, apart.motion());
}

TEST(Inside, WhatIsLeftOutIsThatOfTheStepAfterAnAllocationThatFailedWhileSeamsWereSought) {
  TestStep open;
  open.bodies = {withOwnCorners(box({-1, -1, -1}, {1, 1, 1})), clothAt({0.2, 0.1, 0})};
  open.bodies[1].t1 = movedBy(open.bodies[1].t0, {0, 0, 3});
  TestStep closed = open;
  open.bodies[0].t0[5][0] += 0.1;
  open.bodies[1].t0[0][0] = NAN_M;
  closed.bodies[1].t0[7][0] = NAN_M;
  const Outcome outcome = startOf(closed);
  ASSERT_FALSE(outcome.contacts.empty());
  expectNothingHalfDone({open.motion()}, closed.motion());
}

TEST(Inside, CornersThatAreNotAtOnePlaceThroughoutTheStepAreABorder) {
  for (const bool at_end : {false, true}) {
    TestStep step = clothInABox();
    step.bodies[1] = withOwnCorners(step.bodies[1]);
    Vec3& corner = (at_end ? step.bodies[1].t1 : step.bodies[1].t0)[5];
    corner[0] = std::nextafter(corner[0], 9);
    EXPECT_EQ(startOf(step).start_state, StartState::CLEAR);
    EXPECT_TRUE(trueInsides(step).empty());
  }
  TestStep hole = clothInABox();
  std::vector<Face> faces = hole.bodies[1].topology.faces();
  faces.pop_back();
  hole.bodies[1].topology = Topology::fromTriangles(8, faces);
  hole.bodies[1] = withOwnCorners(hole.bodies[1]);
  EXPECT_EQ(startOf(hole).start_state, StartState::CLEAR);
}

TEST(Inside, ABodyIsNotAskedAboutItself) {
  TestStep step;
  step.bodies = {together(box({-2, -2, -2}, {2, 2, 2}), box({-1, -1, -1}, {1, 1, 1})), clothAt({0.2, 0.1, 1.5}),
                 clothAt({0.2, 0.1, 0})};
  const Outcome outcome = startOf(step);
  EXPECT_TRUE(same(outcome.intersections, {insideOf(1, 0, 0)})) << "in the wall, and in the hollow of it";
}

// What is left out of a body cuts it into pieces, and no edge shows that one of them went in.
TEST(Inside, PiecesEndAtVerticesThatAreLeftOut) {
  TestStep step = clothInABox();
  StepBody& rope = step.bodies[0];
  rope.topology = Topology::polyline(4);
  rope.t0 = {Vec3(3, 0.1, 0.2), Vec3(2, 0.1, 0.2), Vec3(0.5, 0.1, 0.2), Vec3(0, 0.1, 0.2)};
  rope.t1 = rope.t0;
  rope.vertex_active = {1, 1, 0, 1};
  EXPECT_TRUE(same(startOf(step).intersections, {insideOf(0, 3, 1)}));
  rope.vertex_active.clear();
  rope.t1[2][1] = NAN_M;
  EXPECT_TRUE(same(startOf(step).intersections, {insideOf(0, 3, 1)})) << "unchecked instead of masked";
  // Lost and found again in a stream: the pieces are those of each step.
  const Positions lost = rope.t1, whole = rope.t0, solid = step.bodies[1].t0;
  rope.t1 = whole;
  Detector detector;
  for (const Positions& end : {whole, lost, whole, whole, lost}) {
    EXPECT_TRUE(same(detector.run(step.motion()).intersections, startOf(step).intersections));
    step = step.continued({end, solid});
  }
}

// Over an axis-aligned box every half-line from a lattice point runs through edges, corners and in faces' planes. The
// body asked about is a rope of no length, so that its edge meets a face where the point is on the surface alone.
TEST(Inside, EveryPointOfALatticeOverABox) {
  for (const double scale : {1.0, 5e-324, 4e307}) {
    const StepBody solid = box(scale * Vec3(-2, -1, -1), scale * Vec3(1, 2, 2));
    for (int i = 0; i < 7 * 7 * 7; ++i) {
      const Vec3 point(i % 7 - 3, i / 7 % 7 - 3, i / 49 - 3);
      const bool in_solid =
          (point.array() >= Vec3(-2, -1, -1).array()).all() && (point.array() <= Vec3(1, 2, 2).array()).all();
      TestStep step;
      StepBody rope;
      rope.topology = Topology::polyline(2);
      rope.t0 = rope.t1 = {scale * point, scale * point};
      step.bodies = {rope, solid};
      const Outcome outcome = startOf(step);
      const bool listed = std::any_of(outcome.intersections.begin(), outcome.intersections.end(),
                                      [](const auto& one) { return one == insideOf(0, 0, 1); });
      ASSERT_EQ(listed, in_solid) << point.transpose() << " x " << scale;
    }
  }
}

// --- carried over ----------------------------------------------------------------------------------------------------

TEST(Inside, WhatIsInsideStaysKnownWithoutAQuestion) {
  TestStep step = clothInABox();
  Detector detector;
  EXPECT_GT(detector.run(step.motion()).stats[Stage::START_STATE].in, 0u);
  for (int i = 0; i < 3; ++i) {
    const Positions moved = movedBy(step.bodies[0].t1, {0.05, 0.02, 0.1});
    Positions turned = step.bodies[1].t1;
    for (Vec3& p : turned) p = Eigen::AngleAxisd(0.1, Vec3::UnitX()) * p;
    step = step.continued({moved, turned});
    const Outcome outcome = detector.run(step.motion());
    EXPECT_TRUE(same(outcome.intersections, {insideOf(0, 0, 1)}));
    EXPECT_EQ(outcome.stats[Stage::START_STATE].in, 0u);
  }
}

TEST(Inside, ABoxThatComesApartAndClosesAgainIsAskedAnew) {
  TestStep step = clothInABox();
  step.bodies[1] = withOwnCorners(step.bodies[1]);
  const Positions closed = step.bodies[1].t0;
  Positions apart = closed;
  apart[5][0] += 0.25;
  Detector detector;
  for (const Positions& end : {closed, closed, apart, apart, closed, closed, closed}) {
    step = step.continued({step.bodies[0].t1, end});
    const Outcome outcome = detector.run(step.motion());
    EXPECT_TRUE(same(outcome.intersections, startOf(step).intersections));
    EXPECT_TRUE(same(outcome.intersections, trueInsides(step)));
  }
  EXPECT_EQ(detector.run(step.motion()).start_state, StartState::INTERSECTING);
}

// While all else is passed by, nobody looks whether the box is closed; that it rests makes this no answer for later.
TEST(Inside, ABoxAtRestIsSewnOnceSomethingComesNear) {
  TestStep near = clothInABox();
  near.bodies[1] = withOwnCorners(near.bodies[1]);
  near.bodies[0].self_collision = false;
  TestStep far = near;
  moveBy(far.bodies[0], {5, 0, 0});
  Detector detector;
  for (const bool is_near : {false, false, true, true, false, true}) {
    Step step = (is_near ? near : far).motion();
    step.bodies[0].against_obstacle = false;
    const Outcome outcome = detector.run(step);
    EXPECT_EQ(outcome.stats.bodies_far == 0, is_near);
    EXPECT_TRUE(same(outcome.intersections, trueInsides(is_near ? near : far)));
    EXPECT_EQ(outcome.start_state, is_near ? StartState::INTERSECTING : StartState::CLEAR);
  }
}

TEST(Inside, ASearchThatIsCutGoesOnAndNeverSaysOutside) {
  TestStep step;
  for (int i = 0; i < 6; ++i) step.bodies.push_back(clothAt({-0.8 + 0.2 * i, 0.1, 0.3 - 0.1 * i}));
  step.bodies.push_back(box({-1, -1, -1}, {1, 1, 1}));
  step.bodies.push_back(box({-2, -2, -2}, {2, 2, 2}));
  const std::vector<StartIntersection> expected = trueInsides(step);
  ASSERT_EQ(expected.size(), 13u);
  SceneArrays scene;
  StepStats stats;
  scene.setBodies(step.motion().bodies);
  scene.record(step.motion(), stats);
  scene.refit([](std::size_t n, const auto& f) { f(0, n); }, stats);
  InsideSearch search;
  std::size_t before = 0;
  int cuts = 0;
  for (bool whole = false; !whole; ++cuts) {
    std::atomic<std::int64_t> looks{1};
    const auto listed = search.run(scene, cuts > 0, Deadline::afterLooks(looks), stats);
    whole = search.isWhole();
    ASSERT_GT(listed.size() + whole, before) << "it goes on";
    ASSERT_LE(listed.size(), expected.size());
    EXPECT_TRUE(same(listed, {expected.begin(), expected.begin() + static_cast<std::ptrdiff_t>(listed.size())}));
    before = listed.size();
    search.remember(scene, {}, true);
  }
  EXPECT_EQ(before, expected.size());
  EXPECT_GT(cuts, 5);
  InsideSearch ended;
  EXPECT_TRUE(ended.run(scene, false, Deadline(Deadline::Clock::now()), stats).empty());
  EXPECT_FALSE(ended.isWhole());
}

// --- in a stream -----------------------------------------------------------------------------------------------------

MeshFrame frameOf(const StepBody& body, int number, bool rigid, double angle) {
  MeshFrame frame;
  frame.stamp_ns = 100000000LL * (number + 1);
  frame.topology = share(body.topology);
  frame.positions = body.t0;
  frame.rigid = rigid;
  frame.pose.linear() = Eigen::AngleAxisd(angle, Vec3::UnitZ()).toRotationMatrix();
  for (Vec3& p : frame.positions) p = frame.pose * p;
  return frame;
}

/// Start states of steps in which a rigid box turns, in parts, around a cloth.
std::vector<StartState> statesOf(const Body& box_setup, const StepBody& solid, double cloth_z) {
  Body cloth;
  cloth.name = "cloth";
  Monitor monitor({}, {cloth, box_setup});
  std::vector<StartState> states;
  for (int i = 0; i < 5; ++i) {
    monitor.push(1, frameOf(solid, i, true, 0.4 * i), 0);
    monitor.push(0, frameOf(clothAt({0.2, 0.1, cloth_z}), i, false, 0), 0);
    for (Outcome outcome; monitor.next(0, outcome);) {
      if (!outcome.answered) continue;
      EXPECT_GT(outcome.substeps, 1u);
      states.push_back(outcome.start_state);
    }
  }
  return states;
}

TEST(Inside, ARigidBodyThatTurnsAroundAClothInAStream) {
  Body finger;
  finger.name = "finger";
  finger.rigid = true;
  finger.self_collision = false;
  const StepBody solid = ball(Vec3::Zero(), 1, 2);
  EXPECT_EQ(statesOf(finger, solid, 0.1), std::vector<StartState>(4, StartState::INTERSECTING));
  EXPECT_EQ(statesOf(finger, solid, 1.0005), std::vector<StartState>(4, StartState::CLEAR));
  finger.shell = true;
  EXPECT_EQ(statesOf(finger, solid, 0.1), std::vector<StartState>(4, StartState::CLEAR));
}

}  // namespace
}  // namespace test
}  // namespace dccd
