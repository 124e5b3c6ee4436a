// A recorded step is answered again: the same bits on every rung, SIMD target and number of threads; one bit is a
// difference.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "dccd/monitor_extras.h"
#include "record/step_replay.h"
#include "support/recordings.h"
#include "support/step_support.h"
#include "unit/record/recording_support.h"

namespace dccd {
namespace test {
namespace {

TEST(StepReplay, EveryRungAndTargetAndNumberOfThreadsGivesTheSameBits) {
  const std::string before = simdTarget();
  for (const Accuracy rung : {Accuracy::CONSERVATIVE, Accuracy::EXACT}) {
    const StepRecording r = again(recordScene(with(rung)));
    ASSERT_FALSE(r.answer.contacts.empty()) << toString(rung);
    for (const std::string& target : simdTargets()) {
      setSimdTarget(target);
      for (const int threads : {1, 3}) {
        const StepReplay replay = replayStep(r, threads);
        EXPECT_TRUE(replay.differences.empty())
            << toString(rung) << ' ' << target << ": " << replay.differences.front();
        EXPECT_EQ(replay.answer.contacts.size(), r.answer.contacts.size());
      }
    }
  }
  setSimdTarget(before);
}

TEST(StepReplay, DistancesAndWhatTheyLeaveOutAreRecordedToo) {
  const StepRecording without = recordScene(with(Accuracy::CONSERVATIVE));
  const StepRecording r = again(recordScene(with(Accuracy::CONSERVATIVE), true, true));
  ASSERT_EQ(r.step.bodies[0].radius_m->size(), 20u);
  EXPECT_EQ((*r.step.bodies[0].radius_m)[7], 3e-3);
  ASSERT_TRUE(r.step.bodies[0].reference) << "its first frame";
  EXPECT_NE(*r.step.bodies[0].reference, *r.step.bodies[0].t0);
  ASSERT_EQ(r.step.bodies[2].separations.size(), 1u);
  EXPECT_EQ(r.step.bodies[2].separations[0].separation_m, 0.15);
  EXPECT_GT(r.answer.contacts.size(), without.answer.contacts.size());
  for (const int threads : {1, 3}) {
    const StepReplay replay = replayStep(r, threads);
    EXPECT_TRUE(replay.differences.empty()) << replay.differences.front();
  }
  // Each of them matters: without it the answer is another.
  const auto differs = [&r](const std::function<void(StepRecording&)>& change) {
    StepRecording changed = r;
    change(changed);
    return !replayStep(changed).differences.empty();
  };
  EXPECT_TRUE(differs([](StepRecording& c) { c.step.bodies[0].radius_m = share(std::vector<double>(20, 0.05)); }));
  EXPECT_TRUE(differs([](StepRecording& c) { c.step.bodies[2].separations.clear(); }));
  EXPECT_TRUE(differs([](StepRecording& c) { c.step.bodies[0].not_against = {2}; }));
  EXPECT_TRUE(differs([](StepRecording& c) {
    Positions spread = *c.step.bodies[0].reference;
    for (Vec3& p : spread) p *= 10;  // nothing is close in it, so nothing is left out
    c.step.bodies[0].reference = share(spread);
  }));
}

TEST(StepReplay, WithoutAMapTheStatusIsTheSame) {
  const StepRecording r = recordScene(with(Accuracy::EXACT), false);
  EXPECT_EQ(r.answer.status, StepStatus::NO_MAP);
  const StepReplay replay = replayStep(r);
  EXPECT_EQ(replay.answer.status, StepStatus::NO_MAP);
  EXPECT_TRUE(replay.differences.empty());
}

TEST(StepReplay, WhatWasLeftOutBeforeTheStepIsNoDifference) {
  MonitorOptions options;
  options.detector.excluded = {"rigid body 'finger' by effects/rigid_bodies: off"};
  const StepRecording read = again(recordScene(options));
  ASSERT_FALSE(read.answer.excluded.empty());
  EXPECT_TRUE(read.options.excluded.empty()) << "no option that changes an answer";
  EXPECT_TRUE(replayStep(read).differences.empty());
}

TEST(StepReplay, OneBitIsADifference) {
  StepRecording r = recordScene();
  ASSERT_FALSE(r.answer.contacts.empty());
  r.answer.contacts.back().toc_lower = std::nextafter(r.answer.contacts.back().toc_lower, 2);
  EXPECT_EQ(replayStep(r).differences.size(), 1u);
  r.answer.contacts.pop_back();
  EXPECT_FALSE(replayStep(r).differences.empty());
}

TEST(StepReplay, AStepThatRanOutOfItsBudgetIsConfirmed) {
  StepRecording r = recordScene();
  r.options.step_budget_ms = 1e-6;
  r.answer.complete = false;
  r.answer.status = StepStatus::DEADLINE;
  r.answer.contacts.resize(1);
  const StepReplay replay = replayStep(r);
  EXPECT_TRUE(replay.answer.complete) << "nobody waits for it";
  EXPECT_TRUE(replay.differences.empty()) << "the rest was left out, which is no contradiction";
  r.answer.contacts[0].vertex[0] += 1;
  EXPECT_FALSE(replayStep(r).differences.empty());
}

TEST(StepReplay, OfAStepThatRanOutOfItsBudgetTheFirstAreEnoughWhereNoOthersAreListed) {
  StepRecording r;
  TestStep falls = crossing();
  for (Vec3& x : falls.bodies[1].t1) x.z() -= 2;
  r.step = falls.motion();
  History history;
  r.answer = detect(r.step, r.options, history);
  r.answer.complete = false;
  r.has_answer = true;
  ASSERT_GT(r.answer.contacts.size(), 1u);
  const auto differ = [&r](bool earliest_only, std::size_t max_contacts) {
    r.options.earliest_only = earliest_only;
    r.options.max_contacts = max_contacts;
    return !replayStep(r).differences.empty();
  };
  EXPECT_FALSE(differ(true, r.answer.contacts.size()));
  EXPECT_FALSE(differ(false, 1));
  ASSERT_EQ(r.answer.earliest_toc, 0.25);
  r.answer.contacts.back().toc_lower = r.answer.contacts.back().toc_upper = 0.125;
  EXPECT_TRUE(differ(true, r.answer.contacts.size())) << "before the first one";
  EXPECT_TRUE(differ(false, 1));
  r = recordScene();
  r.answer.complete = false;
  r.options.suppress_initial = true;
  EXPECT_FALSE(differ(true, r.answer.contacts.size())) << "the first one is left out";
}

TEST(StepReplay, OfAStepThatRanOutOfItsBudgetWhatIsCertainMayTakeLonger) {
  StepRecording r = recordScene();
  r.answer.complete = false;
  Contact& c = r.answer.contacts.front();
  const Contact certain = c;
  c.toc_lower = 0;
  c.toc_upper = 1;
  EXPECT_TRUE(replayStep(r).differences.empty());
  c.toc_lower = certain.toc_upper;
  EXPECT_EQ(replayStep(r).differences.size(), 1u);
  c = certain;
  c.leaving = !c.leaving;
  EXPECT_EQ(replayStep(r).differences.size(), 1u);
}

/// The second of two steps, whose clusters were made of where the sheet was in the first.
StepRecording recordAfterAnother(const Options& options) {
  StepRecording r;
  r.step = crumpled(1, 1, 16).motion();
  std::swap(r.step.bodies[0].t0, r.step.bodies[0].t1);  // so that it crosses itself when it begins
  r.options = options;
  Step before = r.step;
  before.bodies[0].t0 = share(Positions(r.step.bodies[0].t0->rbegin(), r.step.bodies[0].t0->rend()));
  History history;
  detect(before, options, history);
  r.answer = detect(r.step, options, history);
  r.has_answer = true;
  return r;
}

TEST(StepReplay, WhatALimitLeavesDependsOnTheStepsBeforeAndIsNoDifference) {
  Options options;
  options.max_found = 20;
  StepRecording r = recordAfterAnother(options);
  ASSERT_TRUE(r.answer.cut);
  const StepReplay replay = replayStep(r);
  EXPECT_NE(difference(r.answer.contacts, replay.answer.contacts), "") << "else it shows nothing";
  EXPECT_TRUE(replay.differences.empty()) << replay.differences.front();
  r.answer.contacts = replay.answer.contacts;
  r.answer.contacts[0].toc_lower = std::nextafter(r.answer.contacts[0].toc_lower, 2);
  EXPECT_EQ(replayStep(r).differences.size(), 1u);
}

TEST(StepReplay, WhichCrossingIsListedAloneDependsOnTheStepsBeforeAndIsNoDifference) {
  Options options;
  options.earliest_only = options.patches = true;
  StepRecording r = recordAfterAnother(options);
  ASSERT_EQ(r.answer.intersections.size(), 1u);
  const StepReplay replay = replayStep(r);
  EXPECT_FALSE(r.answer.intersections[0] == replay.answer.intersections.at(0)) << "else it shows nothing";
  EXPECT_TRUE(replay.differences.empty()) << replay.differences.front();
  r.answer.intersections.clear();
  EXPECT_EQ(replayStep(r).differences.size(), 1u) << "whether any crosses is no matter of luck";
}

TEST(StepReplay, AStepWithoutAnAnswerIsComputed) {
  StepRecording r = recordScene();
  const std::size_t contacts = r.answer.contacts.size();
  r.answer = Outcome();
  r.has_answer = false;
  const StepReplay replay = replayStep(r);
  EXPECT_TRUE(replay.differences.empty());
  EXPECT_EQ(replay.answer.contacts.size(), contacts);
}

TEST(StepReplay, PatchesOfExpectedContactsAreMadeAgain) {
  MonitorOptions options = expecting();
  options.detector.patches = true;
  const StepRecording r = recordScene(options);
  StepRecording read = again(r);
  EXPECT_EQ(read.answer.patch_of, r.answer.patch_of);
  const auto expected = std::find_if(read.answer.patches.begin(), read.answer.patches.end(),
                                     [](const Patch& patch) { return patch.expected > 0; });
  ASSERT_NE(expected, read.answer.patches.end());
  EXPECT_TRUE(replayStep(read).differences.empty());
  --expected->expected;
  EXPECT_EQ(replayStep(read).differences.size(), 1u);
}

TEST(StepReplay, ImpossibleOptionsAreRefused) {
  const StepRecording good = recordScene();
  StepRecording uncut = good, empty = good, fine = good;
  uncut.options.max_substeps = 0;
  empty.step.bodies.clear();
  fine.options.accuracy.toc_bits = 99;
  for (const StepRecording* r : {&uncut, &empty, &fine}) EXPECT_THROW(replayStep(*r), std::invalid_argument);
}

}  // namespace
}  // namespace test
}  // namespace dccd
