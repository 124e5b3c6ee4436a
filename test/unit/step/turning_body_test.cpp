// Rigid bodies that turn: the step is cut into parts whose straight paths stay near the arc.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <random>

#include "step/parts.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

/// A triangle that points up with vertex 0, at (0, 0, z).
MeshFrame peak(StampNs stamp_ns, double z) {
  return {stamp_ns, oneTriangle(), {{0, 0, z}, {0.1, 0, z - 1.1}, {-0.1, 0, z - 1.1}}};
}

/// A bar of 1 m along x that has turned by `angle` about the y axis at its end: downwards first.
MeshFrame bar(StampNs stamp_ns, double angle) {
  MeshFrame frame{stamp_ns, oneTriangle(), {{0, -0.2, 0}, {1, -0.2, 0}, {1, 0.2, 0}}, true};
  frame.pose.linear() = Eigen::AngleAxisd(angle, Vec3::UnitY()).toRotationMatrix();
  for (Vec3& p : frame.positions) p = frame.pose * p;
  return frame;
}

/// The clock body and a rigid bar.
std::vector<Body> clockAndBar() {
  std::vector<Body> bodies{named("clock"), named("bar")};
  bodies[1].rigid = true;
  return bodies;
}

/// The outcome of the step to this frame of the clock body, the bar having come to `angle`.
Outcome step(Monitor& monitor, MeshFrame clock, double angle) {
  const StampNs stamp_ns = clock.stamp_ns;
  monitor.push(1, bar(stamp_ns, angle), NOW);
  monitor.push(0, std::move(clock), NOW);
  Outcome outcome;
  EXPECT_TRUE(monitor.next(NOW, outcome));
  return outcome;
}

TEST(TurningBody, IsCutIntoAsManyPartsAsTheToleranceAsksFor) {
  Body body;
  body.t0 = share(Positions{{0, 0, 0}, {1, 0, 0}, {1, 0.1, 0}});
  body.turns = true;
  body.pose_t1.linear() = Eigen::AngleAxisd(3.1, Vec3::UnitY()).toRotationMatrix();
  const double parts = partsFor(body, 1, 1e-3);
  EXPECT_GT(parts, 30);
  EXPECT_LT(parts, 40);
  EXPECT_LE(1.005 * (1 - std::cos(3.1 / (2 * parts))), 1e-3);
  body.pose_t1 = body.pose_t0;
  EXPECT_EQ(partsFor(body, 1, 1e-3), 1);
}

// What the vertices span says sooner that one part is enough, and nothing else.
TEST(TurningBody, NeedsAsManyPartsWhereItIsKnownWhatItSpans) {
  std::mt19937_64 random(11);
  std::uniform_real_distribution<double> unit(-1, 1);
  int straight = 0;
  for (int i = 0; i < 2000; ++i) {
    Body body;
    Positions t0;
    for (int v = 0; v < 4; ++v) t0.emplace_back(unit(random), unit(random), unit(random));
    Extent extent{share(t0), t0[0], t0[0], true};
    for (const Vec3& p : t0) {
      extent.lo = extent.lo.cwiseMin(p);
      extent.hi = extent.hi.cwiseMax(p);
    }
    body.t0 = extent.of;
    body.pose_t0.translation() = Vec3(unit(random), unit(random), unit(random));
    body.pose_t1.linear() = Eigen::AngleAxisd(0.2 * unit(random), Vec3::UnitZ()).toRotationMatrix();
    const double parts = partsFor(body, 1, 1e-3);
    EXPECT_EQ(partsFor(body, 1, 1e-3, &extent), parts);
    straight += parts == 1;
    Extent of_others = extent;
    of_others.of = share(t0);
    of_others.lo = of_others.hi = body.pose_t0.translation();
    EXPECT_EQ(partsFor(body, 1, 1e-3, &of_others), parts);
  }
  EXPECT_GT(straight, 200);
  EXPECT_LT(straight, 1800);
}

// A prediction may turn a body by more than half a turn. Then its chord leaves the arc by more than the body's radius.
TEST(TurningBody, MoreThanHalfATurnLeavesTheArcByMoreThanTheRadius) {
  constexpr double RADIUS_M = 0.8e-3, TOLERANCE_M = 1e-3;
  Body body;
  body.t0 = share(Positions{{RADIUS_M, 0, 0}, {0, 0, 0}, {0, 0, RADIUS_M}});
  body.turns = true;
  body.pose_t1.linear() = Eigen::AngleAxisd(0.75 * M_PI, Vec3::UnitY()).toRotationMatrix();
  EXPECT_EQ(partsFor(body, 1, TOLERANCE_M), 1);
  ASSERT_GT(RADIUS_M * (1 - std::cos(0.75 * M_PI)), TOLERANCE_M);
  EXPECT_EQ(partsFor(body, 2, TOLERANCE_M), 2);
}

// A bar of 1 m turns by nearly 180 degrees about its end; half way its other end passes what no chord comes near.
TEST(TurningBody, MeetsWhatOnlyTheArcPasses) {
  Monitor far(loose(), clockAndBar());
  step(far, peak(0, -1.01), 0);
  const Outcome missed = step(far, peak(100 * MS, -1.01), 3.1);
  EXPECT_GT(missed.substeps, 30u);
  ASSERT_TRUE(missed.contacts.empty()) << "the tip is 1 cm below";
  Monitor near(loose(), clockAndBar());
  step(near, peak(0, -0.9), 0);
  const Outcome met = step(near, peak(100 * MS, -0.9), 3.1);
  ASSERT_EQ(met.status, StepStatus::OK) << met.reason;
  EXPECT_NEAR(met.earliest_toc, 0.5 * M_PI / 3.1, 0.01);
}

// It meets one side of a triangle some parts before the other one.
TEST(TurningBody, TheFirstContactIsThatOfAllParts) {
  const auto sweep = [](bool earliest_only) {
    MonitorOptions options = loose();
    options.detector.earliest_only = earliest_only;
    Monitor monitor(options, clockAndBar());
    MeshFrame wide{0, oneTriangle(), {{0, 0, -0.5}, {0.5, 0, -1.6}, {-0.5, 0, -1.6}}};
    step(monitor, wide, 0);
    wide.stamp_ns = 100 * MS;
    return step(monitor, wide, 3.1);
  };
  const auto last = [](const Outcome& outcome) {
    double toc = 0;
    for (const Contact& c : outcome.contacts) toc = std::max(toc, c.toc_lower);
    return toc;
  };
  const Outcome all = sweep(false), first = sweep(true);
  EXPECT_EQ(first.earliest_toc, all.earliest_toc);
  EXPECT_GT(last(all), all.earliest_toc + 0.1) << "else it shows nothing";
  EXPECT_LT(last(first), all.earliest_toc + 1e-9);
}

// A step is not split for a body that turns far from all that it is tested against.
TEST(TurningBody, ThatComesNearNothingIsNotCut) {
  std::vector<Body> bodies = clockAndBar();
  bodies[1].against_obstacle = false;
  Monitor monitor(loose(), bodies);
  step(monitor, peak(0, -1.03), 0);
  const Outcome outcome = step(monitor, peak(100 * MS, -1.03), 3.1);
  EXPECT_EQ(outcome.substeps, 1u);
  EXPECT_EQ(outcome.stats.bodies_far, 1u);
  EXPECT_TRUE(assuranceOf(outcome).clear());
  EXPECT_GT(step(monitor, peak(200 * MS, -1.01), 6.2).substeps, 30u) << "its corners come to 1.02 m";
  bodies[0].not_against = {1};
  Monitor blind(loose(), bodies);
  step(blind, peak(0, -0.9), 0);
  const Outcome unseen = step(blind, peak(100 * MS, -0.9), 3.1);
  EXPECT_EQ(unseen.substeps, 1u);
  EXPECT_TRUE(unseen.contacts.empty());
}

TEST(TurningBody, MeetsWhatOfTheMapOnlyTheArcPasses) {
  Monitor monitor(loose(), clockAndBar());
  monitor.setMap({VoxelSurface::build(0.1, {{{32768, 32768, 32758}, 1}}), 0, Eigen::Isometry3d::Identity(), {}});
  step(monitor, peak(0, -1.2), 0);
  EXPECT_NEAR(step(monitor, peak(100 * MS, -1.2), 3.1).earliest_toc, std::atan2(0.9, 0.1) / 3.1, 0.01);
}

// The point that is shown lies on the arc, where the part's straight paths meet, not half way of the whole step's
// chord.
TEST(TurningBody, TheGeometryIsThatOfThePart) {
  Monitor monitor(loose(), clockAndBar());
  step(monitor, peak(0, -0.9), 0);
  const Outcome outcome = step(monitor, peak(100 * MS, -0.9), 3.1);
  ASSERT_FALSE(outcome.contacts.empty());
  for (const Contact& contact : outcome.contacts) {
    const ContactGeometry geometry = contactGeometry(outcome, contact);
    EXPECT_NEAR(geometry.point.x(), 0, 0.15);
    EXPECT_LE(geometry.point.z(), -0.9 + 1e-3);
    EXPECT_GE(geometry.point.z(), -1 - 1e-3);
    for (int i = 0; i < 4; ++i) {
      const bool of_bar = contact.body[i < (contact.kind == PairKind::VERTEX_FACE ? 1 : 2) ? 0 : 1] == 1;
      const Vec3 at = vertexAtContact(outcome, contact, i);
      // The bar's two far corners are 1 m from its axis, its near one on it.
      if (!of_bar) continue;
      EXPECT_NEAR(std::hypot(at.x(), at.z()), contact.vertex[i] == 0 ? 0 : 1, 2e-3);
    }
    // 31 rad/s for a tenth of a second: 2.8 m to 3.1 m a step where it passes the tip.
    EXPECT_GT(std::abs(geometry.approach_speed), 2.5);
    EXPECT_LT(std::abs(geometry.approach_speed), 3.3);
  }
}

// Frames on the arc are on the way; a turn there and back is followed.
TEST(TurningBody, FramesBetweenTheEndsAreHeldAgainstTheArc) {
  const auto lastOf = [](double middle, double end, double z) {
    Monitor monitor(loose(), clockAndBar());
    step(monitor, peak(0, z), 0);
    monitor.push(1, bar(50 * MS, middle), NOW);
    return step(monitor, peak(100 * MS, z), end);
  };
  EXPECT_TRUE(lastOf(0.5, 1, -3).step->bodies[1].waypoints.empty());
  EXPECT_TRUE(assuranceOf(lastOf(0.5, 0, -3)).clear()) << "it is far";
  // Half way the bar hangs down, and its end is at -1.
  const Outcome down = lastOf(0.5 * M_PI, 0, -0.9), past = lastOf(0.5 * M_PI, 0, -1.01);
  ASSERT_EQ(down.status, StepStatus::OK) << down.reason;
  EXPECT_NEAR(down.earliest_toc, 0.5, 0.03);
  EXPECT_TRUE(assuranceOf(past).clear()) << past.reason;
}

// The budget is one for the whole step: once it is spent, the parts that are left are not begun.
TEST(TurningBody, TheBudgetIsForTheWholeStep) {
  const auto run = [](double budget_ms) {
    MonitorOptions options = loose();
    options.detector.step_budget_ms = budget_ms;
    Monitor monitor(options, clockAndBar());
    step(monitor, peak(0, -1.01), 0);
    return step(monitor, peak(100 * MS, -1.01), 3.1);
  };
  const Outcome whole = run(0);
  ASSERT_EQ(whole.status, StepStatus::OK);
  ASSERT_GT(whole.substeps, 30u);
  const auto bodies = [](const StepStats& stats) {
    return stats.bodies_refitted + stats.bodies_kept + stats.bodies_far;
  };
  EXPECT_EQ(bodies(whole.stats), 2 * whole.substeps) << "two bodies in every part";
  EXPECT_TRUE(run(1000).complete);
  const Outcome cut = run(1e-6);
  EXPECT_EQ(cut.status, StepStatus::DEADLINE);
  EXPECT_FALSE(cut.complete);
  EXPECT_FALSE(cut.claim.holds());
  EXPECT_FALSE(assuranceOf(cut).clear());
  EXPECT_EQ(bodies(cut.stats), 2u) << "the first part alone";
  EXPECT_LE(cut.unchecked_toc_lower, 1.0 / static_cast<double>(cut.substeps));
}

// A search of the start state that takes longer than the whole budget gets a share of each part's time: the parts after
// the first are tested all the same, and the search comes to its end.
TEST(TurningBody, TheSearchOfTheStartStateLeavesTimeForAllParts) {
  constexpr std::size_t SIZE = 120;
  const auto grid = std::make_shared<const Topology>(Topology::grid(SIZE, SIZE));
  Positions rough;  // faces near to many others, and through none
  for (std::size_t i = 0; i < SIZE * SIZE; ++i) {
    rough.emplace_back(0.01 * static_cast<double>(i % SIZE), 0.01 * static_cast<double>(i / SIZE),
                       -1.01 - static_cast<double>(i * 7919 % 7));
  }
  int at = 0;
  const auto next = [&](Monitor& monitor) {
    ++at;
    return step(monitor, {at * 100 * MS, grid, rough}, 0.5 * at);
  };
  MonitorOptions options = loose();
  options.detector.unfolded_test = false;  // else there is nothing to search in what one sees from above
  const auto shorter = [&](bool check_start_state, double& shortest_ms) {
    options.detector.check_start_state = check_start_state;
    Monitor monitor(options, clockAndBar());
    next(monitor);
    const Outcome outcome = next(monitor);
    EXPECT_GT(outcome.substeps, 5u);
    shortest_ms = std::min(shortest_ms, outcome.stats.total_ms);
  };
  // In turns, until something else on the machine has let both alone once.
  double contacts_ms = 1e9, with_search_ms = 1e9;
  for (int i = 0; i < 20 || (i < 400 && !(with_search_ms > 1.5 * contacts_ms)); ++i) {
    shorter(false, contacts_ms);
    shorter(true, with_search_ms);
  }
  ASSERT_GT(with_search_ms, 1.5 * contacts_ms);
  if (std::getenv("DEFORMABLE_CCD_SANITIZED")) GTEST_SKIP() << "a sanitizer's steps take twice as long at times";
  options.detector.step_budget_ms = std::min(2 * contacts_ms, (contacts_ms + with_search_ms) / 2);
  // Something else on the machine may take the time that the contacts need; then again.
  Monitor monitor(options, clockAndBar());
  next(monitor);
  bool known = false;
  for (int i = 0; i < 1000 && !known; ++i) {
    const Outcome outcome = next(monitor);
    known = outcome.complete;
    EXPECT_EQ(assuranceOf(outcome).clear(), known) << outcome.reason;
  }
  EXPECT_TRUE(known);
}

// What the detector knows is where the first part ended; the next step begins where the last one would have.
TEST(TurningBody, AStepAfterOneThatWasCutStartsAnew) {
  // Pierced in its middle by the bar's long edges when the bar hangs down, and by nothing before.
  const auto sheet = [](StampNs stamp_ns) {
    return MeshFrame{stamp_ns, oneTriangle(), {{-2, -2, -0.5}, {2, -2, -0.5}, {0, 3, -0.5}}};
  };
  MonitorOptions options = loose();
  const auto last = [&](double budget_ms) {
    Monitor monitor(options, clockAndBar());
    step(monitor, sheet(0), 0);
    options.detector.step_budget_ms = budget_ms;
    monitor.setOptions(options);
    const Outcome turned = step(monitor, sheet(100 * MS), 1.5);
    EXPECT_EQ(turned.status, budget_ms > 0 ? StepStatus::DEADLINE : StepStatus::OK);
    options.detector.step_budget_ms = 0;
    monitor.setOptions(options);
    return step(monitor, sheet(200 * MS), 1.5);
  };
  EXPECT_EQ(last(0).start_state, StartState::INTERSECTING);
  const Outcome outcome = last(1e-6);
  EXPECT_EQ(outcome.start_state, StartState::INTERSECTING);
  EXPECT_FALSE(assuranceOf(outcome).clear());
}

// 12 rad/s for half a second: nearly a whole turn, which two poses alone would call a small one backwards.
TEST(TurningBody, APredictionMayTurnByMoreThanAHalf) {
  MonitorOptions options = loose();
  options.look_ahead_s = 0.5;
  options.detector.max_substeps = 1000;
  Monitor monitor(options, clockAndBar());
  step(monitor, peak(0, -0.9), -2.0);
  ASSERT_TRUE(assuranceOf(step(monitor, peak(100 * MS, -0.9), -0.8)).clear());
  const Outcome ahead = monitor.predict();
  ASSERT_EQ(ahead.status, StepStatus::OK) << ahead.reason;
  ASSERT_FALSE(ahead.contacts.empty());
  // It hangs down after 0.8 + pi / 2 of 6 rad, and meets the tip a little earlier.
  EXPECT_NEAR(ahead.earliest_toc, (0.8 + 0.5 * M_PI) / 6, 0.02);
  EXPECT_FALSE(assuranceOf(ahead).clear());
}

// Undecided in one part, certain in a later one: the contact is certain, and begins no later than it may.
TEST(TurningBody, APairThatIsCertainInOnePartIsCertain) {
  MonitorOptions options = loose();
  options.detector.accuracy.rung = Accuracy::CONSERVATIVE;
  const auto run = [&](std::size_t max_subdivisions) {
    options.detector.accuracy.max_subdivisions = max_subdivisions;
    std::vector<Body> bodies = clockAndBar();
    bodies[0].minimum_separation_m = 0.05;
    Monitor monitor(options, bodies);
    step(monitor, peak(0, -0.9), 0);
    return step(monitor, peak(100 * MS, -0.9), 1.6);
  };
  const Outcome few = run(1), many = run(AccuracyOptions().max_subdivisions);
  ASSERT_GT(many.counts.certain, 0u);
  EXPECT_EQ(many.counts.undecided, 0u);
  EXPECT_GT(few.counts.certain, 0u) << "every pair was undecided in a part before";
  for (std::size_t i = 1; i < few.contacts.size(); ++i) {
    EXPECT_TRUE(canonicalLess(few.contacts[i - 1], few.contacts[i]));
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
