// Distances of hard pairs and hard steps, judged by rational arithmetic: lower <= truth <= upper, and as narrow as was
// asked for. Seeds are fixed; DEFORMABLE_CCD_LONG=1 runs 1e6 pairs, 2e5 needles and 3e4 steps.
#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <iostream>
#include <limits>

#include "step/clearance/hull_pair.h"
#include "step/clearance/step_box.h"
#include "step/parts.h"
#include "support/clearance_truth.h"
#include "support/closed_meshes.h"
#include "support/generators.h"
#include "support/query_property.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

MovingHull hullOf(const TrueHull& corners) {
  MovingHull hull;
  for (const auto& corner : corners) hull.addCorner(corner[0], corner[1]);
  return hull;
}

/// Some corners of a hard pair's features.
TrueHull corners(const Query& query, std::size_t first, std::size_t count) {
  TrueHull hull;
  for (std::size_t i = first; i < first + count; ++i) {
    const auto at = [&](int end) {
      return Vec3(query.motion.x[end][i][0], query.motion.x[end][i][1], query.motion.x[end][i][2]);
    };
    hull.push_back({at(0), at(1)});
  }
  return hull;
}

TrueHull boxAround(const Vec3& one, const Vec3& other) {
  TrueHull hull;
  for (int i = 0; i < 8; ++i) {
    Vec3 corner;
    for (int k = 0; k < 3; ++k) corner[k] = i >> k & 1 ? std::max(one[k], other[k]) : std::min(one[k], other[k]);
    hull.push_back({corner, corner});
  }
  return hull;
}

/// Two features, faces of two hard pairs, or a feature and a box.
std::array<TrueHull, 2> hardHulls(RandomSource& random, const Draw& draw) {
  const Hardness hardness = static_cast<Hardness>(draw(0, static_cast<int>(Hardness::MIXED_15)));
  const Query vf = hardQuery(random, PairKind::VERTEX_FACE, hardness);
  const Query other = hardQuery(random, PairKind::VERTEX_FACE, hardness);
  switch (draw(0, 7)) {
    case 0:
      return {corners(vf, 0, 1), corners(vf, 1, 3)};
    case 1: {
      const Query ee = hardQuery(random, PairKind::EDGE_EDGE, hardness);
      return {corners(ee, 0, 2), corners(ee, 2, 2)};
    }
    case 2:
      return {corners(vf, 0, 2), corners(other, 1, 3)};
    case 3:
      return {corners(vf, static_cast<std::size_t>(draw(0, 3)), 1),
              corners(other, static_cast<std::size_t>(draw(0, 3)), 1)};
    case 4: {
      const TrueHull box = corners(other, 0, 2);
      return {corners(vf, 1, static_cast<std::size_t>(draw(1, 3))), boxAround(box[0][0], box[1][0])};
    }
    default:
      return {corners(vf, 1, 3), corners(other, 1, 3)};
  }
}

double largestOf(const std::array<TrueHull, 2>& hulls) {
  double largest = 0;
  for (const TrueHull& hull : hulls) {
    for (const auto& corner : hull) {
      for (const Vec3& x : corner) largest = std::max(largest, (x - hulls[0][0][0]).cwiseAbs().maxCoeff());
    }
  }
  return largest;
}

/// What at() says of a pair at a time must hold the truth; returned is by how many of `wide_m` the two bounds differ.
double widthOf(const std::array<TrueHull, 2>& hulls, HullPair& pair, double t, double wide_m, Nearest& nearest) {
  pair.set(hullOf(hulls[0]), hullOf(hulls[1]));
  nearest = pair.at(t, wide_m);
  const double lower_m = pair.lowerInMetres(nearest.lower), upper_m = pair.upperInMetres(nearest.upper);
  const Rational truth = trueSquaredDistance(hulls[0], hulls[1], t), lower(lower_m), upper(upper_m);
  EXPECT_LE(lower * lower, truth) << "lower_m " << lower_m << " is above the truth";
  EXPECT_GE(upper * upper, truth) << "upper_m " << upper_m << " is below the truth, of " << hulls[0].size() << " and "
                                  << hulls[1].size() << " corners";
  return (upper_m - lower_m) / std::max(wide_m, 1e-288);
}

/// Three corners all but in a line, which goes through a point.
TrueHull needle(const Draw& draw, const Vec3& through) {
  const Vec3 along(draw(-9, 9), draw(-9, 9), draw(1, 9));
  const double share = draw(1, 15) / 16.0, length_m = std::ldexp(1.0, -draw(0, 30)),
               thin = std::ldexp(1.0, -draw(24, 54));
  TrueHull hull;
  for (const double at : {0.0, draw(0, 16) / 16.0, 1.0}) {
    const Vec3 off(draw(-9, 9), draw(-9, 9), draw(-9, 9));
    const Vec3 corner = through + length_m * ((at - share) * along + thin * off);
    hull.push_back({corner, corner});
  }
  return hull;
}

// A needle through another one, or through a box, or close by.
TEST(ClearanceProperty, OfNeedlesIsAsNarrow) {
  const int pairs = longRun() ? 200000 : 2000;
  const Draw draw = drawFrom(20170601);
  for (int i = 0; i < pairs; ++i) {
    const Vec3 place(draw(-9, 9), draw(-9, 9), draw(-9, 9)), by(draw(-9, 9), draw(-9, 9), draw(-9, 9));
    const Vec3 apart = std::ldexp(1.0, -draw(20, 54)) * by;
    std::array<TrueHull, 2> hulls{needle(draw, place), needle(draw, place + apart)};
    if (draw(0, 1) == 0) hulls[1] = boxAround(hulls[1][0][0], hulls[1][2][0]);
    HullPair pair;
    Nearest nearest;
    ASSERT_LE(widthOf(hulls, pair, 0, 1e-9 * largestOf(hulls), nearest), 1) << "pair " << i;
    ASSERT_FALSE(HasFailure()) << "pair " << i;
  }
}

// An edge or a triangle so small that products of its sides have no digits left, beside a large triangle.
TEST(ClearanceProperty, OfWhatIsTooSmallForItsSquareHoldsTheTruth) {
  RandomSource random(20261203);
  const auto real = [&](double lo, double hi) { return std::uniform_real_distribution<double>(lo, hi)(random); };
  const auto vector = [&] { return Vec3(real(-1, 1), real(-1, 1), real(-1, 1)); };
  for (int i = 0; i < 6000; ++i) {
    const double far = std::pow(10, real(-9, -3)), size = std::pow(10, i % 2 == 0 ? real(-163, -160) : real(-100, -80));
    const Eigen::Quaterniond turn(Eigen::AngleAxisd(real(-3, 3), vector().normalized()));
    std::array<TrueHull, 2> hulls;
    for (const Vec3& corner : {Vec3(0, 1, 0), Vec3(2 * far, -real(0.5, 1), 0), Vec3(0, 2, 0)}) {
      hulls[1].push_back({turn * corner, turn * corner});
    }
    hulls[0].push_back({Vec3::Zero(), Vec3::Zero()});
    while (hulls[0].size() < (i % 4 == 0 ? 2u : 3u)) {
      const Vec3 corner = size * vector();
      hulls[0].push_back({corner, corner});
    }
    HullPair pair;
    Nearest nearest;
    widthOf(hulls, pair, 0, 1e-15, nearest);
    EXPECT_LE(nearest.direction.norm(), 1 + 1e-14);
    ASSERT_FALSE(HasFailure()) << "pair " << i;
  }
}

TEST(ClearanceProperty, OfBoxesWhoseGapHasNoSquareIsNotRoundedUp) {
  for (int i = 0; i <= 600; ++i) {
    const double gap = std::pow(10, -164 + i / 50.0);
    const Vec3 one = Vec3::Zero(), other(gap, 0, 0);
    EXPECT_LE(apartByBoxes(StepBox::still(one.data(), one.data()), StepBox::still(other.data(), other.data())), gap);
  }
}

TEST(ClearanceProperty, PairsHoldTheTruth) {
  const int pairs = longRun() ? 1000000 : 10000;
  RandomSource random(propertySeed());
  const Draw draw = drawFrom(propertySeed() + 1);
  int positive = 0, zero = 0, wider = 0;
  for (int i = 0; i < pairs; ++i) {
    const std::array<TrueHull, 2> hulls = hardHulls(random, draw);
    const double t = draw(0, 3) == 0 ? draw(0, 1) : draw(0, 64) / 64.0, largest_m = largestOf(hulls);
    HullPair pair;
    Nearest nearest;
    const double wide_m = 1e-9 * largest_m, width = widthOf(hulls, pair, t, wide_m, nearest);
    ASSERT_FALSE(HasFailure()) << "pair " << i;
    // Of needles as thin as rounding the search misses the best points by so much now and then.
    ASSERT_LE(width, 2) << "pair " << i << ", size " << largest_m;
    wider += width > 1;
    // The directions of two times, or one of them twice, bound the distance at all times between two others, too.
    const double from = draw(0, 63) / 64.0, to = draw(static_cast<int>(64 * from) + 1, 64) / 64.0;
    const Vec3 at_end = draw(0, 3) == 0 ? nearest.direction : pair.at(to, wide_m).direction;
    const Rational also(std::max(0.0, pair.lowerInMetres(pair.lowerOver({nearest.direction, at_end}, from, to))));
    const double between = from + (to - from) * draw(0, 8) / 8;
    ASSERT_LE(also * also, trueSquaredDistance(hulls[0], hulls[1], between)) << "pair " << i << " at " << between;
    ++(nearest.lower > 0 ? positive : zero);
  }
  std::cout << pairs << " pairs, " << zero << " of them may meet, " << wider << " are wider than was asked for\n";
  EXPECT_GT(positive, pairs / 2);
  EXPECT_GT(zero, pairs / 100);
  EXPECT_LE(wider, pairs / 100000);
}

/// A body of some triangles that turns about an axis, whose foot goes straight, and where it truly is.
struct Turning {
  Topology topology;
  Positions start;
  Vec3 foot, shift, axis;
  double angle = 0;

  Turning(const Draw& draw, double size_m, const Vec3& at)
      : topology(Topology::fromTriangles(6, {{0, 1, 2}, {3, 4, 5}})) {
    const auto vector = [&](double length_m) {
      return Vec3(Vec3(draw(-9, 9), draw(-9, 9), draw(-9, 9)) * (length_m / 9));
    };
    foot = at + (draw(0, 2) == 0 ? vector(size_m) : Vec3(Vec3::Zero()));
    // Rods and blades as well as what is as thick as it is long.
    const Vec3 thick(1, std::ldexp(1.0, -draw(0, 6)), std::ldexp(1.0, -draw(0, 6)));
    for (int v = 0; v < 6; ++v) start.push_back(at + vector(size_m).cwiseProduct(thick));
    shift = draw(0, 1) == 0 ? vector(size_m / 4) : Vec3(Vec3::Zero());
    axis = (vector(1) + Vec3(0.01, 0, 0)).normalized();
    angle = draw(0, 4) == 0 ? 0 : 3.1 * draw(1, 100) / 100;
  }
  Vec3 placed(const Vec3& p, double u) const {
    const Vec3 arm = p - foot;  // Rodrigues' formula
    const double s = std::sin(u * angle), c = std::cos(u * angle);
    return foot + u * shift + c * arm + s * axis.cross(arm) + (1 - c) * axis.dot(arm) * axis;
  }
  Body body(const std::string& name) const {
    Body body;
    body.name = name;
    body.rigid = true;
    body.topology = share(topology);
    body.turns = angle != 0;
    const Eigen::Quaterniond frame(Eigen::AngleAxisd(1.1, Vec3(3, -1, 2).normalized()));
    body.pose_t0 = Eigen::Translation3d(foot) * frame;
    body.pose_t1 = Eigen::Translation3d(foot + shift) * Eigen::AngleAxisd(angle, axis) * frame;
    Positions end;
    for (const Vec3& p : start) end.push_back(placed(p, 1));
    body.t0 = share(start);
    body.t1 = share(end);
    return body;
  }
  std::vector<TrueHull> features(double u) const {
    std::vector<TrueHull> hulls;
    for (const Face& f : topology.faces()) {
      TrueHull hull;
      for (const Index v : f) hull.push_back({placed(start[v], u), placed(start[v], u)});
      hulls.push_back(hull);
    }
    return hulls;
  }
  double longestWay() const {
    double arm_m = 0;
    for (const Vec3& p : start) arm_m = std::max(arm_m, (p - foot).norm());
    return shift.norm() + angle * arm_m;
  }
};

/// The least distance at `times` + 1 times of the step, where all is on its true way.
double leastOnTheWay(const Turning& a, const std::function<std::vector<TrueHull>(double)>& other, int times) {
  double least_m = std::numeric_limits<double>::infinity();
  for (int k = 0; k <= times; ++k) {
    const double u = static_cast<double>(k) / times;
    const auto others = other(u);
    for (const TrueHull& x : a.features(u)) {
      for (const TrueHull& y : others) least_m = std::min(least_m, roughDistance(x, y, 0));
    }
  }
  return least_m;
}

// Bodies of all sizes, near and far, turn by up to half a turn in a step. What is told holds on the arc, not on its
// chords, also where contacts need no part of the step because the bodies are far by their bounds.
TEST(ClearanceProperty, OfTurningBodiesHoldsOnTheArc) {
  const int steps = longRun() ? 20000 : 400, times = longRun() ? 256 : 64;
  int uncut = 0, coarse = 0;
  std::array<int, 5> by_status{};
  for (int seed = 0; seed < steps; ++seed) {
    const Draw draw = drawFrom(7100 + static_cast<std::uint64_t>(seed));
    const double size_m = std::ldexp(1.0, draw(-6, 1)), apart_m = size_m * std::ldexp(1.0, draw(-3, 2));
    const Turning one(draw, size_m, Vec3::Zero());
    const Vec3 beside(1, 0.1 * draw(-9, 9), 0.1 * draw(-9, 9));
    const Turning other(draw, size_m * std::ldexp(1.0, draw(-3, 1)), (size_m + apart_m) * beside);
    Step step;
    step.bodies = {one.body("one"), other.body("other")};
    if (draw(0, 2) == 0) {
      step.map.surface = VoxelSurface::build(std::ldexp(1.0, draw(-4, 0)), {{{32768, 32768, 32760}, 1}});
      step.map.stamp_ns = 1;
    }
    Options options;
    options.rigid_tolerance_m = std::ldexp(1.0, draw(-14, -6));
    if (draw(0, 3) == 0) options.max_substeps = static_cast<std::size_t>(draw(1, 4));
    options.clearance.wanted = true;
    options.clearance.max_m = std::ldexp(1.0, draw(-4, 4));
    options.clearance.tolerance_m = std::ldexp(1.0, draw(-16, -8));
    History history;
    const Outcome outcome = detect(step, options, history);
    double needed = 1;
    for (const Body& body : step.bodies) {
      if (body.turns) needed = std::max(needed, partsFor(body, 1, options.rigid_tolerance_m));
    }
    uncut += needed > static_cast<double>(outcome.substeps) && options.max_substeps == 64;
    coarse += needed > static_cast<double>(options.max_substeps);
    for (const Clearance& row : outcome.clearances) {
      const ClearanceDistance& d = row.over_step;
      ++by_status[static_cast<std::size_t>(d.status)];
      if (d.status == ClearanceStatus::TOUCHING) continue;
      const bool on_map = row.body[1] == OBSTACLE_BODY;
      const Turning& first = row.body[0] == 0 ? one : other;
      const auto second = [&](double u) {
        if (!on_map) return other.features(u);
        std::vector<TrueHull> boxes;
        for (auto& leaf : trueFeatures(step, OBSTACLE_BODY)) boxes.push_back(leaf.second);
        return boxes;
      };
      const double least_m = leastOnTheWay(first, second, times);
      const double between_m = (first.longestWay() + (on_map ? 0 : other.longestWay())) / (2 * times);
      const double rounding_m = 1e-12 * (size_m + apart_m);  // of this test's own
      ASSERT_NE(d.status, ClearanceStatus::UNKNOWN) << seed;
      ASSERT_LE(d.lower_m, least_m + rounding_m) << "seed " << seed << ", " << toString(d.status);
      ASSERT_GE(d.upper_m, least_m - between_m - rounding_m) << "seed " << seed;
      ASSERT_GE(row.at_end.upper_m, d.lower_m) << "seed " << seed;
      if (d.status == ClearanceStatus::FARTHER) continue;
      const bool fine = needed <= static_cast<double>(options.max_substeps);
      if (fine) ASSERT_EQ(d.status, ClearanceStatus::MEASURED) << "seed " << seed;
      if (fine) ASSERT_LE(d.upper_m - d.lower_m, options.clearance.tolerance_m + 4.001 * options.rigid_tolerance_m);
    }
  }
  std::cout << steps << " steps; " << uncut << " are not cut for contacts, " << coarse << " cannot be cut enough\n";
  for (const int count : {by_status[0], by_status[1], uncut, coarse}) EXPECT_GT(count, steps / 40);
}

/// A sheet in the plane z = above_m, rippled.
Positions rippled(const Draw& draw, int side, double above_m, double ripple_m) {
  Positions sheet;
  for (int i = 0; i < side * side; ++i) {
    sheet.emplace_back(i % side - side / 2, i / side - side / 2, above_m + ripple_m * 0.01 * draw(-100, 100));
  }
  return sheet;
}

Positions after(const Eigen::Isometry3d& motion, Positions positions) {
  for (Vec3& p : positions) p = motion * p;
  return positions;
}

// Sheets that face each other, somewhere askew; one turns. Nearly all of their features are nearly as
// near as the nearest, so that a plane between the two decides, and boxes along it.
TEST(ClearanceProperty, OfSheetsThatFaceEachOtherHoldsTheTruth) {
  const int steps = longRun() ? 200 : 12;
  for (int seed = 0; seed < steps; ++seed) {
    const Draw draw = drawFrom(8800 + static_cast<std::uint64_t>(seed));
    const auto anywhere = [&] { return Vec3(draw(-9, 9), draw(-9, 9), 10); };
    const Eigen::Isometry3d askew =
        Eigen::Translation3d(anywhere()) * Eigen::AngleAxisd(0.3 * draw(0, 9), anywhere().normalized());
    const double apart_m = std::ldexp(1.0, draw(-3, 2)), ripple_m = apart_m * std::ldexp(1.0, draw(-12, -2));
    const int side = draw(8, 12);
    const Topology grid = Topology::grid(static_cast<std::size_t>(side), static_cast<std::size_t>(side));
    const Positions low = rippled(draw, side, 0, ripple_m), high = rippled(draw, side, apart_m, ripple_m);
    // At one end of the step one side is the nearest, at the other end another one.
    const Eigen::AngleAxisd turn(0.1 * apart_m / side * draw(-9, 9), Vec3(draw(-9, 9), draw(-9, 9), 0.1).normalized());
    const Eigen::Isometry3d start = askew * turn.inverse(), end = askew * turn;
    Step step = stepOf(bodyOf("low", grid), after(start, low), after(end, low));
    step.bodies.push_back(moving(bodyOf("high", grid), after(askew, high), after(draw(0, 1) == 0 ? end : askew, high)));
    Options options;
    options.clearance.wanted = true;
    options.clearance.max_m = 8;
    options.clearance.self_m = 0;
    options.clearance.tolerance_m = std::ldexp(1.0, draw(-16, -10));
    History history;
    const Outcome outcome = detect(step, options, history);
    ASSERT_EQ(outcome.clearances.size(), 1u);
    const ClearanceDistance &last = outcome.clearances[0].at_end, &all = outcome.clearances[0].over_step;
    const auto features = trueFeatures(step, 0), others = trueFeatures(step, 1);
    const auto leastAt = [&](double t) {
      double least_m = std::numeric_limits<double>::infinity();
      for (const auto& one : features) {
        for (const auto& other : others) least_m = std::min(least_m, roughDistance(one.second, other.second, t));
      }
      return least_m;
    };
    constexpr double ROUNDING_M = 1e-12;  // of this test's own
    double least_m = leastAt(1);
    ASSERT_LE(last.lower_m, least_m + ROUNDING_M) << "seed " << seed;
    ASSERT_GE(last.upper_m, least_m - ROUNDING_M) << "seed " << seed;
    for (const double t : {0.0, 0.375, 0.75, all.t}) least_m = std::min(least_m, leastAt(t));
    ASSERT_LE(all.lower_m, least_m + ROUNDING_M) << "seed " << seed;
    ASSERT_GE(all.upper_m, least_m - ROUNDING_M) << "seed " << seed;
    for (const ClearanceDistance* d : {&last, &all}) {
      ASSERT_EQ(d->status, ClearanceStatus::MEASURED) << "seed " << seed;
      ASSERT_LE(d->upper_m - d->lower_m, options.clearance.tolerance_m) << "seed " << seed;
    }
  }
}

// What is hollow faces what is in it on all sides: no plane tells the two apart, and nearly all of their features are
// nearly as near as the nearest. Each face has a plane of its own.
TEST(ClearanceProperty, OfWhatIsWithinAnotherHoldsTheTruth) {
  const int steps = longRun() ? 300 : 12;
  int measured = 0;
  for (int seed = 0; seed < steps; ++seed) {
    const Draw draw = drawFrom(8900 + static_cast<std::uint64_t>(seed));
    const auto anywhere = [&] { return Vec3(draw(-9, 9), draw(-9, 9), 10); };
    const Eigen::Isometry3d askew =
        Eigen::Translation3d(anywhere()) * Eigen::AngleAxisd(0.3 * draw(0, 9), anywhere().normalized());
    const double apart_m = std::ldexp(1.0, -draw(1, 4));
    StepBody inner = ball(Vec3::Zero(), 1, draw(1, 2)), outer = ball(Vec3::Zero(), 1.1 + apart_m, 2);
    // It grows or shrinks, turns, and moves to one side.
    const double grown = 1 + apart_m * draw(-4, 2) / 16;
    const Eigen::AngleAxisd turn(0.02 * draw(-4, 4), anywhere().normalized());
    const Vec3 aside = apart_m / 20 * anywhere().normalized() * draw(0, 4);
    for (Vec3& p : inner.t1) p = grown * (turn * p) + aside;
    for (StepBody* body : {&inner, &outer}) {
      body->t0 = after(askew, body->t0);
      body->t1 = after(askew, body->t1);
    }
    TestStep both;
    both.bodies = {inner, outer};
    const Step step = both.motion();
    Options options;
    options.clearance.wanted = true;
    options.clearance.max_m = 8;
    options.clearance.tolerance_m = std::ldexp(1.0, draw(-20, -10));
    History history;
    const Outcome outcome = detect(step, options, history);
    ASSERT_EQ(outcome.clearances.size(), 1u);
    const ClearanceDistance &last = outcome.clearances[0].at_end, &all = outcome.clearances[0].over_step;
    if (all.status == ClearanceStatus::TOUCHING) continue;
    ++measured;
    const auto features = trueFeatures(step, 0), others = trueFeatures(step, 1);
    // What is nearest by doubles, judged by rationals.
    const auto isBelow = [&](double lower_m, double t) {
      double least_m = std::numeric_limits<double>::infinity();
      std::array<const TrueHull*, 2> nearest{};
      for (const auto& one : features) {
        for (const auto& other : others) {
          const double distance_m = roughDistance(one.second, other.second, t);
          if (distance_m < least_m) least_m = distance_m, nearest = {&one.second, &other.second};
        }
      }
      constexpr double ROUNDING_M = 1e-12;  // of this test's own
      return lower_m <= least_m + ROUNDING_M &&
             Rational(lower_m) * Rational(lower_m) <= trueSquaredDistance(*nearest[0], *nearest[1], t);
    };
    for (const double t : {0.0, 0.375, 0.75, 1.0, all.t}) {
      ASSERT_TRUE(isBelow(all.lower_m, t)) << "seed " << seed << " at " << t;
    }
    ASSERT_TRUE(isBelow(last.lower_m, 1)) << "seed " << seed;
    ASSERT_FALSE(isBelow(last.upper_m + 1e-9, 1)) << "seed " << seed;
    ASSERT_FALSE(isBelow(all.upper_m + 1e-9, all.t)) << "seed " << seed;
    for (const ClearanceDistance* d : {&last, &all}) {
      ASSERT_EQ(d->status, ClearanceStatus::MEASURED) << "seed " << seed;
      ASSERT_LE(d->upper_m - d->lower_m, options.clearance.tolerance_m) << "seed " << seed;
    }
  }
  EXPECT_GT(measured, steps / 2);
}

class ClearanceSteps : public testing::TestWithParam<int> {
 protected:
  Coordinates coordinates() const { return static_cast<Coordinates>(GetParam()); }
};

TEST_P(ClearanceSteps, HoldTheTruth) {
  const int steps = longRun() ? 1000 : 40;
  std::array<int, 5> by_status{};
  for (int seed = 0; seed < steps; ++seed) {
    const Draw draw = drawFrom(4400 + static_cast<std::uint64_t>(seed));
    Step step = randomStep(draw, draw(1, 5), coordinates()).motion();
    Options options;
    options.clearance.wanted = true;
    options.clearance.max_m = std::ldexp(1.0, draw(-4, 29));
    options.clearance.self_m = std::ldexp(1.0, draw(-40, 3));
    options.clearance.tolerance_m = std::ldexp(1.0, draw(-20, 0));
    if (draw(0, 2) == 0) {
      std::vector<OccupiedLeaf> leaves;
      for (int i = 0; i < 8; ++i) {
        if (draw(0, 2) > 0) continue;
        const auto key = [&](int bit) { return static_cast<std::uint16_t>(32768 + (i >> bit & 1 ? 4 : -4)); };
        leaves.push_back({{key(0), key(1), key(2)}, 1u << draw(0, 2)});
      }
      step.map.surface = VoxelSurface::build(std::ldexp(1.0, draw(-3, 1)), leaves);
      step.map.stamp_ns = 1;
    }
    History history;
    const Outcome outcome = detect(step, options, history);
    ASSERT_EQ(judgeClearances(step, options, outcome, 3), "") << "seed " << seed;
    for (const Clearance& row : outcome.clearances) ++by_status[static_cast<std::size_t>(row.over_step.status)];
  }
  for (std::size_t s = 0; s < by_status.size(); ++s) {
    std::cout << by_status[s] << " " << toString(static_cast<ClearanceStatus>(s))
              << (s + 1 < by_status.size() ? ", " : "\n");
  }
}

// Bodies that come near, cross, rest and come apart again, a stream of steps: what is said of each is what is said of
// it alone, and TOUCHING at its end whenever surfaces cross there.
TEST_P(ClearanceSteps, AreTheSameInAStream) {
  const int usual = coordinates() == Coordinates::EXTREME ? 4 : 20, streams = longRun() ? 25 * usual : usual;
  int crossing = 0, apart = 0;
  for (int seed = 0; seed < streams; ++seed) {
    const Draw draw = drawFrom(9900 + static_cast<std::uint64_t>(seed));
    const TestStep first = randomStep(draw, draw(6, 14), coordinates());
    Step step = first.motion();  // its bodies stay: what is known of one that is another body is forgotten
    for (Body& body : step.bodies) body.reference = body.t0;
    Options options;
    options.clearance.wanted = true;
    options.clearance.max_m = std::ldexp(1.0, draw(-4, 29));
    options.clearance.self_m = std::ldexp(1.0, draw(-40, 3));
    Detector stream(options);
    for (int i = 0; i < 6; ++i) {
      const Outcome carried = stream.run(step), alone = Detector(options).run(step);
      ASSERT_EQ(carried.clearances.size(), alone.clearances.size()) << "seed " << seed << ", step " << i;
      for (std::size_t r = 0; r < alone.clearances.size(); ++r) {
        const Clearance &one = carried.clearances[r], &other = alone.clearances[r];
        for (const auto& [carried_on, as_first] :
             {std::pair(&one.at_end, &other.at_end), std::pair(&one.over_step, &other.over_step)}) {
          ASSERT_EQ(toString(carried_on->status), std::string(toString(as_first->status)))
              << "seed " << seed << ", step " << i << ", row " << r;
        }
        ++(one.at_end.status == ClearanceStatus::TOUCHING ? crossing : apart);
      }
      ASSERT_EQ(judgeClearances(step, options, carried, 0), "") << "seed " << seed << ", step " << i;
      for (std::size_t b = 0; b < step.bodies.size(); ++b) {
        Body& body = step.bodies[b];
        body.t0 = body.t1;
        const int way = draw(0, 3);  // it rests, goes back to where it was at the very first, or goes on
        if (way == 1) body.t1 = body.reference;
        if (way > 1) body.t1 = share(randomMotion(draw, *body.t0, coordinates()));
      }
    }
  }
  std::cout << crossing << " rows touch at their step's end, " << apart << " do not\n";
  if (coordinates() != Coordinates::EXTREME) EXPECT_GT(crossing, streams / 2);
  EXPECT_GT(apart, streams / 2);
}

std::string nameOf(const testing::TestParamInfo<int>& info) {
  static const char* const NAMES[] = {"SmallIntegers", "FewBits", "Real",       "LittleMotion", "HugeOffset",
                                      "Flat",          "AtRest",  "Coincident", "Subnormal",    "Extreme"};
  return NAMES[info.param];
}

INSTANTIATE_TEST_SUITE_P(Coordinates, ClearanceSteps, testing::Range(0, static_cast<int>(Coordinates::COUNT)), nameOf);

}  // namespace
}  // namespace test
}  // namespace dccd
