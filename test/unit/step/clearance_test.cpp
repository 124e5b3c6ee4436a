// How far apart partners are: small scenes whose distances can be worked out by hand.
#include <gtest/gtest.h>

#include <cmath>

#include "support/closed_meshes.h"
#include "support/looks.h"
#include "support/said.h"
#include "support/shapes.h"
#include "unit/failing_allocations.h"

namespace dccd {
namespace test {
namespace {

Options asking(double max_m = 10) {
  Options options;
  options.clearance.wanted = true;
  options.clearance.max_m = max_m;
  options.clearance.self_m = 0.1;
  return options;
}

/// One triangle in the plane z = 0.
const Topology TRIANGLE = Topology::fromTriangles(3, {{0, 1, 2}});
const Positions FLAT{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};

/// Two triangles, one at rest.
Step twoTriangles(const Vec3& from, const Vec3& to) {
  Step step = stepOf(bodyOf("low", TRIANGLE), FLAT, FLAT);
  step.bodies.push_back(moving(bodyOf("high", TRIANGLE), movedBy(FLAT, from), movedBy(FLAT, to)));
  return step;
}
/// Of which one is `above_m` above the other at t0 and `end_m` at t1.
Step twoTriangles(double above_m, double end_m) { return twoTriangles({0, 0, above_m}, {0, 0, end_m}); }

/// Two bodies at rest.
Step resting(const Body& a, const Positions& at, const Body& b, const Positions& there) {
  Step step = stepOf(a, at, at);
  step.bodies.push_back(moving(b, there, there));
  return step;
}

const Clearance& rowOf(const std::vector<Clearance>& rows, std::uint16_t a, std::uint16_t b) {
  static const Clearance NONE;
  for (const Clearance& row : rows) {
    if (row.body == std::array<std::uint16_t, 2>{a, b}) return row;
  }
  ADD_FAILURE() << "no row of " << a << " and " << b;
  return NONE;
}

void expectMeasured(const ClearanceDistance& d, double truth_m, double wide_m = 1e-4) {
  EXPECT_EQ(d.status, ClearanceStatus::MEASURED) << toString(d.status);
  EXPECT_LE(d.lower_m, truth_m);
  EXPECT_GE(d.upper_m, truth_m);
  EXPECT_LE(d.upper_m - d.lower_m, wide_m);
}

TEST(Clearance, OfTwoTrianglesThatComeNear) {
  const std::vector<Clearance> rows = distance(twoTriangles(2, 0.5), asking());
  ASSERT_EQ(rows.size(), 3u) << "each with itself, and the two";
  const Clearance& row = rowOf(rows, 0, 1);
  expectMeasured(row.at_end, 0.5);
  expectMeasured(row.over_step, 0.5);
  EXPECT_EQ(row.over_step.t, 1);
  EXPECT_NEAR((row.at_end.point[1] - row.at_end.point[0]).z(), 0.5, 1e-4);
  EXPECT_EQ(row.at_end.vertex, (std::array<std::array<Index, 3>, 2>{{{0, 1, 2}, {0, 1, 2}}}));
  EXPECT_EQ(rowOf(rows, 0, 0).at_end.status, ClearanceStatus::FARTHER) << "one triangle has nothing but neighbours";
}

TEST(Clearance, BeyondTheLargestIsOnlyFarther) {
  const Clearance row = rowOf(distance(twoTriangles(2, 1), asking(0.9)), 0, 1);
  for (const ClearanceDistance* d : {&row.at_end, &row.over_step}) {
    EXPECT_EQ(d->status, ClearanceStatus::FARTHER);
    EXPECT_EQ(d->lower_m, 0.9);
    EXPECT_TRUE(std::isinf(d->upper_m));
    EXPECT_FALSE(d->point[0].allFinite());
  }
}

TEST(Clearance, OfWhatTouchesIsNothing) {
  const Clearance through = rowOf(distance(twoTriangles(1, -1), asking()), 0, 1);
  EXPECT_EQ(through.over_step.status, ClearanceStatus::TOUCHING);
  EXPECT_EQ(through.over_step.lower_m, 0);
  EXPECT_EQ(through.over_step.upper_m, 0);
  EXPECT_NEAR(through.over_step.t, 0.5, 1e-6);
  EXPECT_NEAR(through.over_step.point[0].z(), 0, 1e-6);
  expectMeasured(through.at_end, 1);
  const Clearance stays = rowOf(distance(twoTriangles(1, 0), asking()), 0, 1);
  EXPECT_EQ(stays.at_end.status, ClearanceStatus::TOUCHING);
}

TEST(Clearance, IsFromTheSurfaceOfWhatIsInside) {
  const StepBody large = box({-5, -5, -5}, {5, 5, 5}), small = box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5});
  const Outcome outcome = Detector(asking()).run(
      resting(bodyOf("large", large.topology), large.t0, bodyOf("small", small.topology), small.t0));
  ASSERT_EQ(outcome.start_state, StartState::INTERSECTING);
  expectMeasured(rowOf(outcome.clearances, 0, 1).over_step, 4.5);
}

TEST(Clearance, OfABoxAndThreeVoxelsIsFortyCentimetres) {
  // ../shared/cases/README.md: distances of octrees that are metres off elsewhere.
  const StepBody cube = box({9.5, -0.5, -0.5}, {10.5, 0.5, 0.5});
  Step step = stepOf(bodyOf("box", cube.topology), cube.t0, cube.t1);
  step.map.surface = VoxelSurface::build(0.1, {voxelAt(10, 0, 0), voxelAt(90, 0, 0), voxelAt(120, 0, 10)});
  const Clearance row = rowOf(distance(step, asking()), 0, OBSTACLE_BODY);
  expectMeasured(row.at_end, 0.4, 1e-4);
  expectMeasured(row.over_step, 0.4, 1e-4);
  EXPECT_NEAR(row.at_end.point[0].x(), 9.5, 1e-6);
  EXPECT_NEAR(row.at_end.point[1].x(), 9.1, 1e-6);
  EXPECT_EQ(row.at_end.voxel, voxelAt(90, 0, 0).min);
  EXPECT_EQ(row.at_end.voxel_size, 1u);
  Step turned = step;  // the same in a map of another frame
  turned.map.map_from_fixed.linear() = Eigen::AngleAxisd(0.3, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  turned.map.map_from_fixed.translation() = Vec3(4, 5, 6);
  for (auto* positions : {&turned.bodies[0].t0, &turned.bodies[0].t1}) {
    Positions moved = **positions;
    for (Vec3& p : moved) p = turned.map.map_from_fixed.inverse() * p;
    *positions = share(moved);
  }
  const Clearance other = rowOf(distance(turned, asking()), 0, OBSTACLE_BODY);
  EXPECT_EQ(other.over_step.status, ClearanceStatus::MEASURED);
  EXPECT_NEAR(other.over_step.upper_m, 0.4, 1e-4);
  EXPECT_NEAR((other.at_end.point[0] - turned.map.map_from_fixed.inverse() * Vec3(9.5, 0.05, 0.05)).norm(), 0, 0.1);
}

TEST(Clearance, IsNothingInsideOfTheMap) {
  const Positions inside = movedBy(FLAT, {0.2, 0.2, 0.5});
  Step step = stepOf(bodyOf("cloth", TRIANGLE), inside, inside);
  step.map.surface = VoxelSurface::build(1, {{{32768, 32768, 32768}, 4}});
  const Clearance row = rowOf(distance(step, asking()), 0, OBSTACLE_BODY);
  EXPECT_EQ(row.at_end.status, ClearanceStatus::TOUCHING);
  EXPECT_EQ(row.over_step.status, ClearanceStatus::TOUCHING);
}

TEST(Clearance, IsUnknownWhereSomethingWasNotLookedAt) {
  const auto statusOf = [](const Step& step, const Options& options, std::uint16_t a, std::uint16_t b) {
    const Clearance row = rowOf(distance(step, options), a, b);
    EXPECT_EQ(row.at_end.status, row.over_step.status);
    EXPECT_EQ(row.over_step.lower_m, 0);
    return row.over_step.status;
  };
  Step step = twoTriangles(2, 1);
  Positions broken = *step.bodies[1].t1;
  broken[2].x() = std::numeric_limits<double>::quiet_NaN();
  step.bodies[1].t1 = share(broken);
  EXPECT_EQ(statusOf(step, asking(), 0, 1), ClearanceStatus::UNKNOWN) << "a vertex is not finite";
  step = twoTriangles(2, 1);
  step.bodies[0].dropped_faces = 1;
  EXPECT_EQ(statusOf(step, asking(), 0, 1), ClearanceStatus::UNKNOWN) << "a face could not be used";
  step = twoTriangles(2, 1);
  step.bodies[0].vertex_mask = {0, 1, 2};
  EXPECT_EQ(statusOf(step, asking(), 0, 1), ClearanceStatus::UNKNOWN) << "nothing of it is asked about";
  step = twoTriangles(2e200, 1e200);
  EXPECT_EQ(statusOf(step, asking(), 0, 1), ClearanceStatus::UNKNOWN) << "squares overflow";
  step = twoTriangles(2, 1);
  Options options = asking();
  options.obstacle_expected = true;
  EXPECT_EQ(statusOf(step, options, 0, OBSTACLE_BODY), ClearanceStatus::UNKNOWN) << "there is no map";
  step.map.surface = VoxelSurface::build(1, {});
  EXPECT_EQ(rowOf(distance(step, options), 0, OBSTACLE_BODY).over_step.status, ClearanceStatus::FARTHER)
      << "it is empty";
}

/// A strip of 3 x 21 points, folded in the middle around a gap of `gap_m`.
Positions folded(double gap_m) {
  Positions positions;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 21; ++k) {
      const bool upper = k > 10;
      positions.emplace_back(upper ? (20 - k) * 0.1 : k * 0.1, i * 0.1, upper ? gap_m : 0);
    }
  }
  return positions;
}

TEST(Clearance, IsFromEdgesOnNoFaceThatIsLookedAt) {
  const Positions square{{0, -1, 0}, {-1, 0, 0}, {1, 0, 0}, {0, 1, 0}}, tip{{0, 0, 0.25}, {0.1, 0, 1}, {0, 0.1, 1}};
  const Topology square_of_faces = Topology::fromTriangles(4, {{0, 1, 2}, {1, 3, 2}});
  for (const Topology& topology : {square_of_faces, Topology::fromEdges(4, {{1, 2}})}) {
    Body body = bodyOf("body", topology);
    body.vertex_mask = {0, 3};  // its diagonal is left
    const Clearance row = rowOf(distance(resting(body, square, bodyOf("tip", TRIANGLE), tip), asking()), 0, 1);
    expectMeasured(row.at_end, 0.25);
    EXPECT_EQ(row.at_end.vertex[0], (std::array<Index, 3>{1, 2, NO_INDEX}));
  }
}

TEST(Clearance, OfAFoldIsFromLayerToLayer) {
  const Positions flat = gridAt(3, 21, 0.1);
  Body cloth = bodyOf("cloth", Topology::grid(3, 21));
  cloth.reference = share(flat);
  Options options = asking();
  options.clearance.self_m = 0.45;
  expectMeasured(rowOf(distance(stepOf(cloth, folded(0.07), folded(0.05)), options), 0, 0).over_step, 0.05);
  const Clearance open = rowOf(distance(stepOf(cloth, flat, flat), options), 0, 0);
  EXPECT_EQ(open.over_step.status, ClearanceStatus::FARTHER);
  EXPECT_EQ(open.over_step.lower_m, 0.1125) << "a quarter of self_m";
  options.clearance.self_m = 0;
  EXPECT_TRUE(distance(stepOf(cloth, flat, flat), options).empty()) << "nobody asks for it";
}

TEST(Clearance, IsNearerByTheUncertaintyOfVertices) {
  Step step = twoTriangles(2, 0.5);
  step.bodies[1].radius_m = share(std::vector<double>{0, 0.1, 0});
  Options options = asking();
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  const Clearance row = rowOf(distance(step, options), 0, 1);
  EXPECT_EQ(row.over_step.status, ClearanceStatus::MEASURED);
  EXPECT_NEAR(row.over_step.lower_m, 0.4, 1e-4);
  EXPECT_LE(row.over_step.lower_m, 0.4);
  EXPECT_NEAR(row.over_step.upper_m, 0.5, 1e-4);
}

TEST(Clearance, HasNoLowerBoundBesideAContactWithinTheSeparation) {
  Step step = twoTriangles(2, 0.5);
  for (Body& body : step.bodies) body.minimum_separation_m = 0.6;
  Options options = asking();
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  const Clearance row = rowOf(distance(step, options), 0, 1);
  EXPECT_EQ(row.over_step.status, ClearanceStatus::TOUCHING);
  EXPECT_EQ(row.over_step.lower_m, 0);
  EXPECT_NEAR(row.over_step.upper_m, 0.5, 1e-4);
  expectMeasured(row.at_end, 0.5);
}

// A rod of half a metre turns at 3 rad/s, with a frame each fifth of a second: its contacts need no part of the step,
// since it is far by its bounds, and its chord passes the post at 52 mm where the rod itself does at 30 mm.
TEST(Clearance, OfATurningBodyThatIsFarByItsBoundsIsThatOfItsArc) {
  const auto rodAt = [](double angle) { return Eigen::Isometry3d(Eigen::AngleAxisd(angle, Vec3::UnitZ())); };
  const auto passing = [&](double angle, double post_m) {
    const Positions rod{{0, 0, 0}, {0.5, 0, 0}, {0.5, 0, 0.01}};
    Body turning = bodyOf("rod", TRIANGLE);
    turning.rigid = turning.turns = true;
    turning.pose_t0 = rodAt(-angle / 2);
    turning.pose_t1 = rodAt(angle / 2);
    Positions from, to;
    for (const Vec3& p : rod) {
      from.push_back(turning.pose_t0 * p);
      to.push_back(turning.pose_t1 * p);
    }
    Step step = stepOf(turning, from, to);
    step.bodies.push_back(
        moving(bodyOf("post", TRIANGLE), movedBy(FLAT, {post_m, 0, 0}), movedBy(FLAT, {post_m, 0, 0})));
    return step;
  };
  for (const double angle : {0.6, 1.2}) {  // the latter: 12 rad/s at 10 Hz
    const Outcome outcome = Detector(asking()).run(passing(angle, 0.53));
    ASSERT_EQ(outcome.substeps, 1u) << "else it shows nothing";
    const ClearanceDistance over_step = rowOf(outcome.clearances, 0, 1).over_step;
    EXPECT_EQ(over_step.status, ClearanceStatus::MEASURED);
    EXPECT_LE(over_step.lower_m, 0.03);
    EXPECT_GE(over_step.upper_m, 0.03);
    EXPECT_LE(over_step.upper_m - over_step.lower_m, 1e-4 + 4 * Options().rigid_tolerance_m);
    EXPECT_NEAR(over_step.t, 0.5, 0.2);
    EXPECT_GT(rowOf(outcome.clearances, 0, 1).at_end.lower_m, over_step.upper_m);
  }
  // Where parts are not allowed it is only a bound, and FARTHER holds on the arc, too.
  Options one_part = asking();
  one_part.max_substeps = 1;
  const ClearanceDistance bound = rowOf(distance(passing(0.6, 0.53), one_part), 0, 1).over_step;
  EXPECT_EQ(bound.status, ClearanceStatus::LOWER);
  EXPECT_LE(bound.lower_m, 0.03);
  EXPECT_GE(bound.upper_m, 0.03);
  EXPECT_EQ(rowOf(distance(passing(0.6, 0.53), asking(0.04)), 0, 1).over_step.status, ClearanceStatus::MEASURED);
  EXPECT_EQ(rowOf(distance(passing(0.6, 0.53), asking(0.02)), 0, 1).over_step.status, ClearanceStatus::FARTHER);
}

TEST(Clearance, NamesWhatIsExpected) {
  Options options = asking();
  options.expected.push_back({{ExpectedPartner{1, {}, ""}, ExpectedPartner{0, {}, ""}}, ""});
  EXPECT_TRUE(rowOf(distance(twoTriangles(2, 1), options), 0, 1).expected);
  EXPECT_FALSE(rowOf(distance(twoTriangles(2, 1), options), 0, 0).expected);
  options.expected[0].partners[0].vertices = {0};
  EXPECT_FALSE(rowOf(distance(twoTriangles(2, 1), options), 0, 1).expected) << "of one vertex alone";
}

TEST(Clearance, IsAskedOfThoseThatMeet) {
  Step step = twoTriangles(2, 1);
  step.bodies[0].not_against = {1};
  step.bodies[1].rigid = true;
  EXPECT_EQ(distance(step, asking()).size(), 1u) << "the first one with itself";
  EXPECT_TRUE(Detector().run(step).clearances.empty()) << "nobody asks";
}

bool sameBits(const Clearance& x, const Clearance& y) {
  const auto same = [](const ClearanceDistance& a, const ClearanceDistance& b) {
    bool points = true;
    for (int side = 0; side < 2; ++side) {
      for (int k = 0; k < 3; ++k) {
        const double p = a.point[side][k], q = b.point[side][k];
        points = points && (p == q || (std::isnan(p) && std::isnan(q)));
      }
    }
    return points && a.status == b.status && a.lower_m == b.lower_m && a.upper_m == b.upper_m && a.t == b.t &&
           a.vertex == b.vertex && a.voxel == b.voxel && a.voxel_size == b.voxel_size;
  };
  return x.body == y.body && same(x.at_end, y.at_end) && same(x.over_step, y.over_step);
}

void expectSame(const std::vector<Clearance>& x, const std::vector<Clearance>& y, const std::string& what) {
  ASSERT_EQ(x.size(), y.size()) << what;
  for (std::size_t i = 0; i < x.size(); ++i) EXPECT_TRUE(sameBits(x[i], y[i])) << what << ", row " << i;
}

/// 48 triangles in a row, about 1 m from one to the next, that go their ways; one turns, in several parts of the step,
/// past the next, and of one nothing is known.
Step manyBodies() {
  Step step;
  for (int i = 0; i < 48; ++i) {
    const Vec3 from(2 * i + 0.35 * (i * 7 % 5), 0, 0), to(2 * i + 0.35 * (i * 3 % 5), 0, 0);
    Body body = moving(bodyOf("one", TRIANGLE), movedBy(FLAT, from), movedBy(FLAT, to));
    body.name += std::to_string(i);
    body.self_collision = i % 2 == 0;
    step.bodies.push_back(body);
  }
  step.bodies[20].dropped_faces = 1;
  Body& turning = step.bodies[30];
  turning.rigid = turning.turns = true;
  turning.pose_t1.linear() = Eigen::AngleAxisd(M_PI, Vec3::UnitZ()).toRotationMatrix();
  turning.pose_t0.translation() = turning.pose_t1.translation() = Vec3(60, 0, 0);
  Positions from, to;
  for (const Vec3& p : FLAT) {
    from.push_back(turning.pose_t0 * p);
    to.push_back(turning.pose_t1 * p);
  }
  turning.t0 = share(from);
  turning.t1 = share(to);
  return step;
}

/// A wavy cloth above another one and a table of voxels.
Step wavySheets(double phase) {
  Step step;
  const Topology grid = Topology::grid(20, 30);
  for (int b = 0; b < 2; ++b) {
    Positions t0, t1;
    for (int i = 0; i < 600; ++i) {
      const double x = i % 30 * 0.05, y = i / 30 * 0.05;
      const auto at = [&](double p) {
        return Vec3(x, y, 0.3 * (b + 1) + 0.05 * std::sin(7 * x + 5 * y * (b + 1) + p));
      };
      t0.push_back(at(phase));
      t1.push_back(at(phase + 0.2));
    }
    step.bodies.push_back(moving(bodyOf(b ? "upper" : "lower", grid), t0, t1));
  }
  step.map.surface = VoxelSurface::build(0.05, voxelsOfBox({0, 0, -1}, {30, 20, 0}));
  return step;
}

TEST(Clearance, IsTheSameBitsWhateverComputesIt) {
  const Step before = wavySheets(0), step = wavySheets(0.2);
  const std::vector<Clearance> plain = distance(step, asking());
  forEachSimdTarget([&](const std::string& target) { expectSame(distance(step, asking()), plain, target); });
  Options threads = asking();
  threads.num_threads = 4;
  expectSame(distance(step, threads), plain, "four threads");
  Detector detector(asking());
  detector.run(before);
  const Outcome carried = detector.run(step);
  // Without a reference frame a body's is where it was first.
  for (std::size_t i = 0; i < plain.size(); ++i) {
    const bool itself = plain[i].body[0] == plain[i].body[1];
    EXPECT_TRUE(itself || sameBits(plain[i], carried.clearances[i])) << "row " << i;
  }
}

struct Asked {
  Step step;
  Options options;
};

/// `last`, after `before` and an attempt at `failing` in which one allocation after the other fails, is answered as
/// ever.
void expectNothingHalfDone(const Asked& before, const Asked& failing, const Asked& last) {
  const std::vector<Clearance> expected = distance(last.step, last.options);
  const int allocations = failingEverywhere([&](int n) {
    History history;
    detect(before.step, before.options, history);
    const bool met = failsAt(n, false, [&] { detect(failing.step, failing.options, history); });
    expectSame(detect(last.step, last.options, history).clearances, expected, "later");
    return met;
  });
  EXPECT_GE(allocations, 10);
}

TEST(Clearance, IsTheSameAfterAllocationsThatFailed) {
  Asked fold{stepOf(bodyOf("cloth", Topology::grid(3, 21)), folded(0.07), folded(0.05)), asking()};
  fold.options.clearance.self_m = 0.45;
  Asked all_neighbours = fold;
  all_neighbours.options.clearance.self_m = 5;
  expectNothingHalfDone(fold, all_neighbours, fold);
  Asked far{stepOf(bodyOf("cloth", TRIANGLE), FLAT, FLAT), asking()}, near = far;
  far.step.map.surface = VoxelSurface::build(0.1, {{{32768, 32768, 32868}, 1}});
  near.step.map.surface = VoxelSurface::build(0.1, {{{32768, 32768, 32788}, 1}, {{40000, 32768, 32788}, 1}});
  expectNothingHalfDone(far, near, near);
}

/// A sheet that bends a little more in each step until its ends meet, and opens again: what is known of the steps
/// before changes no answer.
TEST(Clearance, OfABodyAndItselfIsTheSameWithoutTheStepsBefore) {
  const Positions flat = gridAt(3, 41, 0.05);
  Body cloth = bodyOf("cloth", Topology::grid(3, 41));
  cloth.reference = share(flat);
  const auto bent = [&](double angle) {  // about the strip's middle, with the sheet's own length
    Positions positions;
    for (const Vec3& p : flat) {
      const double s = p.x() - 1, radius = 2 / std::max(angle, 1e-3);
      positions.emplace_back(radius * std::sin(s / radius) + 5 * angle, p.y(), radius * (1 - std::cos(s / radius)));
    }
    return positions;
  };
  Options options = asking();
  options.clearance.self_m = 0.8;
  Detector detector(options);
  std::array<int, 5> statuses{};
  for (int k = 0; k < 160; ++k) {
    const auto angle = [](int i) { return 0.04 + 6.2 * (1 - std::abs(i - 80) / 80.0); };
    const Step step = stepOf(cloth, bent(angle(k)), bent(angle(k + 1)));
    const Clearance carried = rowOf(detector.run(step).clearances, 0, 0), alone = rowOf(distance(step, options), 0, 0);
    EXPECT_TRUE(sameBits(carried, alone)) << "step " << k;
    ++statuses[static_cast<std::size_t>(alone.over_step.status)];
  }
  EXPECT_GT(statuses[static_cast<std::size_t>(ClearanceStatus::FARTHER)], 80);
  EXPECT_GT(statuses[static_cast<std::size_t>(ClearanceStatus::MEASURED)], 2);
}

/// Two rods across each other, 1 cm apart, that are tilted together: at each time their normal is another one.
TEST(Clearance, OfEdgesThatTurnIsAsNarrowAsItIsAskedFor) {
  const Topology rod = Topology::polyline(2);
  const auto tilted = [](const Positions& rod, double angle) {
    Positions turned;
    for (const Vec3& p : rod) turned.push_back(Eigen::AngleAxisd(angle, Vec3::UnitY()) * p);
    return turned;
  };
  const Positions above{{-1, 0, 0.01}, {1, 0, 0.01}}, below{{0, -1, 0}, {0, 1, 0}};
  Step step = stepOf(bodyOf("above", rod), tilted(above, 0), tilted(above, 0.5));
  step.bodies.push_back(moving(bodyOf("below", rod), tilted(below, 0), tilted(below, 0.5)));
  Options options = asking();
  options.clearance.tolerance_m = 1e-6;
  const ClearanceDistance over_step = rowOf(distance(step, options), 0, 1).over_step;
  EXPECT_EQ(over_step.status, ClearanceStatus::MEASURED);
  EXPECT_LE(over_step.upper_m - over_step.lower_m, 1e-6);
  EXPECT_NEAR(over_step.upper_m, 0.01 * std::cos(0.25), 1e-6) << "half way, of the chord's middle";
}

TEST(Clearance, IsStillBoundedWhereTheTimeRanOut) {
  const Step step = wavySheets(0);
  const std::vector<Clearance> whole = distance(step, asking());
  int cut = 0, done = 0;
  for (int looks = 0; looks < 4000; looks = looks * 5 / 4 + 1) {
    const Outcome outcome = runFor(looks, step, asking());
    ASSERT_EQ(outcome.clearances.size(), whole.size());
    for (std::size_t i = 0; i < whole.size(); ++i) {
      for (const auto member : {&Clearance::at_end, &Clearance::over_step}) {
        const ClearanceDistance &some = outcome.clearances[i].*member, &all = whole[i].*member;
        EXPECT_LE(some.lower_m, all.upper_m) << looks << " looks";
        EXPECT_GE(some.upper_m, all.lower_m) << looks << " looks";
        ++(some.status == ClearanceStatus::LOWER ? cut : done);
      }
    }
  }
  EXPECT_GT(cut, 10);
  EXPECT_GT(done, 10);
}

TEST(Clearance, OfManyBodiesOnlyTheFirstThatIsFarHasARow) {
  Step step = manyBodies();
  Options options = asking(0.9);
  options.rigid_tolerance_m = 1e-3;
  options.expected.push_back({{ExpectedPartner{3, {}, ""}, ExpectedPartner{40, {}, ""}}, ""});
  const Outcome outcome = Detector(options).run(step);
  ASSERT_GT(outcome.substeps, 1u);
  EXPECT_EQ(outcome.stats[Effect::CLEARANCE].in, 48u * 47 / 2 + 24 - 1) << "one that could meet itself is rigid";
  EXPECT_LT(outcome.clearances.size(), 250u);
  expectSame(distance(step, options), outcome.clearances, "distance()");
  // Each two for themselves.
  std::size_t rows = 0, farther = 0, statuses[5] = {};
  for (std::uint16_t a = 0; a < step.bodies.size(); ++a) {
    for (std::uint16_t b = a + 1; b < step.bodies.size(); ++b) {
      Step two = step;
      two.bodies = {step.bodies[a], step.bodies[b]};
      options.expected.clear();
      options.max_substeps = outcome.substeps;
      Clearance alone = rowOf(distance(two, options), 0, 1);
      alone.body = {a, b};
      const auto row = std::find_if(outcome.clearances.begin(), outcome.clearances.end(),
                                    [&](const Clearance& r) { return r.body == alone.body; });
      ++statuses[static_cast<std::size_t>(alone.over_step.status)];
      if (row == outcome.clearances.end()) {
        EXPECT_EQ(alone.over_step.status, ClearanceStatus::FARTHER) << a << " and " << b;
        EXPECT_EQ(alone.over_step.lower_m, 0.9);
        continue;
      }
      ++rows;
      EXPECT_EQ(row->over_step.status, alone.over_step.status) << a << " and " << b;
      EXPECT_EQ(row->at_end.status, alone.at_end.status) << a << " and " << b;
      EXPECT_NEAR(row->over_step.lower_m, alone.over_step.lower_m, 2e-3) << a << " and " << b;
      farther += row->over_step.status == ClearanceStatus::FARTHER && !row->expected;
    }
  }
  EXPECT_EQ(rows + 23, outcome.clearances.size());
  EXPECT_EQ(farther, 1u) << "it stands for the others";
  EXPECT_TRUE(rowOf(outcome.clearances, 3, 40).expected);
  EXPECT_EQ(statuses[static_cast<std::size_t>(ClearanceStatus::UNKNOWN)], 46u) << "of 47 pairs one certainly touches";
  EXPECT_GT(statuses[static_cast<std::size_t>(ClearanceStatus::MEASURED)], 15u);
  EXPECT_GT(statuses[static_cast<std::size_t>(ClearanceStatus::TOUCHING)], 5u);
}

TEST(Clearance, OfManyBodiesNoneIsSilentlyFarWhereTheTimeRanOut) {
  const Step step = manyBodies();
  Options options = asking(0.9);
  options.rigid_tolerance_m = 1e-3;
  const std::vector<Clearance> whole = distance(step, options);
  bool cut = false;
  for (int looks = 0; looks < 4000; looks = looks * 2 + 1) {
    const Outcome outcome = runFor(looks, step, options);
    for (const Clearance& row : whole) {
      if (row.over_step.status == ClearanceStatus::FARTHER) continue;
      const Clearance& some = rowOf(outcome.clearances, row.body[0], row.body[1]);
      EXPECT_LE(some.over_step.lower_m, row.over_step.upper_m) << looks << " looks";
      cut = cut || some.over_step.status == ClearanceStatus::LOWER;
    }
  }
  EXPECT_TRUE(cut);
}

TEST(Clearance, RefusesNumbersThatMeanNothing) {
  const auto refusal = [](double ClearanceOptions::*field, double value) {
    Options options = asking();
    options.clearance.*field = value;
    return said<std::invalid_argument>([&] { check(options); }, "nothing");
  };
  EXPECT_EQ(refusal(&ClearanceOptions::max_m, 0), "clearance.max_m = 0.000000 is out of range; above 0, to 1e9");
  EXPECT_EQ(refusal(&ClearanceOptions::self_m, std::nan("")),
            "clearance.self_m = nan is out of range; 0 (none) to 1e9");
  EXPECT_EQ(refusal(&ClearanceOptions::self_m, 0), "nothing");
  EXPECT_NE(refusal(&ClearanceOptions::tolerance_m, -1), "nothing");
  EXPECT_NE(refusal(&ClearanceOptions::tolerance_m, INFINITY), "nothing");
  EXPECT_EQ(refusal(&ClearanceOptions::max_m, 0.5), "nothing");
}

}  // namespace
}  // namespace test
}  // namespace dccd
