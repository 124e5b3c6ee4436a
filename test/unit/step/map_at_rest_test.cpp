// A body that does not move keeps its contacts with a map that does not change, and only then.
#include <gtest/gtest.h>

#include <atomic>

#include "support/shapes.h"

namespace dccd {
namespace test {
namespace {

struct OnAMap : testing::Test {
  const Positions lying = gridAt(12, 12, 0.1, {0.013, 0.017, 1});
  const std::shared_ptr<const VoxelSurface> map = surface(0);
  Detector keeps;
  std::uint64_t kept = 0;

  static std::shared_ptr<const VoxelSurface> surface(int missing) {
    std::vector<OccupiedLeaf> leaves = voxelsOfBox({missing, 0, 3}, {6, 6, 4});
    // A post beside the cloth, higher than it is lifted, so that the map's bounds reach it.
    leaves.push_back(voxelAt(8, 8, 4));
    return VoxelSurface::build(0.25, leaves);
  }
  /// The step's answer, which is that of a history of its own.
  Outcome run(const Positions& t0, const Positions& t1, const std::shared_ptr<const VoxelSurface>& on,
              double shift = 0) {
    Step step = stepOf(bodyOf("cloth", Topology::grid(12, 12)), t0, t1);
    step.map.surface = on;
    step.map.map_from_fixed.translation() = Vec3(shift, 0, 0);
    const Outcome with = keeps.run(step);
    const Outcome expected = Detector().run(step);
    EXPECT_EQ(difference(with.contacts, expected.contacts), "");
    EXPECT_EQ(with.start_state, expected.start_state);
    EXPECT_TRUE(with.claim.holds());
    EXPECT_EQ(with.intersections.size(), expected.intersections.size());
    kept = with.stats.map_answers_kept;
    return with;
  }
};

TEST_F(OnAMap, ItsContactsAreKeptWhileNothingChanges) {
  EXPECT_GT(run(lying, lying, map).contacts.size(), 100u);
  EXPECT_EQ(kept, 0u) << "nothing is known of a first step";
  run(lying, lying, map);
  EXPECT_EQ(kept, 0u) << "the first step that shows that it rests";
  run(lying, lying, map);
  EXPECT_EQ(kept, 1u);
  run(lying, lying, surface(1));
  EXPECT_EQ(kept, 0u) << "another map";
  run(lying, lying, map);
  run(lying, lying, map);
  EXPECT_EQ(kept, 1u);
  run(lying, lying, map, 0.01);
  EXPECT_EQ(kept, 0u) << "the map is elsewhere";
  run(lying, lying, map, 0.01);
  EXPECT_EQ(kept, 1u);
}

TEST_F(OnAMap, WhatMovesIsLookedAt) {
  for (int i = 0; i < 3; ++i) run(lying, lying, map);
  EXPECT_EQ(kept, 1u);
  const Positions lifted = movedBy(lying, {0, 0, 0.01});
  run(lying, lifted, map);
  EXPECT_EQ(kept, 0u);
  EXPECT_EQ(run(lifted, lifted, map).contacts.size(), 0u);
  run(lifted, lifted, map);
  EXPECT_EQ(run(lifted, lifted, map).contacts.size(), 0u);
  EXPECT_EQ(kept, 1u) << "also where there are none";
  run(lifted, lying, map);
  run(lying, lying, map);
  Positions one = lying;
  one[70].z() = std::nextafter(1.0, 2.0);
  run(lying, one, map);
  EXPECT_EQ(kept, 0u) << "one vertex by one representable number";
}

TEST_F(OnAMap, ASeamAndOtherOptionsForget) {
  for (int i = 0; i < 3; ++i) run(lying, lying, map);
  EXPECT_EQ(kept, 1u);
  keeps.history().clear();
  EXPECT_TRUE(keeps.history().isClear());
  run(lying, lying, map);
  EXPECT_EQ(kept, 0u);
  for (int i = 0; i < 2; ++i) run(lying, lying, map);
  EXPECT_EQ(kept, 1u);
  Options forget;
  forget.keep_bounds = false;
  keeps.setOptions(forget);
  run(lying, lying, map);
  EXPECT_EQ(kept, 0u);
}

// What rests within its separation of the map is tested anew where nothing is kept, and the deadline may end that.
TEST_F(OnAMap, WhatTheDeadlineLeftUndecidedIsNotKept) {
  Body cloth;
  cloth.name = "cloth";
  cloth.topology = share(Topology::grid(3, 3));
  cloth.minimum_separation_m = 0.1;
  Positions near;
  for (int i = 0; i < 9; ++i) near.emplace_back(0.5 * (i % 3) + 0.013, 0.5 * (i / 3) + 0.017, 1.05);
  Step step = stepOf(cloth, near, near), before = step;
  before.map.surface = surface(1);
  step.map.surface = map;
  Options options;
  options.accuracy.rung = Accuracy::CONSERVATIVE;
  const Outcome whole = Detector(options).run(step);
  ASSERT_EQ(whole.counts.undecided, 0u);
  int cut = 0;
  std::int64_t looks = 0;
  for (bool ended = false; !ended; ++looks) {
    History history;
    detect(before, options, history);
    std::atomic<std::int64_t> left{looks};
    const Outcome late = detect(step, options, history, Deadline::afterLooks(left));
    ended = late.complete;
    cut += late.counts.undecided > 0;
    EXPECT_TRUE(!late.complete || difference(late.contacts, whole.contacts).empty()) << looks;
    EXPECT_EQ(difference(detect(step, options, history).contacts, whole.contacts), "") << "after " << looks << " looks";
  }
  EXPECT_GT(cut, 3);
}

}  // namespace
}  // namespace test
}  // namespace dccd
