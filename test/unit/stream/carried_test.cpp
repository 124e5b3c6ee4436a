// A body that another one carries: how fast the two come together, and what breaks that.
#include <gtest/gtest.h>

#include "dccd/intended.h"
#include "support/closed_meshes.h"
#include "support/said.h"

namespace dccd {
namespace test {
namespace {

/// A hand, a towel 0.2 m below it, and a pad 0.3 m below that; the hand goes and turns, and the towel goes with it.
struct HandWithTowel {
  Step step;
  std::vector<SpeedBound> bounds{{0.5}, {0.5}, {0.1}};
  Options options;
  History history;
  HandWithTowel() {
    TestStep scene;
    scene.bodies = {box({0, 0, 0.5}, {0.1, 0.1, 0.6}), sheet(3, 3, {0, 0, 0.3}, 0.05),
                    box({0, 0, -0.1}, {0.1, 0.1, 0})};
    step = scene.motion();
    const char* names[] = {"hand", "towel", "pad"};
    for (std::size_t b = 0; b < 3; ++b) {
      step.bodies[b].name = names[b];
      step.bodies[b].self_collision = false;
    }
    step.bodies[0].rigid = true;
    step.start_ns = 0;
    step.stamp_ns = 100000000;
    bounds[1].carrier = 0;
    bounds[1].relative_m_s = 0.1;
    options.clearance.wanted = true;
    options.clearance.max_m = 1;
  }
  Outcome next(const Eigen::Isometry3d& moved, const Vec3& left) {
    for (std::size_t b = 0; b < 2; ++b) {
      Body& body = step.bodies[b];
      Positions at = *body.t1;
      for (Vec3& p : at) p = moved * p + (b == 1 ? left : Vec3(Vec3::Zero()));
      body.t0 = std::exchange(body.t1, share(at));
      body.pose_t0 = body.pose_t1;
      if (b == 0) body.pose_t1 = moved * body.pose_t1;
    }
    step.start_ns = std::exchange(step.stamp_ns, step.stamp_ns + 100000000);
    return detect(step, options, history);
  }
};

TEST(Carried, TowardsItsCarrierItIsAsFastAsItLeavesIt) {
  HandWithTowel one;
  const Outcome outcome = detect(one.step, one.options, one.history);
  EXPECT_NEAR(safeUntil(outcome, one.bounds).seconds(), 0.3 / 0.6, 1e-3) << "the pad, by bounds";
  one.bounds[2].max_m_s = 0;
  one.bounds[1].max_m_s = 0.01;
  EXPECT_NEAR(safeUntil(outcome, one.bounds).seconds(), 0.5 / 0.5, 1e-3) << "hand and pad; towel and hand come later";
  one.bounds[0].max_m_s = SpeedBound::NONE;
  one.step.bodies[0].not_against = {2};
  one.step.bodies[2].not_against = {0};
  History history;
  const Outcome without = detect(one.step, one.options, history);
  EXPECT_NEAR(safeUntil(without, one.bounds).seconds(), 0.2 / 0.1, 1e-2) << "no bound of the hand is needed";
  one.bounds[1].carrier = SpeedBound::NO_CARRIER;
  EXPECT_EQ(safeUntil(without, one.bounds).seconds(), 0);
}

TEST(Carried, AFrameThatShowsItFasterVoidsThePromise) {
  Eigen::Isometry3d moved(Eigen::Translation3d(0.02, 0, 0) * Eigen::AngleAxisd(0.05, Vec3::UnitY()));
  for (const double left_m : {0.009, 0.011}) {
    HandWithTowel one;
    PromiseWatch watch;
    watch.setBounds(one.bounds);
    watch.follow(detect(one.step, one.options, one.history));
    ASSERT_TRUE(watch.promise().isPromise());
    watch.follow(one.next(moved, {0, left_m, 0}));
    EXPECT_EQ(mentions(watch.broken(), "body 'towel' left 'hand' by more than 0.1 m/s: vertex 0 by"), left_m > 0.01)
        << watch.broken();
  }
  HandWithTowel stays;
  PromiseWatch watch;
  watch.setBounds(stays.bounds);
  watch.follow(detect(stays.step, stays.options, stays.history));
  moved.linear().setIdentity();
  watch.follow(stays.next(moved, {-0.02, 0, 0}));
  EXPECT_TRUE(mentions(watch.broken(), "left 'hand'")) << "it did not move, but its carrier did";
}

TEST(Carried, BoundsThatAreNoneAreNamed) {
  HandWithTowel one;
  const Outcome outcome = detect(one.step, one.options, one.history);
  one.bounds[1].relative_m_s = -1;
  EXPECT_TRUE(
      mentions(said<std::invalid_argument>([&] { safeUntil(outcome, one.bounds); }), "'towel' has relative_m_s -1"));
}

}  // namespace
}  // namespace test
}  // namespace dccd
