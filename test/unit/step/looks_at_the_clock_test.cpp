// The work between two looks at the clock, counted: the deadline of these tests is over at a look, not at a time.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>

#include "support/checkerboard.h"
#include "support/looks.h"
#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

Step cloth(std::size_t side, const std::function<Vec3(std::size_t)>& t0, const std::function<Vec3(std::size_t)>& t1) {
  Positions from, to;
  for (std::size_t i = 0; i < side * side; ++i) {
    from.push_back(t0(i));
    to.push_back(t1(i));
  }
  return stepOf(bodyOf("cloth", Topology::grid(side, side)), from, to);
}

/// Coordinates from the smallest denormal double to 0.1 m.
Step anySize(std::size_t side) {
  const Draw draw = drawFrom(8);
  const auto any = [&](std::size_t) {
    Vec3 x;
    for (int axis = 0; axis < 3; ++axis) x[axis] = std::ldexp(draw(-999, 999) / 1000.0, draw(-1074, -4));
    return x;
  };
  return cloth(side, any, any);
}

Step collapse(std::size_t side) {
  const auto flat = [side](std::size_t i) {
    return Vec3(0.01 * static_cast<double>(i % side), 0.012 * static_cast<double>(i / side), 0);
  };
  return cloth(side, flat, [](std::size_t) { return Vec3(0.1, 0.2, 0.3); });
}

/// What takes time, and how much of it may lie between two looks: less than half a millisecond.
std::map<std::string, std::pair<std::uint64_t, std::uint64_t>> workOf(const StepStats& stats) {
  std::uint64_t slow = 0;
  for (std::size_t tier = 0; tier < stats.tiers.settled.size(); ++tier) {
    if (static_cast<Tier>(tier) != Tier::DOUBLE_BATCH) slow += stats.tiers.settled[tier];
  }
  return {{"clusters against clusters", {stats[Stage::BROAD_PHASE].in / 256, 2048}},
          {"pairs in the planar filter", {stats[Stage::PLANAR].in, 4096}},
          {"pairs in the elementary test", {stats[Stage::ELEMENTARY].in, 4096}},
          {"pairs that the batch leaves", {slow, 1}},
          {"pairs with the map", {stats[Stage::OBSTACLE].in, 8192}},
          // Most are left to a filter of faces, as fast as the planar one.
          {"pairs of the start state", {stats[Stage::START_STATE].in, 4096}}};
}

TEST(LooksAtTheClock, BetweenTwoLiesLittleWork) {
  const std::pair<std::string, Step> attacks[] = {{"coordinates of any size", anySize(4)},
                                                  {"a cloth that collapses", collapse(10)},
                                                  {"crumpled sheets", crumpled(3, 2, 20).motion()},
                                                  {"a checkerboard", throughACheckerboard(24)}};
  constexpr int SAMPLES = 24;
  for (const auto& [name, step] : attacks) {
    const Options options;
    const std::int64_t looks = looksOf(step, options);
    ASSERT_GT(looks, 2 * SAMPLES) << name;
    for (int sample = 0; sample < SAMPLES; ++sample) {
      const std::int64_t at = looks * sample / SAMPLES + sample % 3;
      const Outcome before = runFor(at, step, options), after = runFor(at + 1, step, options);
      EXPECT_FALSE(before.complete) << name << ", look " << at << " of " << looks;
      EXPECT_FALSE(before.claim.holds());
      const std::vector<Gap>& gaps = before.claim.gaps();
      const bool any_pair = std::any_of(gaps.begin(), gaps.end(), [](const Gap& gap) { return !gap.at_start; });
      EXPECT_EQ(any_pair, !before.allPairs()) << name << ", look " << at << " of " << looks;
      const auto work_before = workOf(before.stats);
      for (const auto& [what, done] : workOf(after.stats)) {
        const std::uint64_t least = std::min(done.first, work_before.at(what).first);
        EXPECT_LE(done.first - least, done.second) << name << ", look " << at << " of " << looks << ": " << what;
      }
    }
  }
}

// A mesh so large that its bounds alone take longer than a budget: no pair is looked at, and the next step knows that.
TEST(LooksAtTheClock, BoundsOfALargeMeshAreMadeInPieces) {
  const TestStep whole = crumpled(2, 1, 150);
  const Step step = whole.motion();
  std::size_t groups = 0;
  for (const std::size_t features :
       {step.bodies[0].topology->edges().size(), step.bodies[0].topology->faces().size()}) {
    groups += features / 16;
  }
  const auto looks = static_cast<std::int64_t>(groups / 256);
  ASSERT_GT(looks, 20);
  Options options;
  options.check_start_state = false;
  History history;
  const Outcome cut = runFor(looks, step, options, history);
  EXPECT_EQ(cut.status, StepStatus::DEADLINE);
  EXPECT_FALSE(cut.complete);
  EXPECT_FALSE(cut.claim.holds());
  EXPECT_EQ(cut.unchecked_toc_lower, 0);
  EXPECT_TRUE(cut.contacts.empty());
  EXPECT_EQ(cut.stats[Stage::BROAD_PHASE].in, 0u);
  // Nothing of bounds that were not made is kept.
  const Outcome again = runFor(MANY, step, options, history), fresh = runFor(MANY, step, options);
  EXPECT_TRUE(again.complete);
  EXPECT_TRUE(again.claim.isCovered());
  ASSERT_GT(fresh.contacts.size(), 1000u);
  EXPECT_EQ(difference(again.contacts, fresh.contacts), "");
}

}  // namespace
}  // namespace test
}  // namespace dccd
