// An arm that says where it means to go, in a loop: it leaves a cloth that touches it, and goes along a table at 20 mm.
// By bounds alone it does neither. DEFORMABLE_CCD_LONG=1 runs 1,000 arms of each kind.
#include <gtest/gtest.h>

#include "support/path_loop.h"
#include "support/query_property.h"

namespace dccd {
namespace test {
namespace {

std::uint64_t arms() { return longRun() ? 1000 : 10; }

TEST(PathLoop, RetreatFromAClothThatTouchesArrivesAlwaysAndByBoundsAloneNever) {
  for (std::uint64_t seed = 1; seed <= arms(); ++seed) {
    const PathLoop::Run ours = PathLoop(seed, {0.1, 0, 0.3}, 0, PathLoop::Cloth::LIES).run(true);
    EXPECT_TRUE(ours.arrived) << seed;
    EXPECT_FALSE(ours.touched) << seed;
    EXPECT_FALSE(PathLoop(seed, {0.1, 0, 0.3}, 0, PathLoop::Cloth::LIES).run(false).arrived) << seed;
  }
}

TEST(PathLoop, AlongATableItIsAsFastAsWithNothingInItsWay) {
  double ours_m_s = 0, free_m_s = 0;
  for (std::uint64_t seed = 1; seed <= arms(); ++seed) {
    PathLoop loop(seed, {1, 0, 0}, 0.02, PathLoop::Cloth::NONE);
    const PathLoop::Run ours = loop.run(true);
    EXPECT_TRUE(ours.arrived) << seed;
    EXPECT_FALSE(ours.touched) << seed;
    ours_m_s += ours.mean_m_s;
    free_m_s += loop.freeSpeed();
    EXPECT_FALSE(PathLoop(seed, {1, 0, 0}, 0.02, PathLoop::Cloth::NONE).run(false).arrived) << seed;
  }
  EXPECT_GE(ours_m_s, 0.9 * free_m_s);
}

TEST(PathLoop, ATowelThatHangsFromTheHandDoesNotSlowTheHandThatLaysIt) {
  double ours_m_s = 0, bounds_m_s = 0;
  for (std::uint64_t seed = 1; seed <= arms(); ++seed) {
    const PathLoop::Run ours = PathLoop(seed, PathLoop::LAYS, 0.06, PathLoop::Cloth::HANGS).run(true),
                        bounds = PathLoop(seed, PathLoop::LAYS, 0.06, PathLoop::Cloth::HANGS).run(false);
    EXPECT_TRUE(ours.arrived) << seed;
    EXPECT_FALSE(ours.touched || bounds.touched) << seed;
    EXPECT_LT(ours.left_m_s, PathLoop::HANGS_M_S) << seed << ": what is assumed of the towel holds";
    ours_m_s += ours.mean_m_s;
    bounds_m_s += bounds.mean_m_s;
  }
  EXPECT_GE(ours_m_s, 1.5 * bounds_m_s);
}

TEST(PathLoop, DownOntoTheTableItStops) {
  for (std::uint64_t seed = 1; seed <= arms(); ++seed) {
    const PathLoop::Run ours = PathLoop(seed, {0.3, 0, -0.3}, 0.2, PathLoop::Cloth::NONE).run(true);
    EXPECT_FALSE(ours.arrived) << seed;
    EXPECT_FALSE(ours.touched) << seed;
  }
}

}  // namespace
}  // namespace test
}  // namespace dccd
