// ~safe_until and ~speed_scale of a live node; examples/slow_the_arm in C++ and Python.
#include <deformable_ccd/Limits.h>
#include <deformable_ccd/SafeUntil.h>
#include <deformable_ccd/SpeedScale.h>
#include <deformable_ccd/State.h>
#include <deformable_ccd/StepStats.h>
#include <geometry_msgs/TwistStamped.h>
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <std_msgs/Float64.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>

#include <algorithm>
#include <array>
#include <vector>

#include "ros/support/live_tests.h"
#include "ros/support/meshes.h"
#include "ros/support/probe.h"

namespace dccd {
namespace test {
namespace {

// A hand that wants to go down and aside, 0.1 m above what comes no nearer: it may go down as fast as the half-space
// says, less what it went since the stamp, and aside as it likes, until the limits are old or something is unknown.
TEST(GuardTwist, BothClientsChangeTheTwistLeastAndStandWhereNothingIsKnown) {
  ros::NodeHandle node;
  std::array<Probe<geometry_msgs::TwistStamped>, 2> twists{
      Probe<geometry_msgs::TwistStamped>(node, "/guard_cpp/twist"),
      Probe<geometry_msgs::TwistStamped>(node, "/guard_python/twist")};
  ros::Publisher monitor = advertiseAndWait<deformable_ccd::Limits>(node, "/played/limits", false, 2);
  ros::Publisher wanted = advertiseAndWait<geometry_msgs::TwistStamped>(node, "/wanted", false, 2);
  deformable_ccd::Limits limits;
  limits.horizon = 0.5;
  limits.links = {"hand", "hand/2"};  // of two collision elements: the second one is what is limited
  limits.origins.resize(2);
  limits.reaches = {0.1, 0.1};
  limits.most_speed = 2;
  limits.link = {1};
  limits.partners = {"octomap"};
  limits.corners.resize(8);
  limits.normals.resize(1);
  limits.normals[0].z = -1;
  limits.speeds = {0.2};
  ros::Duration ahead{0};  // of the clock of who wants it
  const auto expectTwist = [&](bool renews, double down_m_s, double aside_m_s, const std::string& why) {
    EXPECT_TRUE(waitUntil([&] {
      if (renews) {
        limits.header.stamp = ros::Time::now();
        monitor.publish(limits);
      }
      geometry_msgs::TwistStamped asked;
      asked.header.stamp = ros::Time::now() + ahead;
      asked.twist.linear.x = 0.3;
      asked.twist.linear.z = -1;
      wanted.publish(asked);
      ros::WallDuration(0.03).sleep();
      return std::all_of(twists.begin(), twists.end(), [&](auto& told) {
        const auto& v = told.last().twist.linear;
        return told.count() > 0 && std::abs(v.z + down_m_s) < 0.03 && std::abs(v.x - aside_m_s) < 1e-6;
      });
    })) << why
        << ": " << twists[0].last().twist.linear << twists[1].last().twist.linear;
  };
  expectTwist(true, 0.2, 0.3, "down as fast as it may");
  expectTwist(false, 0, 0, "the limits are old");
  limits.speeds = {2};
  expectTwist(true, 1, 0.3, "nothing limits it");
  ahead = ros::Duration(60);
  expectTwist(true, 0, 0, "what is wanted only in a minute");
  ahead = ros::Duration(0);
  limits.links[0] = "arm";
  limits.links[1] = "arm/2";
  expectTwist(true, 0, 0, "of the hand nothing is said");
  limits.links[0] = "hand";
  limits.links[1] = "hand/2";
  limits.most_speed = 0.5;
  expectTwist(true, 0.5 / std::sqrt(1.09), 0.15 / std::sqrt(1.09), "nor is it faster than all links may be");
  limits.unknown = {"nobody knows"};
  expectTwist(true, 0, 0, "something is not known");
}

struct SlowTheArm : ::testing::Test {
  ros::NodeHandle node;
  std::array<Probe<std_msgs::Float64>, 2> scales{Probe<std_msgs::Float64>(node, "/cpp/scale"),
                                                 Probe<std_msgs::Float64>(node, "/python/scale")};
  ros::Publisher monitor = advertiseAndWait<deformable_ccd::SpeedScale>(node, "/played/speed_scale", true, 2);
  ros::Time holds_until{1000};

  /// The monitor says this of a new frame, or of the same again, until both clients say steadily what is wanted. What
  /// they said meanwhile, and the last word before it.
  std::array<std::vector<double>, 2> expectScale(double said, bool new_frames, double wanted, const std::string& why) {
    std::array<std::vector<double>, 2> all;
    std::array<std::size_t, 2> seen{}, steady{};
    for (std::size_t c = 0; c < 2; ++c) {
      seen[c] = scales[c].count();
      all[c].push_back(scales[c].last().data);
    }
    EXPECT_TRUE(waitUntil([&] {
      deformable_ccd::SpeedScale message;
      message.scale = said;
      if (new_frames) holds_until += ros::Duration(0.03);
      message.holds_until = holds_until;
      monitor.publish(message);
      ros::WallDuration(1.0 / 30).sleep();
      for (std::size_t c = 0; c < 2; ++c) {
        const auto told = scales[c].all();
        for (; seen[c] < told.size(); ++seen[c]) {
          all[c].push_back(told[seen[c]].data);
          steady[c] = all[c].back() == wanted ? steady[c] + 1 : 0;
        }
      }
      return steady[0] >= 5 && steady[1] >= 5;
    })) << why
        << ": cpp " << all[0].back() << ", python " << all[1].back();
    return all;
  }
};

TEST_F(SlowTheArm, TakesTheScaleAsLongAsItIsNews) {
  for (const auto& scale : scales) EXPECT_EQ(scale.after(0).data, 0) << "nothing has been heard";
  expectScale(0.25, true, 0.25, "as it is said");
  expectScale(1, true, 1, "full speed");
  for (const std::vector<double>& said : expectScale(0, true, 0, "nothing is proved")) {
    for (const double one : said) EXPECT_TRUE(one == 1 || one == 0) << "it falls at once, not by and by: " << one;
  }
  for (const std::vector<double>& said : expectScale(1, true, 1, "it rises again")) {
    double steepest = 0;
    for (std::size_t i = 1; i < said.size(); ++i) steepest = std::max(steepest, said[i] - said[i - 1]);
    EXPECT_NEAR(steepest, 0.04, 1e-9) << "evenly, 2 a second";
  }
  expectScale(1, false, 0, "the same frame again and again, which grows old");
  expectScale(2, true, 1, "never more than full speed");
}

TEST(LiveNode, PromisesSlowsDownAndSaysWhatWasVoid) {
  ros::NodeHandle node;
  const std::string name = "/collision_monitor";
  Probe<deformable_ccd::SafeUntil> promises(node, name + "/safe_until");
  Probe<deformable_ccd::SpeedScale> scales(node, name + "/speed_scale");
  Probe<std_msgs::Float64> values(node, name + "/speed_scale/value");
  Probe<deformable_ccd::State> states(node, name + "/state");
  Probe<deformable_ccd::StepStats> stats(node, name + "/stats");
  const auto floor = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/floor", true);
  const auto publisher = advertiseAndWait<deformable_ccd::MeshStamped>(node, "/tip");
  // The tracker's clock is 5 s behind.
  double stamp_s = ros::Time::now().toSec() - 5;
  floor.publish(meshStamped({{{-1, -1, 0}, {1, -1, 0}, {0, 1, 0}}, {{0, 1, 2}}}, stamp_s));
  EXPECT_EQ(scales.after(0).scale, 0) << "latched, before the first frame";
  EXPECT_FALSE(scales.last().reason.empty());
  // A tip of at most 0.5 m/s above a floor. At full speed S_p is 0.5 (0.4 + 0.2 / 2) + 0.02 m.
  const auto send = [&](double height) {
    const std::size_t seen = promises.count(), said = stats.count();
    publisher.publish(
        meshStamped({{{0, 0, height}, {0.5, 0, height + 1}, {-0.5, 0, height + 1}}, {{0, 1, 2}}}, stamp_s += 0.1));
    stats.after(said);
    return promises.after(seen);
  };
  const auto scaleOf = [&](const deformable_ccd::SafeUntil& promise) {
    deformable_ccd::SpeedScale first;
    EXPECT_TRUE(waitUntil([&] {
      for (const auto& one : scales.all()) {
        first = one;
        if (one.holds_until == promise.header.stamp) return true;
      }
      return false;
    }));
    return first;
  };
  send(0.45);
  const auto old = send(0.45);
  EXPECT_EQ(old.reason, "");
  EXPECT_LT(old.left, -3) << "the promise is over";
  EXPECT_EQ(scaleOf(old).scale, 0);
  const std::string clocks = scaleOf(old).reason;
  EXPECT_NE(clocks.find("after its stamp, which alone is more than the reaction time of 0.4 s: the clock of the stamps "
                        "and the monitor's (ros::Time) differ"),
            std::string::npos)
      << clocks;
  stamp_s += 5;
  send(0.45);
  const auto far = send(0.45);
  EXPECT_EQ(far.reason, "");
  EXPECT_NEAR(far.distance, 0.45, 2e-4);
  EXPECT_LE(far.distance, 0.45);
  EXPECT_NEAR(far.closing_speed, 0.5, 1e-9);
  EXPECT_NEAR(far.seconds, 0.9, 5e-4);
  EXPECT_NEAR((far.until - far.header.stamp).toSec(), far.seconds, 2e-9);
  EXPECT_EQ(far.bodies[0], "floor");
  EXPECT_EQ(far.bodies[1], "tip");
  EXPECT_EQ(far.most, 10);
  EXPECT_EQ(far.assumed, (std::vector<std::string>{"'floor' stands still", "no vertex of 'tip' is faster than 0.5 m/s",
                                                   "nothing was checked against a map"}));
  EXPECT_EQ(scaleOf(far).scale, 1);
  const auto near = send(0.43);
  EXPECT_EQ(near.broken, "") << "0.02 m in 0.1 s";
  const auto fast = send(0.25);
  EXPECT_NE(fast.broken.find("'tip' was faster than 0.5 m/s: vertex 0 came 0.18 m in "), std::string::npos)
      << fast.broken;
  EXPECT_TRUE(waitUntil([&] {
    const auto said = states.all();
    return std::any_of(said.begin(), said.end(), [](const deformable_ccd::State& state) {
      return state.proved && state.reason.find("the promise of ~safe_until was void") != std::string::npos;
    });
  })) << "of this step all is known, "
      << states.last().reason;
  EXPECT_EQ(stats.last().promises, 4u) << "the first frame has no answer, nor the one after the clock was set";
  EXPECT_EQ(stats.last().promises_kept, 2u);
  EXPECT_EQ(stats.last().promises_broken, 1u) << "and the last one nobody has looked at";
  const auto slow = scaleOf(fast);
  EXPECT_LT(slow.scale, 1);
  EXPECT_GT(slow.scale, 0.5);
  EXPECT_NEAR(slow.needed, 0.27, 1e-9);
  // No frame follows.
  EXPECT_TRUE(waitUntil([&] { return scales.last().scale == 0; }, 2)) << "0.4 s are the reaction time";
  EXPECT_EQ(values.last().data, 0);
  // What is latched does not outlive the frames that it was made of.
  const auto expectNone = [&](const std::string& since) {
    const std::string why = "no frame has been answered since " + since;
    EXPECT_TRUE(waitUntil([&] { return promises.last().reason == why; })) << promises.last().reason;
    EXPECT_EQ(promises.last().seconds, 0) << why;
    EXPECT_EQ(promises.last().until, promises.last().header.stamp) << why;
  };
  std_srvs::Trigger reset;
  ASSERT_TRUE(ros::service::call(name + "/reset", reset));
  expectNone("the reset");
  send(0.45);
  EXPECT_GT(send(0.45).seconds, 0);
  std_srvs::SetBool enable;
  ASSERT_TRUE(ros::service::call(name + "/enable", enable));
  expectNone("~enable was called");
}

}  // namespace
}  // namespace test
}  // namespace dccd

int main(int argc, char** argv) { return dccd::test::runLiveTests(argc, argv, "slow_the_arm_test"); }
