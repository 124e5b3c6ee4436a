// Answers that are cut short: earliest only, a budget of time, filters alone.
#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>

#include "dccd/monitor_extras.h"
#include "support/looks.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

/// Of an answer with all contacts, those in the cell that ends first.
std::vector<Contact> firstCell(const std::vector<Contact>& contacts) {
  double upper = 2, lower = 2;
  for (const Contact& c : contacts) {
    upper = std::min(upper, c.toc_upper);
    lower = std::min(lower, c.toc_lower);
  }
  std::vector<Contact> first;
  for (const Contact& c : contacts) {
    if (c.toc_lower == lower && c.toc_upper == upper) first.push_back(c);
  }
  return first;
}

// The bounds end at the first contact of a sample: at any time of the step, and at 0; for a body that meets itself and
// for two; beside one that rests; with a limit; over and over with one history, which also computes whole answers.
TEST(DetectorLimits, EarliestOnlyEndsTheStepAtTheFirstContact) {
  const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 4);
  std::size_t pruned = 0, swept = 0, late = 0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    TestStep step = crumpled(seed, 2, 40);
    const bool itself = seed % 4 == 0;
    for (StepBody& body : step.bodies) body.self_collision = itself;
    const double gap = seed % 4 == 0 ? -1.2 : seed % 4 == 1 ? -1.8 : seed % 4 == 2 ? 2.2 : 4;
    for (Vec3& x : step.bodies[1].t0) x[2] += 2.5 + gap;
    for (Vec3& x : step.bodies[1].t1) x[2] -= 2.5 - (seed % 4 == 3 ? 2.5 : 0);
    if (seed % 3 == 0) step.bodies[0].t1 = step.bodies[0].t0;
    Options options;
    options.check_start_state = seed % 2 == 0;
    const Outcome full = runOnce(step, options);
    ASSERT_FALSE(full.contacts.empty());
    const std::vector<Contact> expected = firstCell(full.contacts);
    options.earliest_only = true;
    const Outcome first = runOnce(step, options);
    EXPECT_EQ(difference(first.contacts, expected), "");
    EXPECT_EQ(first.start_state, full.start_state);
    pruned += first.stats[Stage::ELEMENTARY].in < full.stats[Stage::ELEMENTARY].in / 4;
    swept += full.earliest_toc < 1.0 / 16;
    late += full.earliest_toc > 0.25;
    forEachSimdTarget([&](const std::string& target) {
      options.num_threads = target == simdTargets().front() ? 3 : 1;
      options.max_found = target == simdTargets().back() ? 1000000 : 0;
      EXPECT_EQ(difference(runOnce(step, options).contacts, expected), "") << target;
    });
    options.num_threads = 2;
    options.max_found = 0;
    const Step motion = step.motion();
    History history;
    for (const bool earliest : {true, true, false, true, false}) {
      options.earliest_only = earliest;
      EXPECT_EQ(difference(detect(motion, options, history).contacts, earliest ? expected : full.contacts), "");
    }
  }
  EXPECT_GE(pruned, 8u) << "nothing is pruned";
  EXPECT_GE(swept, 4u);
  EXPECT_GE(late, 2u);
}

// A second triangle arrives while another one rests: beside that nobody looks for what begins later.
TEST(DetectorLimits, EarliestOnlyNeverSaysThatNothingNewTouchesBesideWhatRests) {
  TestStep step = crossing();
  StepBody resting = step.bodies[1];
  resting.t0 = resting.t1 = movedBy(resting.t0, {-1, 0, -1});
  step.bodies.push_back(resting);
  Options options;
  const Outcome whole = runOnce(step, options);
  EXPECT_EQ(whole.touching, Touching::NEW);
  EXPECT_TRUE(whole.excluded.empty());
  options.earliest_only = true;
  const Outcome first = runOnce(step, options);
  EXPECT_TRUE(std::all_of(first.contacts.begin(), first.contacts.end(), [](const Contact& c) { return c.initial; }));
  EXPECT_EQ(first.touching, Touching::NEW);
  EXPECT_EQ(first.excluded, std::vector<std::string>{"contacts that begin after the first one by earliest_only"});
  for (StepBody& body : step.bodies) body.t0[0].z() += 0.1 * (&body != step.bodies.data());
  for (StepBody& body : step.bodies) body.t1 = body.t0;
  EXPECT_EQ(runOnce(step, options).touching, Touching::NONE);
  EXPECT_TRUE(runOnce(step, options).excluded.empty());
}

// A step whose end is not reached leaves bounds that are none of its end: the one after it makes its own.
TEST(DetectorLimits, EarliestOnlyLeavesNothingForTheNextStep) {
  TestStep step = crumpled(5, 2, 40);
  Options whole, earliest;
  earliest.earliest_only = true;
  History history;
  for (int i = 0; i < 4; ++i) {
    EXPECT_EQ(difference(detect(step.motion(), earliest, history).contacts, firstCell(runOnce(step, whole).contacts)),
              "");
    std::vector<Positions> next;
    for (const StepBody& body : step.bodies) next.push_back(i % 2 ? body.t0 : body.t1);  // now and then all rests
    step = step.continued(next);
    const Outcome expected = runOnce(step, whole);
    const Outcome after = detect(step.motion(), whole, history);
    EXPECT_EQ(difference(after.contacts, expected.contacts), "");
    EXPECT_EQ(after.start_state, expected.start_state);
    EXPECT_TRUE(same(after.intersections, expected.intersections));
  }
}

// Where a deadline cuts it, what was not looked at may touch no earlier than it says.
TEST(DetectorLimits, EarliestOnlyUnderABudgetKeepsItsWord) {
  std::size_t cut = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Step step = crumpled(seed, 2, 60).motion();
    const Outcome full = runFor(MANY, step);
    Options options;
    options.earliest_only = true;
    const std::int64_t looks = looksOf(step, options);
    for (int sample = 0; sample < 16; ++sample) {
      const Outcome part = runFor(looks * sample / 16, step, options);
      cut += !part.complete;
      EXPECT_EQ(part.claim.holds(), part.complete) << sample << " of 16";
      if (part.complete) {
        EXPECT_EQ(part.earliest_toc, full.earliest_toc);
      } else if (part.earliest_toc > full.earliest_toc) {
        EXPECT_LE(part.unchecked_toc_lower, full.earliest_toc + 0x1p-32) << sample << " of 16";
      }
    }
  }
  EXPECT_GT(cut, 4u);
}

// Where a distance stays within the tolerance of the separation, no time says more than another: the bracket ends at 1,
// and the contact is the first all the same.
TEST(DetectorLimits, EarliestOnlyKeepsTheFirstOfUnequalBrackets) {
  TestStep step = crossing();      // body 1 meets body 0 at 0.5, in a narrow bracket
  StepBody near = step.bodies[0];  // all the while as far from body 0 as the separation: the bracket is [0, 1]
  moveBy(near, {0, 0, -0.05});
  step.bodies.push_back(near);
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  options.check_start_state = false;
  Step motion = step.motion();
  for (Body& body : motion.bodies) body.self_collision = false;
  motion.bodies[2].separations = {{0, 0.05}};
  const auto run = [&] { return Detector(options).run(motion); };
  const Outcome full = run();
  ASSERT_EQ(full.earliest_toc, 0);
  ASSERT_TRUE(std::any_of(full.contacts.begin(), full.contacts.end(),
                          [](const Contact& c) { return c.toc_lower == 0 && c.toc_upper == 1; }));
  const auto narrow = [](const Contact& c) { return c.toc_lower > 0.49 && c.toc_upper < 0.51; };
  ASSERT_TRUE(std::any_of(full.contacts.begin(), full.contacts.end(), narrow)) << "nothing to take for the first";
  options.earliest_only = true;
  const Outcome first = run();
  EXPECT_EQ(first.earliest_toc, 0);
  // What begins before the narrow one ends may be the first; what begins later is not.
  for (const Contact& c : full.contacts) {
    const bool listed = std::any_of(first.contacts.begin(), first.contacts.end(),
                                    [&](const Contact& f) { return difference({c}, {f}).empty(); });
    EXPECT_EQ(listed, c.toc_lower < 0.51) << describe(c);
  }
}

// Nothing that the budget leaves over may touch before its bound, wherever it ends: at a look at the clock, not at a
// time. Somewhere between no pair and all pairs it ends within the contacts.
TEST(DetectorLimits, BudgetKeepsItsWord) {
  constexpr std::int64_t SAMPLES = 24;
  std::size_t in_the_middle = 0;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    TestStep step = crumpled(seed, 2, 12);
    for (Vec3& x : step.bodies[1].t0) x[2] += seed % 2 ? 0 : 8;
    if (seed % 2 == 0) {
      for (StepBody& body : step.bodies) body.self_collision = false;
    }
    Options options;
    const Outcome full = runOnce(step, options);
    ASSERT_GT(full.contacts.size(), 10u);
    const Step motion = step.motion();
    const std::int64_t looks = looksOf(motion);
    for (std::int64_t sample = 0; sample < SAMPLES; ++sample) {
      const Outcome part = runFor(looks * sample / SAMPLES, motion);
      EXPECT_TRUE(sample > 0 || (!part.complete && std::isfinite(part.unchecked_toc_lower)));
      const auto certain = std::count_if(part.contacts.begin(), part.contacts.end(),
                                         [](const Contact& c) { return c.certainty == Certainty::CERTAIN; });
      in_the_middle += certain > 0 && static_cast<std::size_t>(certain) < full.contacts.size();
      EXPECT_EQ(part.allPairs(), !std::isfinite(part.unchecked_toc_lower) && part.stats.undecided == 0);
      EXPECT_LE(part.earliest_toc, full.earliest_toc);
      for (const Contact& truth : full.contacts) {
        const auto same =
            std::lower_bound(part.contacts.begin(), part.contacts.end(), truth, [](const Contact& a, const Contact& b) {
              return std::tie(a.kind, a.body, a.vertex) < std::tie(b.kind, b.body, b.vertex);
            });
        const bool listed = same != part.contacts.end() && same->kind == truth.kind && same->body == truth.body &&
                            same->vertex == truth.vertex;
        if (!listed) {
          EXPECT_LE(part.unchecked_toc_lower, truth.toc_upper) << describe(truth);
        } else if (same->certainty == Certainty::UNDECIDED) {
          EXPECT_LE(same->toc_lower, truth.toc_upper) << describe(truth);
          EXPECT_EQ(same->toc_upper, 1);
        } else {
          EXPECT_EQ(difference({*same}, {truth}), "");
        }
      }
    }
    // The bound is as tight as the filter allows: bodies that start apart do not touch at 0.
    if (seed % 2 == 0) {
      options.step_budget_ms = 1e-6;
      EXPECT_GT(runOnce(step, options).earliest_toc, 0.1);
    }
  }
  EXPECT_GT(in_the_middle, 0u);
}

// No pair comes to a test when the deadline is over before the first; what a budget saves in time: scripts/benchmark.
TEST(DetectorLimits, BudgetEndsTheStep) {
  const TestStep step = crumpled(3, 2, 40);
  Options options;
  const StepStats full = runOnce(step, options).stats;
  options.step_budget_ms = 1e-6;
  const Outcome part = runOnce(step, options);
  EXPECT_FALSE(part.complete);
  EXPECT_FALSE(part.claim.holds());
  EXPECT_EQ(part.start_state, StartState::NOT_CHECKED);
  for (const Stage stage : {Stage::BROAD_PHASE, Stage::PLANAR, Stage::ELEMENTARY, Stage::START_STATE}) {
    EXPECT_GT(full[stage].in, 1000u) << toString(stage);
    EXPECT_EQ(part.stats[stage].in, 0u) << toString(stage);
  }
}

// The search of the start state, dear on the first frame, takes nothing from the contacts and comes to its end in
// later steps: while sheets move there and back, with half of what it takes beside them.
TEST(DetectorLimits, AStartStateThatTheBudgetCutsIsKnownLater) {
  // Two sheets, the last rows of one of which dip into the other.
  constexpr std::size_t SIZE = 120;
  TestStep steps[2];
  for (const double z : {0.0, 0.5}) {
    StepBody sheet;
    sheet.topology = Topology::grid(SIZE, SIZE);
    for (std::size_t i = 0; i < SIZE * SIZE; ++i) {
      const double x = static_cast<double>(i % SIZE), y = static_cast<double>(i / SIZE);
      sheet.t0.emplace_back(x + z / 2, y + z / 3, z);
      sheet.t1.emplace_back(x + z / 2, y + z / 3, y < SIZE - 3 ? z : -z);
    }
    steps[0].bodies.push_back(sheet);
  }
  std::vector<Positions> back;
  for (const StepBody& body : steps[0].bodies) back.push_back(body.t0);
  steps[1] = steps[0].continued(back);
  Options options;
  options.unfolded_test = false;  // sheets without a fold are not searched
  const Outcome full[2] = {runOnce(steps[0], options), runOnce(steps[1], options)};
  ASSERT_GT(full[0].contacts.size(), 10u);
  ASSERT_GT(full[1].contacts.size(), 10u);
  ASSERT_GT(full[1].intersections.size(), 10u);
  // Looks at the clock, not times: how busy the machine is does not matter.
  const Step motions[2] = {steps[0].motion(), steps[1].motion()};
  std::int64_t looks = 0;
  for (const Step& motion : motions) {
    std::int64_t too_few = 0, all = looksOf(motion, options), enough = all;
    while (enough - too_few > 1) {
      const std::int64_t middle = (too_few + enough) / 2;
      (runFor(middle, motion, options).allPairs() ? enough : too_few) = middle;
    }
    looks = std::max(looks, enough + (all - enough) / 2);
  }
  History history;
  bool known = false;
  std::size_t cut = 0;
  for (std::size_t i = 0; !known && i < 200; ++i) {
    const Outcome part = runFor(looks, motions[i % 2], options, history);
    ASSERT_TRUE(part.allPairs());
    EXPECT_EQ(difference(part.contacts, full[i % 2].contacts), "");
    EXPECT_LE(part.intersections.size(), full[i % 2].intersections.size());
    known = part.start_state_complete;
    if (known) {
      EXPECT_EQ(part.intersections.size(), full[i % 2].intersections.size());
    }
    cut += !known;
  }
  EXPECT_TRUE(known) << "not within 200 steps";
  EXPECT_GT(cut, 0u);
}

// A step that throws leaves positions behind that nothing is known about.
TEST(DetectorLimits, NothingIsCarriedOverAStepThatThrew) {
  const TestStep step = crumpled(3, 2, 9);
  const Outcome first = runOnce(step, Options());
  const std::uint64_t searched = first.stats[Stage::START_STATE].in;
  ASSERT_GT(searched, 0u);
  Detector detector;
  detector.run(step.motion());
  Step uncertain = step.motion();
  uncertain.bodies[0].radius_m = share(std::vector<double>(step.bodies[0].t0.size(), 0.1));
  EXPECT_THROW(detector.run(uncertain), std::invalid_argument);
  EXPECT_TRUE(detector.history().isClear());
  EXPECT_EQ(detector.run(step.motion()).stats[Stage::START_STATE].in, searched);
}

// The map's part of a step is cut like the rest: what is listed is true, and of what is not nothing is said.
TEST(DetectorLimits, TheBudgetHoldsForTheMapToo) {
  constexpr std::size_t SIZE = 40;
  Body cloth = bodyOf("cloth", Topology::grid(SIZE, SIZE));
  cloth.self_collision = false;
  Positions above, below;
  for (std::size_t i = 0; i < SIZE * SIZE; ++i) {
    const double x = static_cast<double>(i % SIZE), y = static_cast<double>(i / SIZE), wave = 0.3 * std::sin(x + 2 * y);
    above.emplace_back(0.9 * x + 0.45, 0.9 * y + 0.35, 1.5 + wave);
    below.emplace_back(0.9 * x + 0.5, 0.9 * y + 0.3, 0.8 - wave);
  }
  Step step = stepOf(cloth, above, below);
  step.map.surface = VoxelSurface::build(1.0, voxelsOfBox({0, 0, 0}, {SIZE, SIZE, 1}));
  const Outcome full = runFor(MANY, step);
  EXPECT_TRUE(full.complete);
  EXPECT_TRUE(full.claim.holds());
  ASSERT_GT(full.contacts.size(), 1000u);
  const std::int64_t looks = looksOf(step);
  std::size_t listed = 0;
  for (std::int64_t share = 0; share < 4; ++share) {
    const Outcome part = runFor(looks * share / 10, step);
    listed += part.contacts.size();
    EXPECT_FALSE(part.complete) << share;
    EXPECT_FALSE(part.claim.holds());
    EXPECT_EQ(part.unchecked_toc_lower, 0);
    EXPECT_EQ(part.start_state, StartState::NOT_CHECKED);
    EXPECT_LT(part.contacts.size(), full.contacts.size());
    for (const Contact& c : part.contacts) {
      const auto same = std::lower_bound(full.contacts.begin(), full.contacts.end(), c, canonicalLess);
      ASSERT_TRUE(same != full.contacts.end() && difference({c}, {*same}).empty()) << describe(c);
    }
  }
  EXPECT_GT(listed, 0u);
}

}  // namespace
}  // namespace test
}  // namespace dccd
