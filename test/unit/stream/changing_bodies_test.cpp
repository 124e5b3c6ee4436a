// Bodies that come and go in a stream: the step in which they do is answered with them, and of the others nothing is
// lost.
#include "record/step_replay.h"
#include "unit/stream/monitor_support.h"

namespace dccd {
namespace test {
namespace {

MonitorOptions withPatches() {
  MonitorOptions options = loose();
  options.detector.patches = true;
  return options;
}

/// A floor that is the clock, a tip above it, and others that come beside that.
class ChangingBodies : public ::testing::Test {
 protected:
  Monitor monitor{withPatches(), {named("floor"), named("tip")}};
  StampNs stamp_ns = 0;

  Outcome step(const std::vector<double>& heights) {
    stamp_ns += 100 * MS;
    for (std::size_t b = 0; b < heights.size(); ++b) push(b + 1, stamp_ns, heights[b]);
    monitor.countReceived(0);
    monitor.push(0, floor(stamp_ns, 0), NOW);
    return only(monitor);
  }
  void push(std::size_t body, StampNs at_ns, double z) {
    monitor.countReceived(body);
    MeshFrame frame = tip(at_ns, z);
    for (Vec3& p : frame.positions) p.y() = 0.5 * static_cast<double>(body) - 1;
    monitor.push(body, std::move(frame), NOW);
  }
  /// Where the next step begins, once there is a frame that it may begin at.
  StampNs start() const {
    const std::vector<StampNs> stamps = monitor.stampsToCome();
    return stamps.empty() ? 0 : stamps.front();
  }
  void come(std::size_t body, const std::string& name, double z) {
    monitor.setBody(body, named(name));
    push(body, start(), z);
  }
};

TEST_F(ChangingBodies, TheStepInWhichOneComesIsAnsweredWithIt) {
  step({1});
  EXPECT_TRUE(assuranceOf(step({1})).clear());
  come(2, "box", 1);
  const Outcome outcome = step({1, -0.5});
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_EQ(outcome.step->bodies.size(), 3u);
  EXPECT_TRUE(assuranceOf(outcome).proved);
  EXPECT_EQ(assuranceOf(outcome).touching, Touching::NEW);
  EXPECT_EQ(outcome.contacts.at(0).body[0] + outcome.contacts.at(0).body[1], 2) << "the box and the floor";
  EXPECT_EQ(replayStep({"", *outcome.step, monitor.options().detector, true, outcome}).differences.size(), 0u);
  expectAddsUp(monitor);
}

// Without frames where the next step begins nobody knows where it is, and no step is answered without it.
TEST_F(ChangingBodies, OneThatIsNotPlacedLeavesTheStepWithoutAnAnswer) {
  step({1});
  step({1});
  monitor.setBody(2, named("box"));
  const Outcome outcome = step({1, 1});
  EXPECT_EQ(outcome.status, StepStatus::NO_BODY);
  EXPECT_FALSE(assuranceOf(outcome).clear());
  EXPECT_TRUE(assuranceOf(step({1, 1})).clear());
}

// The patch of tip and floor goes on under its number; what touches since before is no news.
TEST_F(ChangingBodies, WhatTouchesElsewhereGoesOn) {
  step({1});
  const Outcome before = step({-0.5});
  ASSERT_EQ(before.patches.size(), 1u);
  ASSERT_TRUE(before.patches[0].is_new);
  come(2, "box", 3);
  for (const double z : {3.0, -0.5}) {  // the second time the box touches, too
    const Outcome outcome = step({-0.5, z});
    const auto tips = [](const Patch& patch) { return patch.body[1] == 1; };
    const auto tip = std::find_if(outcome.patches.begin(), outcome.patches.end(), tips);
    ASSERT_NE(tip, outcome.patches.end());
    EXPECT_EQ(tip->id, before.patches[0].id);
    EXPECT_FALSE(tip->is_new);
    for (const PatchEvent& event : outcome.patch_events) EXPECT_NE(event.kind, PatchEventKind::ENDED);
  }
  // It goes: its own patch ends, the other one does not.
  monitor.setBody(2, named("other"));
  push(2, start(), 5);
  const Outcome after = step({-0.5, 5});
  ASSERT_EQ(after.patches.size(), 1u);
  EXPECT_EQ(after.patches[0].id, before.patches[0].id);
  ASSERT_EQ(after.patch_events.size(), 1u);
  EXPECT_EQ(after.patch_events[0].kind, PatchEventKind::ENDED);
  EXPECT_EQ(after.patch_events[0].body[1], 2);
}

// One with fewer vertices before them: the numbers of all later vertices change.
TEST_F(ChangingBodies, WhatTouchesBehindABodyThatShrinksGoesOn) {
  come(2, "box", 5);
  step({5, -0.5});
  step({5, 1});
  const Outcome before = step({5, -0.5});
  ASSERT_EQ(before.patches.size(), 1u);
  monitor.setBody(1, named("nothing"));
  const auto nothing = share(Topology::fromTriangles(0, {}));
  const auto pushNothing = [&](StampNs at_ns) { monitor.push(1, {at_ns, nothing, {}}, NOW); };
  pushNothing(start());
  stamp_ns += 100 * MS;
  pushNothing(stamp_ns);
  push(2, stamp_ns, -0.5);
  monitor.push(0, floor(stamp_ns, 0), NOW);
  const Outcome outcome = only(monitor);
  ASSERT_EQ(outcome.status, StepStatus::OK) << outcome.reason;
  ASSERT_EQ(outcome.patches.size(), 1u);
  EXPECT_EQ(outcome.patches[0].id, before.patches[0].id);
  EXPECT_FALSE(outcome.patches[0].is_new);
  EXPECT_TRUE(outcome.patch_events.empty());
  EXPECT_TRUE(assuranceOf(outcome).excluded.empty()) << "what is not there is not left out";
  EXPECT_EQ(replayStep({"", *outcome.step, monitor.options().detector, true, outcome}).differences.size(), 0u);
}

// Steps wait for a body whose frames come late. They are answered with the one that came meanwhile.
TEST_F(ChangingBodies, StepsThatWaitAreAnsweredWithIt) {
  step({1});
  stamp_ns += 100 * MS;
  monitor.push(0, floor(stamp_ns, 0), NOW);
  Outcome outcome;
  ASSERT_FALSE(monitor.next(NOW, outcome)) << "waits for the tip";
  EXPECT_EQ(start(), stamp_ns - 100 * MS);
  come(2, "box", 1);
  push(2, stamp_ns, 1);
  push(1, stamp_ns, 1);
  ASSERT_TRUE(monitor.next(NOW, outcome));
  EXPECT_TRUE(assuranceOf(outcome).clear()) << outcome.reason;
  EXPECT_EQ(outcome.step->bodies.size(), 3u);
}

/// A rope of eight points that are `apart` from each other: straight, or as a hairpin whose ends are one such way
/// apart.
MeshFrame rope(StampNs stamp_ns, double apart, bool bent) {
  static const auto topology = std::make_shared<const Topology>(Topology::polyline(8));
  MeshFrame frame{stamp_ns, topology, {}};
  for (int i = 0; i < 8; ++i) frame.positions.push_back(apart * Vec3(bent ? std::min(i, 7 - i) : i, bent && i > 3, 0));
  return frame;
}

// Which of a body's features are neighbours follows from its first frame: 5 m of the rope lie between the segments at
// its ends, though later it has shrunk by half. Neither another body that comes, nor distances that are asked for only
// now, make another frame the first.
TEST(ChangingBodiesDistances, OfABodyAndItselfGoOn) {
  MonitorOptions options = loose();
  options.detector.clearance.self_m = 3.5;
  options.detector.clearance.wanted = true;
  Monitor monitor(options, {named("rope")});
  StampNs stamp_ns = 0;
  const auto step = [&](double apart, bool bent) {
    stamp_ns += 100 * MS;
    monitor.push(0, rope(stamp_ns, apart, bent), NOW);
    return only(monitor);
  };
  const auto expectMeasured = [](const Outcome& outcome) {
    ASSERT_FALSE(outcome.clearances.empty()) << outcome.reason;
    EXPECT_EQ(outcome.clearances[0].at_end.status, ClearanceStatus::MEASURED);
    EXPECT_NEAR(outcome.clearances[0].at_end.upper_m, 0.5, 1e-3);
  };
  step(1, false);
  step(0.5, true);
  expectMeasured(step(0.5, true));
  monitor.setBody(1, named("box"));
  monitor.push(1, tip(monitor.stampsToCome().front(), 50), NOW);
  monitor.push(1, tip(stamp_ns + 100 * MS, 50), NOW);
  expectMeasured(step(0.5, true));
  options.detector.clearance.wanted = false;
  Monitor later(options, {named("rope")});
  later.push(0, rope(0, 1, false), NOW);
  later.push(0, rope(100 * MS, 0.5, true), NOW);
  Outcome outcome;
  while (later.next(NOW, outcome)) EXPECT_TRUE(outcome.clearances.empty());
  options.detector.clearance.wanted = true;
  later.setOptions(options);
  later.push(0, rope(200 * MS, 0.5, true), NOW);
  expectMeasured(only(later));
}

TEST_F(ChangingBodies, WhatCannotBeIsRefusedAndAllStays) {
  step({1});
  Body apart = named("apart");
  apart.minimum_separation_m = 0.1;
  EXPECT_THROW(monitor.setBody(2, apart), std::invalid_argument) << "exact holds no distance";
  EXPECT_THROW(monitor.setBody(3, named("box")), std::invalid_argument) << "leaves one out";
  EXPECT_THROW(monitor.setBody(0, named("box")), std::invalid_argument) << "the clock";
  EXPECT_EQ(monitor.bodies().size(), 2u);
  EXPECT_TRUE(assuranceOf(step({1})).clear());
}

}  // namespace
}  // namespace test
}  // namespace dccd
