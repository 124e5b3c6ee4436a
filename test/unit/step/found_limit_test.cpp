// What a step may find: input that coincides makes pairs by the square, and is cut at a count, which is the same for
// any number of threads and SIMD target.
#include "step/pairs/found_limit.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>

#include "support/checkerboard.h"
#include "support/heap.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

constexpr std::size_t MIB = std::size_t{1} << 20;

/// A tracked cloth, all of it in one place at the times that are named.
Step collapsed(std::size_t size, bool at_start, bool at_end, const Vec3& at = Vec3(0.1, 0.2, 0.3)) {
  const Positions flat = gridAt(size, size, 0.01), point(size * size, at);
  return stepOf(bodyOf("cloth", Topology::grid(size, size)), at_start ? point : flat, at_end ? point : flat);
}

std::size_t features(const Topology& topology) {
  return topology.vertexCount() + topology.edges().size() + topology.faces().size();
}

Options limited(std::size_t per_feature) {
  Options options;
  options.max_contacts = 1000;
  options.max_found_per_feature = per_feature;
  return options;
}

/// What is said of a step that was cut, whatever touches in it.
void expectCut(const Outcome& outcome, std::size_t limit) {
  EXPECT_EQ(outcome.status, StepStatus::TRUNCATED);
  EXPECT_TRUE(outcome.cut);
  EXPECT_FALSE(outcome.complete);
  EXPECT_FALSE(outcome.claim.holds());
  const std::vector<Gap>& gaps = outcome.claim.gaps();
  const bool any_pair = std::any_of(gaps.begin(), gaps.end(), [](const Gap& gap) { return !gap.at_start; });
  EXPECT_EQ(any_pair, !outcome.allPairs()) << "some pairs were left out, and not of the start alone";
  EXPECT_LE(outcome.total_contacts, limit);
  EXPECT_LE(outcome.intersections.size(), limit);
  EXPECT_FALSE(assuranceOf(outcome).proved);
  EXPECT_NE(outcome.reason.find("at least " + std::to_string(outcome.total_contacts) + " contacts"), std::string::npos)
      << outcome.reason;
}

Outcome runOnceWith(const Options& options, const Step& step) { return Detector(options).run(step); }

void expectSameAnswer(const Outcome& x, const Outcome& y) {
  EXPECT_EQ(difference(x.contacts, y.contacts), "");
  EXPECT_EQ(x.unchecked_toc_lower, y.unchecked_toc_lower);
  EXPECT_EQ(x.total_contacts, y.total_contacts);
  EXPECT_EQ(x.stats.undecided, y.stats.undecided);
  EXPECT_EQ(x.status, y.status);
  EXPECT_EQ(x.reason, y.reason);
  EXPECT_EQ(x.start_state, y.start_state);
  EXPECT_EQ(x.start_state_complete, y.start_state_complete);
  EXPECT_TRUE(same(x.intersections, y.intersections));
}

/// What is listed of a step that was cut is listed of all of it, bit for bit.
void expectAmong(const Outcome& full, const Outcome& cut) {
  for (const Contact& c : cut.contacts) {
    const auto same = std::lower_bound(full.contacts.begin(), full.contacts.end(), c, canonicalLess);
    ASSERT_TRUE(same != full.contacts.end() && difference({c}, {*same}).empty()) << describe(c);
  }
}

// 900 vertices: 4.8 million pairs.
TEST(FoundLimit, ATrackerThatCollapsesDoesNotCostTheSquare) {
  constexpr std::size_t SIZE = 30;
  const std::size_t before = heapInUse();
  Detector detector(limited(2));
  for (const auto& [at_start, at_end] : {std::pair{false, true}, {true, true}, {true, false}}) {
    const Step step = collapsed(SIZE, at_start, at_end);
    const std::size_t limit = 2 * features(*step.bodies[0].topology);
    const Outcome outcome = detector.run(step);
    expectCut(outcome, limit);
    EXPECT_EQ(outcome.total_contacts, limit);
    EXPECT_EQ(outcome.contacts.size(), 1000u);
    EXPECT_LE(outcome.unchecked_toc_lower, 1);
    EXPECT_LE(outcome.stats[Stage::ELEMENTARY].in, limit + 4096) << "a chunk of pairs more at the most";
    EXPECT_LE(outcome.stats[Stage::START_STATE].in, limit + 4096);
    EXPECT_EQ(outcome.start_state, at_start ? StartState::INTERSECTING : StartState::CLEAR);
    EXPECT_EQ(outcome.start_state_complete, !at_start);
    EXPECT_LT(heapInUse() - before, 30 * MIB);
  }
}

// Zeros, more vertices than any that was tried, and two bodies that are the same.
TEST(FoundLimit, WhateverCoincidesDoesNotCostTheSquare) {
  std::vector<Step> steps = {collapsed(40, true, true), collapsed(30, false, true, Vec3::Zero()),
                             collapsed(30, true, true, Vec3::Zero())};
  Step twins = collapsed(40, false, false);
  twins.bodies.push_back(twins.bodies[0]);
  twins.bodies[1].name = "twin";
  for (Body& body : twins.bodies) body.t1 = share(movedBy(*body.t0, {0.001, 0.002, 0.003}));
  steps.push_back(twins);
  for (std::size_t i = 0; i < steps.size(); ++i) {
    std::size_t limit = 0;
    for (const Body& body : steps[i].bodies) limit += 2 * features(*body.topology);
    const std::size_t before = heapInUse();
    const Outcome outcome = runOnceWith(limited(2), steps[i]);
    SCOPED_TRACE(i);
    expectCut(outcome, limit);
    EXPECT_EQ(outcome.total_contacts, limit);
    EXPECT_LE(outcome.unchecked_toc_lower, i == 1 ? 1 : 0) << "everything else touches as early";
    EXPECT_LE(outcome.stats[Stage::ELEMENTARY].in, limit + 4096);
    EXPECT_LE(outcome.stats[Stage::START_STATE].in, 3 * limit / 2 + 4096) << "not all that is near meets";
    EXPECT_LT(heapInUse() - before, 60 * MIB);
  }
}

TEST(FoundLimit, WhatABurstMadeLargeIsGivenBack) {
  if (heapInUse() == 0) GTEST_SKIP() << "a sanitizer's heap does not tell";
  constexpr std::size_t SIZE = 14;
  Detector detector;
  const Step flat = collapsed(SIZE, false, false);
  detector.run(flat);
  const std::size_t before = heapInUse();
  {
    const Outcome burst = detector.run(collapsed(SIZE, true, true));
    EXPECT_GT(burst.contacts.size(), 150000u);
  }
  EXPECT_GT(heapInUse() - before, 10 * MIB);
  for (int i = 0; i < 3; ++i) detector.run(flat);
  EXPECT_LT(heapInUse(), before + 3 * MIB);
}

TEST(FoundLimit, TheCutIsTheSameForEveryThreadAndTarget) {
  const tbb::global_control more_than_cores(tbb::global_control::max_allowed_parallelism, 4);
  const TestStep step = crumpled(3, 2, 40);
  const Outcome full = runOnce(step, Options());
  ASSERT_GT(full.contacts.size(), 3000u);
  ASSERT_GT(full.intersections.size(), 100u);
  for (const std::size_t limit : {std::size_t{1}, std::size_t{50}, std::size_t{777}, full.contacts.size() - 1}) {
    Options options;
    options.max_found = limit;
    const Outcome cut = runOnce(step, options);
    expectCut(cut, limit);
    EXPECT_EQ(cut.total_contacts, limit);
    for (const Contact& truth : full.contacts) {
      const auto same = std::lower_bound(cut.contacts.begin(), cut.contacts.end(), truth, canonicalLess);
      if (same != cut.contacts.end() && difference({*same}, {truth}).empty()) continue;
      EXPECT_LE(cut.unchecked_toc_lower, truth.toc_upper) << describe(truth);
    }
    expectAmong(full, cut);
    for (const int threads : {2, 3, 4}) {
      options.num_threads = threads;
      expectSameAnswer(runOnce(step, options), cut);
    }
    options.num_threads = 2;
    forEachSimdTarget([&](const std::string& target) {
      SCOPED_TRACE(target);
      expectSameAnswer(runOnce(step, options), cut);
    });
    options.earliest_only = true;
    const Outcome first = runOnce(step, options);
    options.num_threads = 1;
    expectSameAnswer(runOnce(step, options), first);
  }
}

// Not a bit of an answer changes while the limit is not reached.
TEST(FoundLimit, ALimitThatIsNotReachedChangesNothing) {
  const TestStep step = crumpled(3, 2, 40);
  const Outcome full = runOnce(step, Options());
  Options options;
  options.max_found = std::max(full.contacts.size(), full.intersections.size());
  const Outcome whole = runOnce(step, options);
  EXPECT_FALSE(whole.cut);
  EXPECT_TRUE(whole.complete);
  EXPECT_TRUE(whole.claim.holds());
  expectSameAnswer(whole, full);
}

// Bodies that start apart: what is left out is the pairs that meet last, and the bound says so.
TEST(FoundLimit, TheBoundIsThatOfTheGroupsThatWereLeftOut) {
  TestStep step = crumpled(2, 2, 40);
  for (StepBody& body : step.bodies) body.self_collision = false;
  for (Vec3& x : step.bodies[1].t0) x[2] += 8;
  Options options;
  options.max_found = 10;
  const Outcome cut = runOnce(step, options);
  expectCut(cut, 10);
  EXPECT_GT(cut.unchecked_toc_lower, 0.1);
}

TEST(FoundLimit, TheMapIsCutAsWell) {
  const Step step = throughACheckerboard(40);
  const Outcome full = Detector().run(step);
  ASSERT_GT(full.contacts.size(), 5000u);
  Options options;
  options.max_found = 1000;
  const Outcome cut = Detector(options).run(step);
  expectCut(cut, 1000);
  EXPECT_EQ(cut.contacts.size(), 1000u);
  EXPECT_EQ(cut.unchecked_toc_lower, 0);
  expectAmong(full, cut);
  options.max_found = full.contacts.size();
  EXPECT_FALSE(Detector(options).run(step).cut);
  // What a step found is not counted in the next one.
  options.max_found = 1000;
  Detector again(options);
  again.run(step);
  expectSameAnswer(again.run(step), cut);
}

// A first contact is looked for in two searches: what the first one found counts once, before the map's turn, too.
TEST(FoundLimit, ALimitThatIsNotReachedLeavesTheMapItsShare) {
  Step step = crumpled(3, 2, 40).motion();
  step.map.surface = VoxelSurface::build(1.0, voxelsOfBox({0, 0, 0}, {40, 1, 1}));
  Options options;
  options.earliest_only = true;
  const Outcome full = runOnceWith(options, step);
  const std::uint64_t by_pairs = full.stats[Stage::SORT].out, by_map = full.stats[Stage::OBSTACLE].out;
  ASSERT_GT(by_pairs, 100u);
  ASSERT_GT(by_map, 10u);
  options.max_found = by_pairs + by_map;
  const Outcome whole = runOnceWith(options, step);
  EXPECT_FALSE(whole.cut);
  expectSameAnswer(whole, full);
  --options.max_found;
  EXPECT_TRUE(runOnceWith(options, step).cut);
}

// A task that ended early is one behind the cut.
TEST(FoundLimit, CutsInTheOrderOfTheTasks) {
  FoundLimit found;
  found.begin(10, 4);
  EXPECT_TRUE(found.add(2, 10)) << "those before may find nothing";
  EXPECT_FALSE(found.add(3, 1));
  EXPECT_TRUE(found.add(0, 4));
  EXPECT_FALSE(found.add(2, 0)) << "4 and 10 are enough";
  EXPECT_TRUE(found.add(1, 6)) << "just the limit";
  std::size_t listed = 99;
  EXPECT_EQ(found.cutTask(listed), 2u);
  EXPECT_EQ(listed, 0u);
  found.begin(10, 2);
  found.add(0, 4);
  found.add(1, 6);
  EXPECT_EQ(found.cutTask(listed), 2u) << "all are listed";
}

}  // namespace
}  // namespace test
}  // namespace dccd
